"""The child process of `child_process`."""

from terrainkit_robots.rendering.child_process import main

main()

"""Former path of rl/config.py."""

from terrainkit_robots.rl.config import *  # noqa: F403

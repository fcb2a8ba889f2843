"""Collision: simpler shapes in the place of collision meshes."""

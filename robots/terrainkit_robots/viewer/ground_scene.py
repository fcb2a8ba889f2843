"""The ground of a policy in the browser. It imports no torch, so that it is shown at once."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from terrainkit.viewer.map_scene import FIELD_OF_VIEW, show_map
from terrainkit_robots.rl.terrain import Ground, MapGround
from terrainkit_robots.transforms import FloatArray

if TYPE_CHECKING:
    import viser

DEMO_MAP = Path(__file__).with_name("demo.toml")
"""Config of a map that the policy `quadruped_hard` crosses."""

_CAMERA_OFFSET = np.array([-1.5, -2.5, 1.5])
"""Position of the camera relative to the robot [m]."""

_ROBOT_HEIGHT = 0.3
"""Height above the ground that the camera looks at before there is a robot [m]."""


def show_ground(server: "viser.ViserServer", terrain: Ground) -> "viser.SceneNodeHandle":
    """Add the ground to the scene, seen from behind the place where the robot is spawned.

    Returns:
        The node that moves the ground.
    """
    if isinstance(terrain, MapGround):
        node: viser.SceneNodeHandle = show_map(server, terrain.terrain_map)
    else:
        server.scene.set_up_direction("+z")
        node = server.scene.add_grid("/map", infinite_grid=True, cell_size=0.5, section_size=5.0)
    first_row = terrain.env_origins[0]
    look_at(server, first_row[len(first_row) // 2] + [0.0, 0.0, _ROBOT_HEIGHT])
    return node


def look_at(server: "viser.ViserServer", position: FloatArray) -> None:
    """Have new pages look at a position [m], shape (3,), from behind."""
    camera = server.initial_camera
    camera.fov = FIELD_OF_VIEW
    camera.look_at = position
    camera.position = position + _CAMERA_OFFSET

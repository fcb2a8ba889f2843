"""What robots walk on in an evaluation: the dimension of each patch, and the collision geometry."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.rl.terrain import Ground, MapGround

_TERRAINS = {
    "step_height": "stairs pyramid_stairs random_stairs",
    "riser": "open_stairs spiral_stairs",
    "width": "gap",
    "length": "gap_track",
    "stone": "stepping_stones",
    "depth": "pit",
    "height": "boxes obstacles hurdles rails",
}
PARAMETERS = {kind: name for name, kinds in _TERRAINS.items() for kind in kinds.split()}
"""Parameter that is the dimension of a terrain, by its name in the registry."""


def patch_dimensions(terrain: Ground) -> NDArray[Any]:
    """Return the dimensions of the patches of a map.

    Args:
        terrain: The terrain.

    Returns:
        For each patch, the name of its terrain, the name of the parameter, and its realized value
        [m], rounded to 0.1 mm; None if the value is 0, or the terrain is not in `PARAMETERS`. Shape
        (rows, cols).
    """
    dimensions = np.full(terrain.terrain_names.shape, None)
    if not isinstance(terrain, MapGround):
        return dimensions
    terrain_map = terrain.terrain_map
    kinds = {
        sub_terrain.name: sub_terrain.terrain for sub_terrain in terrain_map.config.sub_terrains
    }
    parameters: Any = terrain_map.parameters
    for place, name in np.ndenumerate(terrain.terrain_names):
        parameter = PARAMETERS.get(kinds.get(str(name), ""), "")
        # Differs between x and y if the patch is not square.
        value: Any = np.ravel(parameters[place].realized.get(parameter, 0.0))[0]
        if value > 0:
            dimensions[place] = (str(name), parameter, round(float(value), 4))
    return dimensions


def collision_kind(terrain: Ground) -> str:
    """Return the collision geometry that is used: plane, hfield, or boxes where the map has walls.

    Args:
        terrain: The terrain.
    """
    if terrain.surface is None:
        return "plane"
    return "hfield" if terrain.surface.box_top is None else "boxes"

"""One storey of the buildings of a map, for pictures from above."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from terrainkit.errors import ConfigError
from terrainkit.geometry.free_space import CONTACT
from terrainkit.geometry.solids import Solids

if TYPE_CHECKING:
    from terrainkit.map.terrain_map import TerrainMap

CUT = 1.2
"""Height above the floor at which walls are cut off [m]."""

_SLAB, _WALL = 0.25, 0.2
"""Largest thickness of floors and of walls; other solids below a floor are stairs [m]."""


def storey_map(terrain_map: "TerrainMap", storey: int) -> "TerrainMap":
    """Return a map with one storey of each building at the height of the ground.

    Walls are cut off at `CUT`. Other solids and goals are left out, but for stairs from below.

    Args:
        terrain_map: A generated map.
        storey: The storey, 0 for the ground floor.

    Raises:
        ConfigError: if no building has this storey.
    """
    config, solids = terrain_map.config, terrain_map.solids
    goals, parts, most = np.full_like(terrain_map.goals, np.nan), [], 0
    for row, col in np.ndindex(terrain_map.difficulty.shape if config.mode != "custom" else (0, 0)):
        sub_terrain = config.sub_terrains[terrain_map.terrain_types[row, col]]
        terrain = sub_terrain.at(float(terrain_map.difficulty[row, col]))
        floors = terrain.floors(config.patch_grid(row, col))
        most = max(most, len(floors))
        if 0 <= storey < len(floors):
            own = solids.select((solids.patch == (row, col)).all(axis=1))
            parts.append(own.transform(np.eye(3), np.array([0.0, 0.0, -floors[storey]])))
            goals[row, col] = terrain_map.goals[row, col] - [0.0, 0.0, floors[storey], 0.0]
    if not parts:
        expected = f"0 to {most - 1}" if most else "a map with buildings"
        raise ConfigError(f"storey: got {storey}; expected {expected}")
    shown = Solids.concatenate(parts)
    lower, upper = shown.bounds()
    is_wall = (upper - lower)[:, :2].min(axis=1) < _WALL
    is_below = (upper[:, 2] < CONTACT) & (lower[:, 2] < -_SLAB)
    shown = shown.select((lower[:, 2] < CUT) & ~(is_wall & is_below))
    boxes = shown.boxes.copy()
    low = boxes[:, 2] - boxes[:, 5]
    boxes[:, 5] = np.minimum(2 * boxes[:, 5], CUT - low) / 2
    boxes[:, 2] = low + boxes[:, 5]
    goals[np.abs(goals[..., 2]) > CUT / 2] = np.nan
    return replace(terrain_map, solids=replace(shown, boxes=boxes), goals=goals)

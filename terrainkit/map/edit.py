"""Replace the heights or solids of a map."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrainkit.geometry.solids import Solids
from terrainkit.map.generation import pad_poses
from terrainkit.map.map_config import MapConfig
from terrainkit.map.patch import with_heading
from terrainkit.map.spawn import SpawnGround
from terrainkit.map.terrain_map import TerrainMap
from terrainkit.terrain.patch_geometry import checked_heights

_Map = TypeVar("_Map", bound=TerrainMap)


def edit_map(terrain_map: _Map, heights: ArrayLike | None, solids: Solids | None) -> _Map:
    """Return a map with other heights or solids; see `TerrainMap.edited`.

    Args:
        terrain_map: The map, which is not changed.
        heights: New heights [m], shape `grid.shape`; None to keep them.
        solids: All solids of the new map; None to keep them.

    Raises:
        ConfigError: if the heights or solids are invalid, or a patch has no place to spawn.
    """
    config = replace(terrain_map.config, mode="custom")
    new = terrain_map.heights
    if heights is not None:
        new = checked_heights(heights, terrain_map.grid, "heights: got")
    solids = assign_solids(config, terrain_map.solids if solids is None else solids)
    goals = terrain_map.goals.copy()
    walls = terrain_map.walls if heights is None else None  # they belong to the old heights
    raised = replace(terrain_map, heights=new, walls=walls)
    xy = np.nan_to_num(goals[..., :2])
    goals[..., 2] += raised.height(xy) - terrain_map.height(xy)
    spawns = np.empty(terrain_map.difficulty.shape, dtype=object)
    for row, col in np.ndindex(spawns.shape):
        old = terrain_map.patch(row, col).spawns
        patch_goals = goals[row, col][~np.isnan(goals[row, col, :, 0])]
        spawn_ground = SpawnGround.of_map(config, new, solids, (row, col), walls)
        rng = partial(np.random.default_rng, [config.seed, row, col])
        positions = _spawn_positions(spawn_ground, f"patch ({row}, {col})", old, rng)
        spawns[row, col] = with_heading(positions, patch_goals)
    return replace(
        raised,
        config=config,
        solids=solids,
        goals=goals,
        spawns=pad_poses(spawns),
    )


def assign_solids(config: MapConfig, solids: Solids) -> Solids:
    """Return the solids, each with the patch of its center, or the nearest patch."""
    lower, upper = solids.bounds()
    first = config.patch_grid(0, 0).lower
    number = np.floor(((lower + upper)[:, :2] / 2 - first) / config.patch_size)
    patch = np.clip(number, 0, (config.rows - 1, config.cols - 1)).astype(np.int32)
    return replace(solids, patch=patch)


def _spawn_positions(
    spawn_ground: SpawnGround,
    name: str,
    spawns: NDArray[np.float32],
    rng: Callable[[], np.random.Generator],
) -> NDArray[np.float64]:
    """Return the spawn positions of a patch [m], shape (n, 3).

    Args:
        spawn_ground: The ground of the patch.
        name: Name of the patch, for errors.
        spawns: Earlier spawn positions, which are kept if all of them are flat and free, shape
            (k, 4); x and y of the first are the preferred position otherwise.
        rng: Returns the generator of the random numbers.

    Raises:
        ConfigError: if the patch has no place to spawn.
    """
    kept = [
        (x, y, z) if spawn_ground.is_on_floor((x, y, z)) else spawn_ground.nearest_flat((x, y))
        for x, y, z in spawns[:, :3].tolist()
    ]
    if None not in kept and np.allclose(np.array(kept)[:, :2], spawns[:, :2], atol=1e-4):
        return np.array(kept)
    x, y = spawns[0, :2].tolist()
    return spawn_ground.sample(spawn_ground.find_origin(name, (x, y)), rng)

"""Replace the heights or solids of a map."""

from dataclasses import replace
from functools import partial
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids
from terrainkit.map.generation import pad_poses
from terrainkit.map.map_config import MapConfig
from terrainkit.map.patch import find_origin, with_heading
from terrainkit.map.spawn import find_spawn, is_on_floor, sample_spawns
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
    raised = replace(terrain_map, heights=new)
    xy = np.nan_to_num(goals[..., :2])
    goals[..., 2] += raised.height(xy) - terrain_map.height(xy)
    spawns = np.empty(terrain_map.difficulty.shape, dtype=object)
    for row, col in np.ndindex(spawns.shape):
        old = terrain_map.patch(row, col).spawns
        patch_goals = goals[row, col][~np.isnan(goals[row, col, :, 0])]
        spawns[row, col] = place_patch_spawns(config, new, solids, row, col, old, patch_goals)
    return replace(
        terrain_map,
        config=config,
        heights=new,
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


def place_patch_spawns(
    config: MapConfig,
    heights: NDArray[np.float32],
    solids: Solids,
    row: int,
    col: int,
    spawns: NDArray[np.float32],
    goals: NDArray[np.float32],
) -> NDArray[np.float32]:
    """Return the spawn positions of a patch, with headings.

    Args:
        config: Configuration of the map.
        heights: Heights of the map [m].
        solids: Solids of the map.
        row: Row of the patch.
        col: Column of the patch.
        spawns: Earlier spawn positions, which are kept if all of them are flat and free, shape
            (k, 4); x and y of the first are the preferred position otherwise.
        goals: Goals of the patch, shape (n, 4).

    Raises:
        ConfigError: if the patch has no place to spawn.
    """
    grid, block, near = patch_ground(config, heights, solids, row, col)
    kept = [
        (x, y, z)
        if is_on_floor(config, near, (x, y, z))
        else find_spawn(config, grid, block, near, (x, y))
        for x, y, z in spawns[:, :3].tolist()
    ]
    if None not in kept and np.allclose(np.array(kept)[:, :2], spawns[:, :2], atol=1e-4):
        positions = np.array(kept)
    else:
        x, y = spawns[0, :2].tolist()
        rng = partial(np.random.default_rng, [config.seed, row, col])
        origin = find_origin(config, f"patch ({row}, {col})", grid, block, near, (x, y))
        positions = sample_spawns(config, grid, block, near, origin, rng)
    return with_heading(positions, goals)


def patch_ground(
    config: MapConfig, heights: NDArray[np.float32], solids: Solids, row: int, col: int
) -> tuple[Grid, NDArray[np.float32], Solids]:
    """Return the grid and the heights of a patch, and the solids that reach into it.

    Args:
        config: Configuration of the map.
        heights: Heights of the map [m].
        solids: Solids of the map.
        row: Row of the patch.
        col: Column of the patch.
    """
    grid = config.patch_grid(row, col)
    lower, upper = (corner[:, :2] for corner in solids.bounds())
    reaches = np.all((upper >= grid.lower) & (lower <= grid.upper), axis=1)
    return grid, heights[config.patch_cells(row, col)], solids.select(np.asarray(reaches))

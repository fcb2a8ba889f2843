"""Build a terrain, alone and as a map of one patch."""

import numpy as np

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.geometry.grid import Grid

GRID = Grid(shape=(80, 80), cell=0.1)


def heights_of(terrain, seed=0, grid=GRID):
    return terrain.build(grid, np.random.default_rng(seed))


def solids_of(terrain, seed=0, grid=GRID):
    return terrain.solids(grid, heights_of(terrain, seed, grid), np.random.default_rng(seed))


def goals_of(terrain, seed=0, grid=GRID):
    return terrain.goals(grid, heights_of(terrain, seed, grid), np.random.default_rng(seed))


def tops(terrain_map, x, y):
    """Return the height of the highest surface at points, whose coordinates broadcast."""
    return terrain_map.scan(np.stack(np.broadcast_arrays(x, y, 9.0), axis=-1), "down")


def edges(profile):
    """Return before which cells of a line the ground rises or falls."""
    return (np.flatnonzero(np.diff(profile)) + 1).tolist()


def ends_along_x(is_element):
    """Return the first cell of each element across a lane, and the first cell behind it."""
    change = np.diff(np.pad(is_element[:, 0], 1).astype(int))
    return np.flatnonzero(change == 1), np.flatnonzero(change == -1)


def map_at(difficulty, terrain, size=(8.0, 8.0), **parameters):
    """Return a map of one patch without a border."""
    return generate(
        MapConfig(
            rows=1,
            cols=1,
            patch_size=size,
            mode="selected",
            selected_difficulty=difficulty,
            border=0.0,
            terrains=(SubTerrain(terrain=terrain, parameters=parameters),),
        )
    )

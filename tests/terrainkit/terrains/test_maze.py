import itertools

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solid_index import SolidIndex
from terrainkit.terrains.maze import Maze


def walls_of(terrain, grid, seed=0):
    return terrain.solids(
        grid, np.zeros(grid.shape, np.float32), np.random.default_rng(seed)
    ).bounds()


@pytest.mark.parametrize(("difficulty", "side"), [(0.0, 4 * 1.7 + 0.2), (1.0, 7 * 1.0 + 0.2)])
def test_maze_has_as_many_cells_as_fit(difficulty, side, grid):
    lower, upper = walls_of(Maze.at(difficulty), grid)
    assert lower.min(axis=0) == pytest.approx([4 - side / 2, 4 - side / 2, -0.05], abs=1e-5)
    assert upper.max(axis=0) == pytest.approx([4 + side / 2, 4 + side / 2, 1.0], abs=1e-5)
    assert np.min(upper - lower, axis=1) == pytest.approx(0.2, abs=1e-5)


def test_maze_clearing_is_free_of_walls(grid):
    for seed in range(10):
        lower, upper = walls_of(Maze(opened=0.0), grid, seed)
        reach = ((lower[:, :2] < 4.75) & (upper[:, :2] > 3.25)).all(axis=1)
        assert not reach.any()


@pytest.mark.parametrize("size", [(8.0, 8.0), (8.0, 4.0), (7.3, 5.1)])
def test_maze_goals_lead_through_open_cells(size):
    config = MapConfig(rows=3, cols=6, patch_size=size, terrains=(SubTerrain(terrain="maze"),))
    terrain_map = generate(config)
    for row, col in np.ndindex(3, 6):
        patch = terrain_map.patch(row, col)
        # No wall is on the straight lines from the spawn over the goals to the exit.
        xy = np.vstack([patch.origin[:2], patch.goals[:, :2]]).astype(float)
        way = [a + (b - a) * t for a, b in itertools.pairwise(xy) for t in np.linspace(0, 1, 50)]
        assert np.isnan(SolidIndex(patch.solids).spans(np.array(way))).all()
        _, upper = patch.solids.bounds()
        assert patch.goals[-1, 0] == pytest.approx(upper[:, 0].max() - 0.1, abs=1e-4)


def test_maze_rejects_patch_for_fewer_than_four_cells(rng):
    grid = Grid(shape=(30, 80), cell=0.1)
    with pytest.raises(ConfigError, match="expected at least 2 x 2 cells that fit in a patch of 3"):
        Maze(corridor=1.5).solids(grid, np.zeros(grid.shape, np.float32), rng)

import itertools

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.geometry.solid_index import SolidIndex
from terrainkit.terrains.maze import Maze
from tests.terrains import solids_of


@pytest.mark.parametrize(("difficulty", "side"), [(0.0, 4 * 1.7 + 0.2), (1.0, 7 * 1.0 + 0.2)])
def test_maze_has_as_many_cells_as_fit(difficulty, side):
    lower, upper = solids_of(Maze.at(difficulty)).bounds()
    assert lower.min(axis=0) == pytest.approx([4 - side / 2, 4 - side / 2, -0.05], abs=1e-5)
    assert upper.max(axis=0) == pytest.approx([4 + side / 2, 4 + side / 2, 1.0], abs=1e-5)
    assert np.min(upper - lower, axis=1) == pytest.approx(0.2, abs=1e-5)


@pytest.mark.parametrize("size", [(8.0, 8.0), (7.3, 5.1)])
def test_maze_goals_lead_through_open_cells(size):
    config = MapConfig(rows=3, cols=6, patch_size=size, terrains=(SubTerrain(terrain="maze"),))
    terrain_map = generate(config)
    for row, col in np.ndindex(3, 6):
        patch = terrain_map.patch(row, col)
        # No wall is on the straight lines from the spawn over the goals to the exit.
        xy = np.vstack([patch.origin[:2], patch.goals[:, :2]]).astype(float)
        way = [a + (b - a) * t for a, b in itertools.pairwise(xy) for t in np.linspace(0, 1, 50)]
        assert np.isnan(SolidIndex(patch.solids).intervals(np.array(way))).all()
        _, upper = patch.solids.bounds()
        assert patch.goals[-1, 0] == pytest.approx(upper[:, 0].max() - 0.1, abs=1e-4)

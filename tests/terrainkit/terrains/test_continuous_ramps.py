import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.terrains.continuous_ramps import ContinuousRamps


def heights_at(terrain, x, y):
    sub_terrain = SubTerrain(terrain="continuous_ramps", parameters=terrain.requested())
    terrain_map = generate(MapConfig(rows=1, cols=1, border=0.0, terrains=(sub_terrain,)))
    points = np.column_stack([x, np.full(len(x), y), np.full(len(x), 5.0)])
    return terrain_map.scan(points, "down")


def test_continuous_ramps_edges_meet_along_a_row():
    terrain = ContinuousRamps()
    # Rows of 1.2 m: the first of six begins at 0.4 m. 0.6 m at 15 degrees rise by 0.161 m.
    x = np.array([2.001, 2.3, 2.6, 2.9, 3.199, 3.5, 3.8, 4.399])
    zigzag = [0.0, 0.0804, 0.1608, 0.0804, 0.0, 0.0804, 0.1608, 0.0]
    assert heights_at(terrain, x, 1.0) == pytest.approx(zigzag, abs=1e-3)


def test_continuous_ramps_neighboring_rows_alternate():
    x = np.array([2.3, 2.599, 2.9, 3.199])
    low, high = (heights_at(ContinuousRamps(grade=0.2), x, y) for y in (1.0, 2.2))
    assert low + high == pytest.approx(0.12, abs=1e-3)


def test_continuous_ramps_goal_is_behind_the_ramps(grid, rng):
    terrain = ContinuousRamps()
    solids = terrain.solids(grid, np.zeros(grid.shape, np.float32), rng)
    goals = terrain.goals(grid, np.zeros(grid.shape, np.float32), rng)
    # Eight ramps of 0.6 m end at 6.8 m.
    assert solids.bounds()[1][:, 0].max() == pytest.approx(6.8)
    assert goals[:, :2].tolist() == pytest.approx(np.array([[7.4, 4.0]]))
    assert len(solids) == 8 * 6

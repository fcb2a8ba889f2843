import numpy as np
import pytest

from terrainkit.geometry.solid_index import SolidIndex
from terrainkit.terrains.crossing_ramps import CrossingRamps


def test_crossing_ramps_neighbors_are_a_quarter_turn_apart(grid, rng):
    terrain = CrossingRamps(grade=0.25, side=0.6)
    index = SolidIndex(terrain.solids(grid, np.zeros(grid.shape, np.float32), rng))
    x, y = np.meshgrid(2.3 + 0.6 * np.arange(8), 4 + 0.6 * (np.arange(13) - 6), indexing="ij")
    center = np.column_stack([x.ravel(), y.ravel()])

    def slope(axis):
        step = np.zeros(2)
        step[axis] = 0.1
        low, high = (index.spans(center + sign * step)[:, 0, 1] for sign in (-1, 1))
        return ((high - low) / 0.2).reshape(8, 13)

    along, across = slope(0), slope(1)
    is_along = np.indices((8, 13)).sum(axis=0) % 2 == 0
    assert np.abs(along[is_along]) == pytest.approx(0.25, abs=1e-4)
    assert np.abs(across[~is_along]) == pytest.approx(0.25, abs=1e-4)
    assert along[~is_along] == pytest.approx(0.0, abs=1e-4)
    assert across[is_along] == pytest.approx(0.0, abs=1e-4)
    assert {*np.sign(along[is_along])} == {*np.sign(across[~is_along])} == {-1.0, 1.0}


def test_crossing_ramps_rise_by_the_grade(grid, rng):
    terrain = CrossingRamps()
    _, upper = terrain.solids(grid, np.zeros(grid.shape, np.float32), rng).bounds()
    # tan(15 degrees) x 0.6 m.
    assert upper[:, 2] == pytest.approx(0.161, abs=1e-3)


def test_crossing_ramps_goal_is_behind_the_ramps(grid, rng):
    goals = CrossingRamps().goals(grid, np.zeros(grid.shape, np.float32), rng)
    assert goals[:, :2] == pytest.approx(np.array([[7.4, 4.0]]))

import pytest

from terrainkit.geometry.grid import Grid
from terrainkit.terrains.continuous_ramps import ContinuousRamps


def test_ramp_grid_is_centered_across_the_lane():
    grid = Grid(shape=(80, 40), cell=0.1, lower=(10.0, -2.0))
    lower, i, j = ContinuousRamps(start=2.0, end=1.0, length=2.0, width=1.5)._ramp_grid(grid)
    # 5 m along x hold two of 2 m, and 4 m along y two of 1.5 m with 0.5 m to either side.
    assert lower.ravel() == pytest.approx([12.0, -1.5, 12.0, 0.0, 14.0, -1.5, 14.0, 0.0])
    assert i.tolist() == [0, 0, 1, 1]
    assert j.tolist() == [0, 1, 0, 1]

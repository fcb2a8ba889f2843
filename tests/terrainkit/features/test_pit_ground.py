import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.features.pit_ground import pit_around, pit_between, pit_bounds
from terrainkit.geometry.grid import Grid


def test_pit_around_leaves_platform_and_rim():
    ground = pit_around(Grid(shape=(8, 6), cell=0.5), 0.7, 1.0)
    expected = np.zeros((8, 6))
    expected[1:-1, 1:-1] = -0.7
    expected[3:5, 2:4] = 0
    assert (ground == expected).all()


def test_pit_between_bounds_leaves_strips_and_rim():
    grid = Grid(shape=(8, 4), cell=0.5, lower=(3.0, -1.0))
    low, high = pit_bounds(grid, 1.5)
    ground = pit_between(grid, 0.7, low[0], high[0])
    assert (ground[3:5, 1:3] == -0.7).all()
    assert (ground != 0).sum() == 4
    assert [*low, *high] == [4.5, -0.5, 5.5, 0.5]


def test_pit_bounds_rejects_patch_without_pit():
    with pytest.raises(ConfigError, match="a rim of 1 m leave no pit in a patch of 2 m x 5 m"):
        pit_bounds(Grid(shape=(2, 5), cell=1.0))

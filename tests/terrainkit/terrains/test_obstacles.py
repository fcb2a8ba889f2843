import numpy as np
import pytest

from terrainkit.terrains.obstacles import Obstacles
from tests.terrains import heights_of

SEEDS = range(12)


def extent(heights):
    """Return the sides of the rectangle around everything that is not level, in cells."""
    x, y = (np.flatnonzero(heights.any(axis=axis)) for axis in (1, 0))
    return x[-1] - x[0] + 1, y[-1] - y[0] + 1


def test_obstacles_have_four_heights():
    levels = [heights_of(Obstacles(height=0.2), seed) for seed in SEEDS]
    assert np.unique(levels) == pytest.approx([-0.2, -0.1, 0.0, 0.1, 0.2])


def test_obstacles_sides_are_sampled_per_axis():
    terrain = Obstacles(number=1, platform=0.2)
    sides = np.array([extent(heights_of(terrain, seed)) for seed in range(150)])
    assert set(sides.ravel()) == set(range(10, 21))
    assert (sides[:, 0] != sides[:, 1]).any()

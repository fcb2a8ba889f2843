import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.terrains.rocks import Rocks


def rocks_of(terrain, grid, seed=0):
    heights = terrain.build(grid, np.random.default_rng(seed))
    return terrain.solids(grid, heights, np.random.default_rng(seed))


def test_rocks_are_hulls_within_their_radius(grid):
    solids = rocks_of(Rocks(height=0.6, min_radius=0.2, max_radius=0.6, amplitude=0.0), grid)
    lower, upper = solids.bounds()
    width = (upper - lower)[:, :2].max(axis=1)
    assert len(solids.hull_counts) == len(solids) > 10
    assert width.max() <= 1.2
    assert width.min() >= 0.2  # 16 random points nearly always span half of the diameter
    assert upper[:, 2].max() <= 0.6
    assert lower[:, 2].max() < 0


def test_rocks_stay_off_the_platform(grid):
    for seed in range(5):
        vertices = rocks_of(Rocks(), grid, seed).hull_vertices[:, :2]
        assert (np.abs(vertices - 4.0).max(axis=1) > 1.0).all()


def test_rocks_become_higher_at_the_same_places(grid):
    low, high = (rocks_of(Rocks(height=h, amplitude=0.0), grid) for h in (0.2, 0.4))
    scaled = low.hull_vertices * np.array([1.0, 1.0, 2.0])
    assert scaled == pytest.approx(high.hull_vertices, abs=1e-5)


def test_rocks_ground_is_rough_around_the_platform(grid, rng):
    heights = Rocks(amplitude=0.1).build(grid, rng)
    assert (heights[30:50, 30:50] == 0).all()
    assert np.abs(heights).max() == pytest.approx(0.1)


@pytest.mark.parametrize("values", [{"min_radius": 0.7}, {"max_radius": 2.0, "min_radius": 2.0}])
def test_rocks_rejects_rocks_that_do_not_fit(values, grid):
    with pytest.raises(ConfigError, match="expected min <= max, and a rock that fits"):
        rocks_of(Rocks(**values), grid)

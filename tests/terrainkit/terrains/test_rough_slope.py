import pytest

from terrainkit.terrains.pyramid_slope import PyramidSlope
from terrainkit.terrains.rough_slope import RoughSlope
from tests.terrains import GRID, heights_of


def roughness(terrain, grid=GRID):
    """Return how far the ground lies above the same slope without noise [m]."""
    slope = PyramidSlope(grade=terrain.grade, platform=terrain.platform, inverted=terrain.inverted)
    return heights_of(terrain, grid=grid).astype(float) - heights_of(slope, grid=grid)


@pytest.mark.parametrize("inverted", [False, True])
def test_rough_slope_without_noise_is_pyramid_slope(inverted):
    assert not roughness(RoughSlope(amplitude=0.0, inverted=inverted)).any()

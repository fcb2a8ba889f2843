import pytest

from terrainkit.terrains.pyramid_slope import PyramidSlope
from terrainkit.terrains.rough_slope import RoughSlope
from tests.terrains import heights_of


@pytest.mark.parametrize("inverted", [False, True])
def test_rough_slope_without_noise_is_pyramid_slope(inverted):
    rough = RoughSlope(amplitude=0.0, inverted=inverted)
    slope = PyramidSlope(grade=rough.grade, platform=rough.platform, inverted=inverted)
    assert (heights_of(rough) == heights_of(slope)).all()

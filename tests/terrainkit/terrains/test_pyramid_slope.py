import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrains.pyramid_slope import PyramidSlope
from tests.terrains import heights_of


def test_pyramid_slope_by_hand():
    heights = heights_of(PyramidSlope(grade=0.4, platform=3.0))
    # From the platform of 3 m to the edge of the 8 m patch are 2.5 m.
    up = 0.04 * np.minimum(np.arange(40), 25)
    profile = np.concatenate([up, up[::-1]])
    assert heights == pytest.approx(np.minimum.outer(profile, profile), abs=1e-6)
    assert (heights_of(PyramidSlope(grade=0.4, inverted=True)) == -heights).all()


def test_pyramid_slope_height_follows_from_the_shorter_side():
    heights = heights_of(PyramidSlope(grade=0.4), grid=Grid(shape=(80, 40), cell=0.1))
    # Along y the slope has 0.5 m, so it has 0.5 m along x too.
    assert heights[20:27, 20] == pytest.approx([0.0, 0.04, 0.08, 0.12, 0.16, 0.2, 0.2])
    assert heights[40, :7] == pytest.approx([0.0, 0.04, 0.08, 0.12, 0.16, 0.2, 0.2])
    assert not heights[:20].any()


def test_pyramid_slope_platform_as_wide_as_patch_is_rejected():
    message = "a platform of 4 m leaves no slope in a patch of 8 m x 4 m"
    with pytest.raises(ConfigError, match=message):
        heights_of(PyramidSlope(platform=4.0), grid=Grid(shape=(80, 40), cell=0.1))

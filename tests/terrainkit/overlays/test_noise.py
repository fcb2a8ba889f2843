import numpy as np
import pytest

from terrainkit.geometry.solids import make_boxes
from terrainkit.overlays.noise import Noise

RNG = np.random.default_rng


@pytest.mark.parametrize("pattern", ["uniform", "perlin"])
def test_noise_fills_its_amplitude(geometry, pattern):
    heights = Noise(amplitude=0.2, pattern=pattern, spacing=0.2).apply(geometry(), RNG(1)).heights
    assert heights.dtype == np.float32
    assert 0.15 < np.abs(heights).max() <= 0.2
    assert heights.min() < -0.1 < 0.1 < heights.max()


def test_noise_scales_with_the_difficulty(geometry):
    noise = Noise(amplitude=(0.0, 0.2))
    patches = [noise.at(d).apply(geometry(), RNG(1)).heights for d in (0.0, 0.5, 1.0)]
    assert not patches[0].any()
    assert 2 * patches[1] == pytest.approx(patches[2], abs=1e-7)


@pytest.mark.parametrize(("platform", "radius", "side"), [(2.0, 0.5, 2.0), (0.0, 0.8, 2.0)])
def test_noise_keeps_the_spawn_level(geometry, platform, radius, side):
    patch = geometry(spawn=(11.5, 22.0), spawn_radius=radius)
    heights = Noise(amplitude=0.2, platform=platform).apply(patch, RNG(1)).heights
    x, y = (np.abs(patch.grid.axis(k) - patch.spawn[k]) for k in (0, 1))
    level = np.maximum.outer(x, y) < side / 2
    assert not heights[level].any()
    assert (heights[~level] != 0).mean() > 0.9


def test_noise_keeps_the_ground_below_standing_solids(geometry):
    standing = make_boxes((13.5, 23.5, 0.5), (0.4, 0.4, 1.0))
    hanging = make_boxes((13.5, 20.5, 1.5), (0.4, 0.4, 1.0))
    for solids, is_kept in ((standing, True), (hanging, False)):
        patch = geometry(solids=solids)
        heights = Noise(amplitude=0.2).apply(patch, RNG(1)).heights
        x, y = (np.abs(patch.grid.axis(k) - solids.boxes[0, k]) < 0.21 for k in (0, 1))
        assert heights[np.ix_(x, y)].any() != is_kept


def test_noise_realizes_whole_intervals(geometry):
    grid = geometry().grid
    assert Noise(amplitude=0.1, spacing=0.3).realized(grid)["spacing"] == pytest.approx(4.0 / 13)
    assert Noise(pattern="perlin", spacing=0.3).realized(grid)["spacing"] == 0.3


def test_noise_realizes_its_own_parameters_only(geometry):
    """Heights are not rounded to steps, and the pattern has no parameters of its own."""
    noise = Noise(amplitude=(0.0, 0.2), spacing=0.5, platform=1.0).at(0.5)
    expected = {"amplitude": 0.1, "pattern": "uniform", "spacing": 0.5, "platform": 1.0}
    assert noise.realized(geometry().grid) == expected

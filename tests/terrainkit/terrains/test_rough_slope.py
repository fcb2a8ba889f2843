import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrains.pyramid_slope import PyramidSlope
from terrainkit.terrains.rough_slope import RoughSlope


def roughness(terrain, grid, seed=0):
    """Return how far the ground lies above the same slope without noise [m]."""
    slope = PyramidSlope(grade=terrain.grade, platform=terrain.platform, inverted=terrain.inverted)
    heights = terrain.build(grid, np.random.default_rng(seed)).astype(float)
    return heights - slope.build(grid, np.random.default_rng(seed))


@pytest.mark.parametrize("inverted", [False, True])
def test_rough_slope_without_noise_is_pyramid_slope(inverted, grid):
    terrain = RoughSlope(amplitude=0.0, inverted=inverted)
    assert not roughness(terrain, grid).any()


@pytest.mark.parametrize("shape", [(80, 80), (80, 40), (73, 51)])
def test_rough_slope_noise_is_within_amplitude(shape):
    noise = roughness(RoughSlope(amplitude=0.05), Grid(shape=shape, cell=0.1))
    assert np.abs(noise).max() <= 0.05 + 1e-6
    assert noise.min() < -0.02
    assert noise.max() > 0.02


@pytest.mark.parametrize(("shape", "side"), [((80, 80), 30), ((80, 40), 30), ((73, 51), 31)])
def test_rough_slope_platform_is_level(shape, side):
    grid = Grid(shape=shape, cell=0.1)
    noise = roughness(RoughSlope(platform=3.0), grid)
    top = np.zeros(shape, dtype=bool)
    x, y = ((n - side) // 2 for n in shape)
    top[x : x + side, y : y + side] = True
    assert not noise[top].any()
    assert (noise[~top] != 0).mean() > 0.8


def test_rough_slope_noise_is_independent_of_grade(grid):
    steep, level = RoughSlope(grade=0.4), RoughSlope(grade=0.0)
    below = RoughSlope(grade=0.4, inverted=True)
    assert roughness(steep, grid) == pytest.approx(roughness(level, grid), abs=1e-6)
    assert roughness(below, grid) == pytest.approx(roughness(level, grid), abs=1e-6)


def test_rough_slope_depends_on_the_generator(grid):
    assert (roughness(RoughSlope(), grid, 1) != roughness(RoughSlope(), grid, 2)).any()


@pytest.mark.parametrize(("difficulty", "peak"), [(0.0, 0.0), (0.5, 0.5), (1.0, 1.0)])
def test_rough_slope_grade_grows_with_difficulty(difficulty, peak, grid, rng):
    assert RoughSlope.at(difficulty).build(grid, rng)[40, 40] == pytest.approx(peak)


def test_rough_slope_realized_parameters():
    terrain = RoughSlope(grade=0.3, amplitude=0.05, step=0.02, spacing=0.24, platform=2.9)
    assert terrain.realized(Grid(shape=(80, 51), cell=0.1)) == {
        "grade": 0.3,
        "amplitude": 0.04,
        "step": 0.02,
        # 8 m are 33.3 intervals of 0.24 m, so 33; 5.1 m are 21.25, so 21.
        "spacing": (0.242424242, 0.242857143),
        # 30 and 29 cells; the slope starts at the centers of the outermost ones.
        "platform": (2.9, 2.8),
        "inverted": False,
    }


def test_rough_slope_platform_larger_than_patch_is_rejected(grid, rng):
    with pytest.raises(ConfigError, match="rough_slope: platform 9 m does not fit in a patch"):
        RoughSlope(platform=9.0).build(grid, rng)


@pytest.mark.parametrize("spacing", [0.04, 1e-310])
def test_rough_slope_spacing_below_a_cell_is_a_cell(spacing, grid):
    fine, cell = RoughSlope(spacing=spacing), RoughSlope(spacing=0.1)
    assert (roughness(fine, grid) == roughness(cell, grid)).all()

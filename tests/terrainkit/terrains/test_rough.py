import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrains.rough import Rough


def build(grid, seed=0, **parameters):
    return Rough(**parameters).build(grid, np.random.default_rng(seed))


@pytest.mark.parametrize("shape", [(80, 80), (80, 40), (73, 51)])
def test_rough_heights_are_within_amplitude(shape):
    heights = build(Grid(shape=shape, cell=0.1), amplitude=0.08)
    assert np.abs(heights).max() <= 0.08 + 1e-6
    assert heights.min() < -0.04
    assert heights.max() > 0.04


@pytest.mark.parametrize(
    ("shape", "asked", "sides"),
    [((80, 80), 2.0, (20, 20)), ((80, 40), 3.0, (30, 30)), ((73, 51), 2.0, (21, 21))],
)
def test_rough_platform_is_level_and_centered(shape, asked, sides):
    grid = Grid(shape=shape, cell=0.1)
    heights = build(grid, platform=asked)
    x, y = ((n - side) // 2 for n, side in zip(shape, sides, strict=True))
    assert not heights[x : x + sides[0], y : y + sides[1]].any()
    assert heights[x - 1].any()
    assert heights[:, y - 1].any()
    assert heights[x + sides[0]].any()
    # The noise starts at the centers of the outermost cells of the platform.
    realized = Rough(platform=asked).realized(grid)["platform"]
    assert realized == pytest.approx(sides[0] * 0.1 - 0.1)


def test_rough_noise_fades_over_one_spacing(grid):
    near, far = (build(grid, platform=2.0, spacing=spacing) for spacing in (0.1, 0.2))
    # The first ring around the platform has full noise at a spacing of one cell, half at two.
    assert np.abs(near[29, 30:50]).max() > 0.03
    assert np.abs(far[29, 30:50]).max() <= 0.05


def test_rough_neighbors_differ_by_interpolation(grid):
    # Between two draws 0.4 m apart lie four cells, and at most twice the amplitude.
    heights = build(grid, amplitude=0.1, spacing=0.4, platform=0.2)
    assert np.abs(np.diff(heights, axis=0)).max() <= 2 * 0.1 / 4 + 0.1 / 4 + 1e-6


def test_rough_pattern_is_independent_of_amplitude(grid):
    low, high = (build(grid, amplitude=amplitude, step=0.0) for amplitude in (0.05, 0.1))
    assert high == pytest.approx(2 * low, abs=1e-6)


def test_rough_depends_on_the_generator(grid):
    assert (build(grid, 1) != build(grid, 2)).any()


@pytest.mark.parametrize(("difficulty", "amplitude"), [(0.0, 0.02), (0.5, 0.06), (1.0, 0.1)])
def test_rough_amplitude_grows_with_difficulty(difficulty, amplitude, grid, rng):
    highest = np.abs(Rough.at(difficulty).build(grid, rng)).max()
    assert 0.8 * amplitude < highest <= amplitude + 1e-6


def test_rough_realized_parameters():
    terrain = Rough(amplitude=0.036, step=0.005, spacing=0.27, platform=2.04)
    assert terrain.realized(Grid(shape=(80, 51), cell=0.1)) == {
        "amplitude": 0.035,
        "step": 0.005,
        # 8 m are 29.6 intervals of 0.27 m, so 30; 5.1 m are 18.9, so 19.
        "spacing": (0.266666667, 0.268421053),
        # 20 and 21 cells; the noise starts at the centers of the outermost ones.
        "platform": (1.9, 2.0),
    }


@pytest.mark.parametrize("spacing", [0.04, 1e-310])
def test_rough_spacing_below_a_cell_is_a_cell(spacing, grid):
    assert (build(grid, spacing=spacing) == build(grid, spacing=0.1)).all()


def test_rough_platform_larger_than_patch_is_rejected(grid):
    with pytest.raises(ConfigError, match="rough: platform 9 m does not fit in a patch of 8 m x 8"):
        build(grid, platform=9.0)

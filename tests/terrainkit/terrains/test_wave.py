import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrains.wave import Wave


def test_wave_of_four_cells_by_hand(rng):
    grid = Grid(shape=(17, 17), cell=0.1)
    heights = Wave(amplitude=0.2, number=4, platform=0.1).build(grid, rng)
    # Samples at 0, 90, 180 and 270 degrees.
    assert heights[1] == pytest.approx([*[0.0, 0.2, 0.0, -0.2] * 4, 0.0])
    assert heights[3] == pytest.approx([*[0.0, -0.2, 0.0, 0.2] * 4, 0.0])
    assert heights[:, 1] == pytest.approx([*[0.0, 0.2, 0.0, -0.2] * 4, 0.0])


@pytest.mark.parametrize(("number", "shape"), [(1, (80, 80)), (4, (80, 40)), (5, (73, 51))])
def test_wave_number_is_whole_per_side(number, shape, rng):
    heights = Wave(number=number, platform=0.2).build(Grid(shape=shape, cell=0.1), rng)
    # A wave crosses zero in its middle; between two waves it crosses zero too.
    for line in (heights[1], heights[:, 1]):
        signs = np.sign(line[line != 0])
        assert np.count_nonzero(np.diff(signs)) == 2 * number - 1


@pytest.mark.parametrize(("shape", "cell"), [((80, 40), 0.1), ((73, 51), 0.1), ((32, 32), 0.25)])
def test_wave_rim_is_zero(shape, cell, rng):
    heights = Wave(amplitude=0.2).build(Grid(shape=shape, cell=cell), rng)
    assert not heights[[0, -1]].any()
    assert not heights[:, [0, -1]].any()
    assert heights[1].any()


def test_wave_reaches_the_amplitude(grid, rng):
    heights = Wave(amplitude=0.2).build(grid, rng)
    # A wave is 79 / 4 cells of 18.2 degrees. The sample nearest to a crest is 1.1 degrees off it:
    # 0.2 * cos(1.1 deg)^2 = 0.19992.
    assert heights.max() == pytest.approx(0.19992, abs=1e-5)
    assert heights.min() == pytest.approx(-0.19992, abs=1e-5)
    assert Wave(amplitude=0.2).realized(grid)["amplitude"] == pytest.approx(0.19992, abs=1e-5)


@pytest.mark.parametrize(("shape", "side"), [((80, 80), 16), ((80, 40), 16), ((73, 51), 15)])
def test_wave_platform_is_level_and_centered(shape, side, rng):
    # 1.5 m are 15 cells: half-way between 14 and 16, and halves round up.
    grid = Grid(shape=shape, cell=0.1)
    heights = Wave(amplitude=0.2).build(grid, rng)
    x, y = ((n - side) // 2 for n in shape)
    assert not heights[x : x + side, y : y + side].any()
    assert heights[x - 1, y : y + side].any()
    assert heights[x : x + side, y - 1].any()
    # The waves start at the centers of the outermost cells of the platform.
    assert Wave().realized(grid)["platform"] == pytest.approx(side * 0.1 - 0.1)


def test_wave_fades_over_a_quarter_wave(grid, rng):
    wide, narrow = (Wave(number=4, platform=side).build(grid, rng) for side in (1.6, 0.2))
    # A wave is 2 m, a quarter of it five cells; the platform of 16 cells begins at cell 32.
    assert wide[27:32, 45] / narrow[27:32, 45] == pytest.approx([1.0, 0.8, 0.6, 0.4, 0.2])


@pytest.mark.parametrize(("difficulty", "amplitude"), [(0.0, 0.0), (0.5, 0.1), (1.0, 0.2)])
def test_wave_amplitude_grows_with_difficulty(difficulty, amplitude, grid, rng):
    heights = Wave.at(difficulty).build(grid, rng)
    assert heights.max() == pytest.approx(0.9996 * amplitude, abs=1e-4)


def test_wave_needs_four_cells_per_wave(rng):
    grid = Grid(shape=(40, 15), cell=0.1)
    assert Wave(number=3, platform=0.5).build(grid, rng).any()
    with pytest.raises(
        ConfigError, match=r"wave: 4 waves need .* 16 along both axes; the patch has 40 x 15"
    ):
        Wave(number=4, platform=0.5).build(grid, rng)


def test_wave_numpy_count_does_not_overflow(rng):
    # 64 waves need 256 cells, one more than a uint8 holds.
    grid = Grid(shape=(260, 260), cell=0.1)
    counted = Wave(number=np.uint8(64)).build(grid, rng)
    assert (counted == Wave(number=64).build(grid, rng)).all()


def test_wave_platform_larger_than_patch_is_rejected(grid, rng):
    with pytest.raises(ConfigError, match="wave: platform 9 m does not fit in a patch"):
        Wave(platform=9.0).build(grid, rng)

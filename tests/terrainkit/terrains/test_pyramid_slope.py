import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrains.pyramid_slope import PyramidSlope


def quads(heights):
    """Return the four corners of each quad between samples, shape (4, nx - 1, ny - 1) [m]."""
    return np.stack([heights[:-1, :-1], heights[1:, :-1], heights[:-1, 1:], heights[1:, 1:]])


def test_pyramid_slope_peak_height(grid, rng):
    heights = PyramidSlope(grade=0.4, platform=3.0).build(grid, rng)
    # From the platform of 3 m to the edge of the 8 m patch are 2.5 m.
    assert heights.max() == pytest.approx(1.0)
    assert heights.min() == 0.0


@pytest.mark.parametrize(("shape", "run"), [((80, 80), 25), ((80, 40), 5), ((73, 51), 10)])
def test_pyramid_slope_has_constant_grade(shape, run, rng):
    grid = Grid(shape=shape, cell=0.1)
    corners = quads(PyramidSlope(grade=0.4).build(grid, rng))
    grades = np.ptp(corners, axis=0) / 0.1
    # Quads between the platform and ring `run` slope; the others are flat.
    rings = quads(grid.rings(grid.centered(3.0)))
    slope = (rings.max(axis=0) > 0) & (rings.min(axis=0) < run)
    assert grades[slope] == pytest.approx(np.full(slope.sum(), 0.4), abs=1e-5)
    assert not grades[~slope].any()


@pytest.mark.parametrize(
    ("shape", "asked", "sides"),
    [
        ((80, 80), 3.0, (30, 30)),
        ((80, 80), 2.0, (20, 20)),
        ((80, 40), 3.0, (30, 30)),
        ((73, 51), 3.0, (31, 31)),
        ((80, 51), 3.0, (30, 31)),
    ],
)
def test_pyramid_slope_platform_is_level_and_centered(shape, asked, sides, rng):
    grid = Grid(shape=shape, cell=0.1)
    slope = PyramidSlope(grade=0.4, platform=asked)
    top = slope.build(grid, rng) == slope.build(grid, rng).max()
    assert (top.any(axis=1).sum(), top.any(axis=0).sum()) == sides
    assert top.sum() == sides[0] * sides[1]
    assert (top == top[::-1, ::-1]).all()
    # The slope starts at the centers of the outermost cells of the platform.
    realized = slope.realized(grid)["platform"]
    assert np.broadcast_to(realized, 2) == pytest.approx(np.array(sides) * 0.1 - 0.1)


@pytest.mark.parametrize("inverted", [False, True])
@pytest.mark.parametrize("shape", [(80, 80), (80, 40), (40, 80), (73, 51)])
def test_pyramid_slope_rim_is_at_height_zero(shape, inverted, rng):
    heights = PyramidSlope(inverted=inverted).build(Grid(shape=shape, cell=0.1), rng)
    assert not heights[[0, -1]].any()
    assert not heights[:, [0, -1]].any()


def test_pyramid_slope_height_follows_from_the_shorter_side(rng):
    heights = PyramidSlope(grade=0.4).build(Grid(shape=(80, 40), cell=0.1), rng)
    # Along y the slope has 0.5 m, so it has 0.5 m along x too.
    assert heights.max() == pytest.approx(0.2)
    assert not heights[:21].any()
    assert heights[21, 20] == pytest.approx(0.04)


def test_pyramid_slope_platform_as_wide_as_patch_is_rejected(rng):
    with pytest.raises(
        ConfigError, match="a platform of 4 m leaves no slope in a patch of 8 m x 4 m"
    ):
        PyramidSlope(platform=4.0).build(Grid(shape=(80, 40), cell=0.1), rng)


def test_pyramid_slope_is_symmetric(grid, rng):
    heights = PyramidSlope().build(grid, rng)
    assert (heights == heights.T).all()
    assert (heights == heights[::-1]).all()


def test_pyramid_slope_inverted_is_negated(grid, rng):
    upright = PyramidSlope(grade=0.3).build(grid, rng)
    assert (PyramidSlope(grade=0.3, inverted=True).build(grid, rng) == -upright).all()


@pytest.mark.parametrize(("difficulty", "peak"), [(0.0, 0.0), (0.5, 0.5), (1.0, 1.0)])
def test_pyramid_slope_grade_grows_with_difficulty(difficulty, peak, grid, rng):
    assert PyramidSlope.at(difficulty).build(grid, rng).max() == pytest.approx(peak)


def test_pyramid_slope_platform_of_whole_patch_is_rejected(grid, rng):
    with pytest.raises(ConfigError, match="platform 8 m fills the whole patch of 8 m x 8"):
        PyramidSlope(grade=0.4, platform=8.0).build(grid, rng)


@pytest.mark.parametrize(("shape", "size"), [((80, 80), "8 m x 8 m"), ((90, 80), "9 m x 8 m")])
def test_pyramid_slope_platform_larger_than_patch_is_rejected(shape, size, rng):
    with pytest.raises(
        ConfigError, match=rf"pyramid_slope: platform 8\.2 m does not fit in a patch of {size}"
    ):
        PyramidSlope(platform=8.2).build(Grid(shape=shape, cell=0.1), rng)


def test_pyramid_slope_platform_below_a_cell_is_rejected(grid, rng):
    with pytest.raises(
        ConfigError, match=r"platform 0\.05 m is smaller than a cell; expected at least 0\.1 m"
    ):
        PyramidSlope(platform=0.05).build(grid, rng)

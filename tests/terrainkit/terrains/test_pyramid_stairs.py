import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrains.pyramid_stairs import PyramidStairs


def edges(profile):
    """Return before which cells the ground changes."""
    return (np.flatnonzero(np.diff(profile)) + 1).tolist()


def test_pyramid_stairs_have_equal_steps(grid, rng):
    heights = PyramidStairs(step_height=0.1, step_width=0.5, platform=3.0).build(grid, rng)
    # 2.5 m from the edge to the platform are five steps of five cells, and five back down.
    up, down = [5, 10, 15, 20, 25], [55, 60, 65, 70, 75]
    assert edges(heights[:, 40]) == edges(heights[40]) == up + down
    assert np.unique(heights) == pytest.approx(0.1 * np.arange(6), abs=1e-6)


def test_pyramid_stairs_outermost_tread_takes_the_rest(grid, rng):
    heights = PyramidStairs(step_height=0.1, step_width=0.3, platform=3.0).build(grid, rng)
    # 25 cells hold eight steps of three; the outermost tread is four wide, at height 0.
    assert edges(heights[:40, 40]) == [4, 7, 10, 13, 16, 19, 22, 25]
    assert heights[0, 0] == 0.0
    assert heights[40, 40] == pytest.approx(0.8)


def test_pyramid_stairs_width_0_31_is_built_as_0_3(grid, rng):
    stairs = PyramidStairs(step_width=0.31)
    assert stairs.requested()["step_width"] == 0.31
    assert stairs.realized(grid)["step_width"] == 0.3
    assert set(np.diff(edges(stairs.build(grid, rng)[:40, 40]))) == {3}


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
def test_pyramid_stairs_platform_is_centered(shape, asked, sides, rng):
    grid = Grid(shape=shape, cell=0.1)
    stairs = PyramidStairs(platform=asked)
    heights = stairs.build(grid, rng)
    top = heights == heights.max()
    assert (top.any(axis=1).sum(), top.any(axis=0).sum()) == sides
    assert top.sum() == sides[0] * sides[1]
    assert (top == top[::-1, ::-1]).all()
    realized = stairs.realized(grid)["platform"]
    assert np.broadcast_to(realized, 2) == pytest.approx(np.array(sides) * 0.1)


def test_pyramid_stairs_follow_the_shorter_side(rng):
    stairs = PyramidStairs(step_height=0.1, step_width=0.3, platform=2.0)
    heights = stairs.build(Grid(shape=(80, 40), cell=0.1), rng)
    # Along y there are ten cells: three steps, and an outermost tread of four cells.
    assert edges(heights[40]) == [4, 7, 10, 30, 33, 36]
    # Along x the outermost tread has 30 - 6 cells.
    assert edges(heights[:, 20]) == [24, 27, 30, 50, 53, 56]
    assert heights.max() == pytest.approx(0.3)


@pytest.mark.parametrize("inverted", [False, True])
@pytest.mark.parametrize("shape", [(80, 80), (80, 40), (40, 80), (73, 51)])
def test_pyramid_stairs_rim_is_at_height_zero(shape, inverted, rng):
    heights = PyramidStairs(inverted=inverted).build(Grid(shape=shape, cell=0.1), rng)
    assert not heights[[0, -1]].any()
    assert not heights[:, [0, -1]].any()


def test_pyramid_stairs_are_symmetric(grid, rng):
    heights = PyramidStairs().build(grid, rng)
    assert (heights == heights.T).all()
    assert (heights == heights[::-1]).all()


def test_pyramid_stairs_inverted_are_negated(grid, rng):
    upright = PyramidStairs().build(grid, rng)
    assert (PyramidStairs(inverted=True).build(grid, rng) == -upright).all()


@pytest.mark.parametrize(("difficulty", "rise"), [(0.0, 0.05), (0.5, 0.14), (1.0, 0.23)])
def test_pyramid_stairs_height_grows_with_difficulty(difficulty, rise, grid, rng):
    profile = PyramidStairs.at(difficulty).build(grid, rng)[:40, 40]
    assert np.diff(profile).max() == pytest.approx(rise)


def test_pyramid_stairs_narrow_step_is_one_cell(grid, rng):
    stairs = PyramidStairs(step_width=0.01)
    assert stairs.realized(grid)["step_width"] == 0.1
    assert edges(stairs.build(grid, rng)[:40, 40]) == list(range(1, 26))


def test_pyramid_stairs_minimum_is_one_step(grid, rng):
    heights = PyramidStairs(step_height=0.2, step_width=0.3, platform=7.4).build(grid, rng)
    assert np.unique(heights).tolist() == pytest.approx([0.0, 0.2])


def test_pyramid_stairs_without_room_are_rejected(grid, rng):
    with pytest.raises(
        ConfigError,
        match=r"pyramid_stairs: no step of 0\.3 m fits between the platform of 7\.6 m and the edge",
    ):
        PyramidStairs(step_width=0.3, platform=7.6).build(grid, rng)


def test_pyramid_stairs_platform_larger_than_patch_is_rejected(grid, rng):
    with pytest.raises(
        ConfigError, match="pyramid_stairs: platform 9 m does not fit in a patch of 8 m x 8 m"
    ):
        PyramidStairs(platform=9.0).build(grid, rng)

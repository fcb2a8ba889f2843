import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrains.stairs import Stairs


def risers(heights):
    """Return before which cells along x the ground rises."""
    return (np.flatnonzero(np.diff(heights[:, 0])) + 1).tolist()


def test_stairs_go_up_and_down_in_equal_steps(grid, rng):
    heights = Stairs(step_height=0.1, step_width=0.4, landing=2.0).build(grid, rng)
    # 4 m between the ends: four treads of 0.4 m up, a top of 0.8 m, and four treads down.
    assert risers(heights) == [20, 24, 28, 32, 36, 44, 48, 52, 56, 60]
    assert np.diff(heights[:, 0])[19] == pytest.approx(0.1)
    assert np.unique(heights) == pytest.approx(0.1 * np.arange(6), abs=1e-6)
    assert (heights == heights[::-1]).all()


def test_stairs_top_takes_the_remaining_cells(grid, rng):
    heights = Stairs(step_height=0.1, step_width=0.3, landing=2.0).build(grid, rng)
    # 40 cells are six treads of 3 up, six down, and a top of 4.
    assert risers(heights) == [*range(20, 39, 3), *range(42, 61, 3)]
    assert heights[38:42, 0] == pytest.approx(np.full(4, 0.7))


def test_stairs_end_at_height_zero(grid, rng):
    heights = Stairs().build(grid, rng)
    assert not heights[:20].any()
    assert not heights[-20:].any()


def test_stairs_width_0_31_is_built_as_0_3(grid, rng):
    stairs = Stairs(step_width=0.31)
    assert stairs.requested()["step_width"] == 0.31
    assert stairs.realized(grid)["step_width"] == 0.3
    assert set(np.diff(risers(stairs.build(grid, rng)))) == {3, 4}  # the top is wider


def test_stairs_span_the_width(rng):
    heights = Stairs().build(Grid(shape=(73, 51), cell=0.1), rng)
    assert np.ptp(heights, axis=1).max() == 0.0


@pytest.mark.parametrize(
    ("shape", "cell", "count"),
    [
        ((80, 40), 0.1, 7),  # 40 cells hold 12 treads of 3 and a top of 4
        ((73, 51), 0.1, 6),  # 33 cells hold 10 and a top of 3
        ((40, 40), 0.2, 5),  # 20 cells hold 8 of 2 and a top of 4
        ((43, 40), 0.1, 1),  # only a top of 3
    ],
)
def test_stairs_number_of_steps_fills_the_patch(shape, cell, count, rng):
    heights = Stairs(step_height=0.2).build(Grid(shape=shape, cell=cell), rng)
    assert len(risers(heights)) == 2 * count
    assert heights.max() == pytest.approx(0.2 * count)


def test_stairs_inverted_are_negated(grid, rng):
    rising = Stairs().build(grid, rng)
    assert (Stairs(inverted=True).build(grid, rng) == -rising).all()


@pytest.mark.parametrize(("difficulty", "rise"), [(0.0, 0.05), (0.5, 0.14), (1.0, 0.23)])
def test_stairs_height_grows_with_difficulty(difficulty, rise, grid, rng):
    heights = Stairs.at(difficulty).build(grid, rng)
    assert np.diff(heights[:, 0]).max() == pytest.approx(rise)


def test_stairs_spawn_is_on_the_lower_landing():
    grid = Grid(shape=(80, 51), cell=0.1, lower=(16.0, 10.2))
    assert Stairs(landing=2.0).spawn(grid) == pytest.approx((17.0, 12.75))


def test_stairs_landings_too_long_are_rejected(grid, rng):
    with pytest.raises(
        ConfigError,
        match=r"stairs: two landings of 3\.9 m leave no step of 0\.31 m in a patch 8 m long",
    ):
        Stairs(landing=3.9).build(grid, rng)


def test_stairs_narrow_step_is_one_cell(grid, rng):
    stairs = Stairs(step_width=0.04)
    assert stairs.realized(grid)["step_width"] == 0.1
    # 40 cells between the ends: 19 treads up, a top of two cells, 19 treads down.
    assert risers(stairs.build(grid, rng)) == [*range(20, 40), *range(41, 61)]

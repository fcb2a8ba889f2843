import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid, whole_cells


def test_grid_samples_are_cell_centers():
    grid = Grid(shape=(80, 40), cell=0.1)
    assert grid.axis(0)[[0, 1, -1]] == pytest.approx([0.05, 0.15, 7.95])
    assert grid.axis(1)[[0, 1, -1]] == pytest.approx([0.05, 0.15, 3.95])


def test_grid_size_is_shape_times_cell():
    grid = Grid(shape=(80, 40), cell=0.1, lower=(-2.0, 1.0))
    assert grid.size == pytest.approx((8.0, 4.0))
    assert grid.upper == pytest.approx((6.0, 5.0))
    assert grid.center == pytest.approx((2.0, 3.0))


def test_grid_axis_starts_at_the_lower_corner():
    grid = Grid(shape=(3, 2), cell=0.5, lower=(-1.0, 4.0))
    assert grid.axis(0).tolist() == [-0.75, -0.25, 0.25]
    assert grid.axis(1).tolist() == [4.25, 4.75]


def test_grid_block_has_the_position_of_its_cells():
    grid = Grid(shape=(10, 12), cell=0.5, lower=(1.0, -1.0))
    block = grid.block((2, 3), (4, 5))
    assert block == Grid(shape=(4, 5), cell=0.5, lower=(2.0, 0.5))
    assert block.axis(0).tolist() == grid.axis(0)[2:6].tolist()
    assert block.axis(1).tolist() == grid.axis(1)[3:8].tolist()


@pytest.mark.parametrize(
    ("length", "cell", "count"),
    [
        (0.3, 0.1, 3),  # 0.3 / 0.1 is 2.9999999999999996
        (0.31, 0.1, 3),
        (0.26, 0.1, 3),
        (0.24, 0.1, 2),
        (0.05, 0.1, 1),
        (1.15, 0.1, 12),  # 1.15 / 0.1 is 11.499999999999998
        (0.25, 0.1, 3),
        (8.2, 0.1, 82),
        (0.31, 0.05, 6),
    ],
)
def test_grid_cells_round_half_up(length, cell, count):
    assert Grid(shape=(1, 1), cell=cell).cells(length) == count


@pytest.mark.parametrize("length", [0.0, 0.001, 0.04])
def test_grid_cells_are_at_least_the_minimum(length):
    grid = Grid(shape=(1, 1), cell=0.1)
    assert grid.cells(length) == 1
    assert grid.cells(length, minimum=0) == 0


def test_grid_length_of_three_cells_is_exact():
    assert Grid(shape=(1, 1), cell=0.1).length(3) == 0.3


@settings(deadline=None, derandomize=True, max_examples=100)
@given(count=st.integers(1, 10_000), cell=st.sampled_from([0.01, 0.03, 0.05, 0.1, 0.2, 0.7]))
def test_grid_length_inverts_cells(count, cell):
    grid = Grid(shape=(1, 1), cell=cell)
    assert grid.cells(grid.length(count)) == count


@pytest.mark.parametrize(
    ("shape", "size", "counts"),
    [
        ((80, 80), 3.0, (30, 30)),
        ((80, 40), 3.04, (30, 30)),
        ((80, 80), 3.1, (32, 32)),
        ((73, 51), 3.0, (31, 31)),
        ((80, 51), 3.0, (30, 31)),
        ((81, 80), 3.1, (31, 32)),
        ((80, 80), 0.09, (0, 0)),
        ((81, 81), 0.09, (1, 1)),
    ],
)
def test_grid_centered_has_the_parity_of_the_axis(shape, size, counts):
    assert Grid(shape=shape, cell=0.1).centered(size) == counts


@settings(deadline=None, derandomize=True, max_examples=100)
@given(n=st.integers(60, 120), size=st.floats(0.1, 5.9))
def test_grid_centered_is_within_one_cell(n, size):
    grid = Grid(shape=(n, n), cell=0.1)
    block = grid.centered(size)
    assert abs(block[0] * 0.1 - size) <= 0.1 + 1e-6
    middle = grid.centered_slices(block)[0]
    assert middle.stop - middle.start == block[0]
    assert middle.start == n - middle.stop


def test_grid_rings_around_one_cell():
    rings = Grid(shape=(5, 5), cell=0.1).rings((1, 1))
    assert rings.tolist() == [
        [2, 2, 2, 2, 2],
        [2, 1, 1, 1, 2],
        [2, 1, 0, 1, 2],
        [2, 1, 1, 1, 2],
        [2, 2, 2, 2, 2],
    ]


def test_grid_rings_of_a_long_grid():
    rings = Grid(shape=(6, 4), cell=0.1).rings((2, 2))
    assert rings.tolist() == [
        [2, 2, 2, 2],
        [1, 1, 1, 1],
        [1, 0, 0, 1],
        [1, 0, 0, 1],
        [1, 1, 1, 1],
        [2, 2, 2, 2],
    ]


def test_grid_centered_slices_are_ring_zero():
    grid = Grid(shape=(9, 6), cell=0.1)
    inside = np.zeros(grid.shape, dtype=bool)
    inside[grid.centered_slices((3, 2))] = True
    assert inside.sum() == 6
    assert (inside == (grid.rings((3, 2)) == 0)).all()


def test_grid_fade_rises_from_block_to_distance():
    fade = Grid(shape=(9, 9), cell=0.1).fade((1, 1), 0.2)
    assert fade[4] == pytest.approx([1, 1, 1, 0.5, 0, 0.5, 1, 1, 1])
    assert fade[0] == pytest.approx(np.ones(9))


@pytest.mark.parametrize(
    ("length", "cell", "count"), [(8.0, 0.1, 80), (0.3, 0.1, 3), (25.0, 0.05, 500), (0.1, 0.1, 1)]
)
def test_whole_cells_accepts_rounding(length, cell, count):
    assert whole_cells("border", length, cell) == count


def test_whole_cells_accepts_zero_with_minimum_zero():
    assert whole_cells("border", 0.0, 0.1, minimum=0) == 0


@pytest.mark.parametrize("length", [0.0, 0.04])
def test_whole_cells_rejects_zero_by_default(length):
    with pytest.raises(
        ConfigError, match=rf"border: got {length:g} m; expected .* 0\.1 m or 0\.2 m"
    ):
        whole_cells("border", length, 0.1)


def test_whole_cells_lists_nearest_lengths():
    with pytest.raises(
        ConfigError,
        match=r"border: got 8\.05 m; expected a whole number of cells .* 8 m or 8\.1 m",
    ):
        whole_cells("border", 8.05, 0.1)


@pytest.mark.parametrize("length", [math.inf, math.nan, 1e308])
def test_whole_cells_rejects_uncountable_lengths(length):
    with pytest.raises(ConfigError, match=r"border .* is too many cells of 0\.1 m"):
        whole_cells("border", length, 0.1)


def test_grid_margins_are_cells_beyond_the_block():
    assert Grid(shape=(80, 41), cell=0.1).margins((30, 31)) == (25, 5)


@pytest.mark.parametrize(
    ("center", "count", "first"), [(1.0, 2, 4), (1.0, 3, 4), (1.1, 3, 4), (-0.5, 2, 0)]
)
def test_grid_slice_along_x_is_around_the_center(center, count, first):
    grid = Grid(shape=(20, 4), cell=0.2)
    assert grid.slice_along_x(center, count) == slice(first, first + count)

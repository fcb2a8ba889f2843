import math

import numpy as np
import pytest
from hypothesis import strategies as st

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid, whole_cells
from tests.tables import read_table
from tests.terrainkit.geometry.heightfields import for_any


def test_grid_has_the_positions_of_its_cells():
    grid = Grid(shape=(3, 2), cell=0.5, lower=(-1.0, 4.0))
    assert [grid.axis(k).tolist() for k in (0, 1)] == [[-0.75, -0.25, 0.25], [4.25, 4.75]]
    assert (grid.size, grid.upper, grid.center) == ((1.5, 1.0), (0.5, 5.0), (-0.25, 4.5))
    block = Grid(shape=(10, 12), cell=0.5, lower=(1.0, -1.0)).block((2, 3), (4, 5))
    assert block == Grid(shape=(4, 5), cell=0.5, lower=(2.0, 0.5))


@pytest.mark.parametrize(("length", "cell", "count"), read_table(__file__, "grid_cells_round_half"))
def test_grid_cells_round_half_up(length, cell, count):
    assert Grid(shape=(1, 1), cell=cell).cells(length) == count


def test_grid_cells_are_at_least_the_minimum():
    grid = Grid(shape=(1, 1), cell=0.1)
    assert [grid.cells(length) for length in (0.0, 0.04)] == [1, 1]
    assert [grid.cells(0.04, minimum=each) for each in (0, 2)] == [0, 2]


@for_any(count=st.integers(1, 10_000), cell=st.sampled_from([0.01, 0.03, 0.05, 0.1, 0.2, 0.7]))
def test_grid_length_inverts_cells(count, cell):
    grid = Grid(shape=(1, 1), cell=cell)
    assert grid.cells(grid.length(count)) == count
    assert grid.length(count) == float(f"{count * cell:.9f}")  # 0.3, not 0.30000000000000004


@pytest.mark.parametrize(("shape", "size", "counts"), read_table(__file__, "grid_centered"))
def test_grid_centered_has_the_parity_of_the_axis(shape, size, counts):
    assert Grid(shape=shape, cell=0.1).centered(size) == tuple(counts)


@pytest.mark.parametrize(
    ("inner", "rings"),
    [
        ((1, 2), ["2222", "1111", "1001", "1111", "2222"]),
        ((3, 2), ["1111", "1001", "1001", "1001", "1111"]),
        ((5, 4), ["0000"] * 5),
    ],
)
def test_grid_rings_are_around_the_centered_block(inner, rings):
    grid = Grid(shape=(5, 4), cell=0.1)
    expected = np.array([[int(digit) for digit in row] for row in rings])
    assert np.array_equal(grid.rings(inner), expected)
    assert np.array_equal(grid.by_ring(inner, lambda ring: 10.0 * ring + 1), 10 * expected + 1)
    inside = np.ones(grid.shape, dtype=bool)
    inside[grid.centered_slices(inner)] = False
    assert np.array_equal(inside, expected > 0)


@pytest.mark.parametrize(
    ("distance", "middle"),
    [
        (0.2, [1, 1, 1, 0.5, 0, 0.5, 1, 1, 1]),
        (0.4, [1, 0.75, 0.5, 0.25, 0, 0.25, 0.5, 0.75, 1]),
        (0.0, [1, 1, 1, 1, 0, 1, 1, 1, 1]),
    ],
)
def test_grid_fade_rises_from_block_to_distance(distance, middle):
    fade = Grid(shape=(9, 9), cell=0.1).fade((1, 1), distance)
    assert fade[4] == pytest.approx(middle)
    assert fade[0] == pytest.approx(np.ones(9))


@pytest.mark.parametrize(
    ("length", "cell", "count"), [(8.0, 0.1, 80), (0.3, 0.1, 3), (25.0, 0.05, 500), (0.1, 0.1, 1)]
)
def test_whole_cells_accepts_rounding(length, cell, count):
    assert whole_cells("border", length, cell) == count
    assert whole_cells("border", 0.0, cell, minimum=0) == 0


@pytest.mark.parametrize(("length", "nearest"), read_table(__file__, "whole_cells_lists_nearest"))
def test_whole_cells_lists_nearest_lengths(length, nearest):
    message = f"border: got {length:g} m; expected a whole number of cells of 0.1 m, such as "
    with pytest.raises(ConfigError) as error:
        whole_cells("border", length, 0.1)
    assert str(error.value) == message + nearest


@pytest.mark.parametrize("length", [math.inf, math.nan, 1e308])
def test_whole_cells_rejects_uncountable_lengths(length):
    with pytest.raises(ConfigError, match=r"border .* is too many cells of 0\.1 m"):
        whole_cells("border", length, 0.1)


def test_grid_margins_are_cells_beyond_the_block():
    assert Grid(shape=(80, 41), cell=0.1).margin((30, 11)) == (25, 15)


@pytest.mark.parametrize(
    ("center", "count", "first"), [(2.0, 2, 4), (2.0, 3, 4), (2.1, 3, 4), (0.5, 2, 0)]
)
def test_grid_slice_along_x_is_around_the_center(center, count, first):
    grid = Grid(shape=(20, 4), cell=0.2, lower=(1.0, 0.0))
    assert grid.slice_along_x(center, count) == slice(first, first + count)

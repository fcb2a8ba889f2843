from dataclasses import replace

import numpy as np
import pytest

from terrainkit.feasibility.free_width import FreeWidth, _trace_ray
from tests.limits import LIMITS, columns_of

WIDE = replace(LIMITS, body_width=0.5)


def widths(heights):
    return FreeWidth.build(columns_of(heights), WIDE).at_nodes()[..., 0]


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("number", [1, 3, 6])
def test_width_of_a_corridor_at_every_place(number, axis):
    heights = np.full((30, 30), 1.0)
    heights[10 : 10 + number] = 0.0
    found = widths(heights.T if axis else heights)
    inside = (found.T if axis else found)[10 : 10 + number]
    assert inside == pytest.approx(0.1 * number)


def test_width_of_an_opening_in_a_thin_wall():
    heights = np.zeros((30, 30))
    heights[15] = 1.0
    heights[15, 10:14] = 0.0
    assert widths(heights)[15, 10:14] == pytest.approx(0.4)


@pytest.mark.parametrize(("length", "width"), [(4, np.inf), (6, np.inf), (7, 0.4)])
def test_passages_longer_than_the_body(length, width):
    """A passage 0.4 m wide, for a body 0.65 m long that turns in 0.7 m."""
    heights = np.zeros((30, 30))
    heights[10 : 10 + length] = 1.0
    heights[10 : 10 + length, 10:14] = 0.0
    limits = replace(WIDE, body_length=0.65, turning_width=0.7)
    free_width = FreeWidth.build(columns_of(heights), limits)
    found = free_width.in_long_passages(free_width.at_nodes())[..., 0]
    assert found[10 : 10 + length, 10:14] == pytest.approx(width)
    assert np.isinf(found[:, 20]).all()


def test_one_wall_low_walls_and_slopes_leave_room():
    most = 2 * WIDE.body_width
    wall, low = np.zeros((30, 30)), np.full((30, 30), 0.2)
    wall[:5] = 1.0
    assert widths(wall)[5:] == pytest.approx(most)
    low[10:12] = 0.0  # as high as a step
    assert widths(low) == pytest.approx(most)
    assert widths(1.01 * low)[10:12] == pytest.approx(0.2)
    gutter = np.abs(np.arange(30) - 14.5)[:, None] * 0.05 + np.zeros(30)
    assert widths(gutter) == pytest.approx(most)


@pytest.mark.parametrize(("height", "width"), [(0.29, 0.3), (0.31, 1.0)])
def test_width_between_roofs_lower_than_the_crouched_height(height, width):
    """Under the roofs, there need be no more height beside a place than above it."""
    floor, ceiling = np.zeros((30, 30, 2)), np.full((30, 30, 2), np.inf)
    floor[..., 1], ceiling[..., 0] = 1.0, height
    floor[10:13, :, 1], ceiling[10:13, :, 0] = np.nan, np.inf
    found = FreeWidth.build(columns_of(floor, ceiling), WIDE).at_nodes()[..., 0]
    assert found[10:13] == pytest.approx(width)
    assert found[20] == pytest.approx(1.0)


@pytest.mark.parametrize("side", [1, -1])
def test_diagonal_corridor(side):
    i, j = np.mgrid[-20:20, -20:20]
    heights = np.where(np.abs(i - side * j) <= 4, 0.0, 1.0)
    # The corners of the cells are 8 diagonals of 0.1 m / sqrt(2) apart, the lines of centers 10.
    assert 0.56 <= widths(heights)[20, 20] <= 0.71


def test_ceilings_are_the_lowest_and_highest_within_the_body_width():
    """The upper floor covers two columns; the body of 0.5 m reaches 6 columns of 0.1 m."""
    floor = np.full((30, 30, 2), np.nan)
    floor[..., 0] = 0.0
    floor[15, 15:17, 1] = 1.2, 2.1
    ceiling = np.full_like(floor, np.inf)
    ceiling[15, 15:17, 0] = 1.0, 2.0
    ((lowest, highest),) = FreeWidth.build(columns_of(floor, ceiling), WIDE).ceilings
    assert lowest[15, [8, 9, 15, 21, 22, 23]].tolist() == [np.inf, 1, 1, 1, 2, np.inf]
    assert highest[15, [8, 9, 10, 15, 22, 23]].tolist() == [-np.inf, 1, 2, 2, 2, -np.inf]
    assert lowest[[8, 9, 21, 22], 15].tolist() == [np.inf, 1, 1, np.inf]


def test_ray_enters_cells_at_the_lines_between_them():
    """A slope to a cell starts at the last cell that the ray entered 0.1 m before it, or at 0."""
    assert _trace_ray(0.0, 0.21, 0.08) == [(1, 0, 0.04, 0), (2, 0, 0.12, 0), (3, 0, 0.2, 1)]
    assert _trace_ray(np.pi, 0.2, 0.08) == [(-1, 0, 0.04, 0), (-2, 0, 0.12, 0)]
    assert _trace_ray(-np.pi / 2, 0.12, 0.05) == [
        (0, -1, 0.025, 0),
        (0, -2, 0.075, 0),
    ]
    corner = 0.05 * 2**0.5
    cells = _trace_ray(np.pi / 4, 0.2, 0.1)
    assert [(c.i, c.j) for c in cells] == [(1, 0), (1, 1)]
    assert [c.distance for c in cells] == pytest.approx([corner, corner])


@pytest.mark.parametrize(("rise", "width"), [(0.2, 1.0), (0.20005, 1.0), (0.2002, 0.2)])
def test_wall_is_higher_than_a_step_by_more_than_rounding(rise, width):
    heights = np.full((30, 30), rise)
    heights[10:12] = 0.0
    assert widths(heights)[10:12] == pytest.approx(width)


@pytest.mark.parametrize("seed", range(8))
def test_lines_from_all_places_at_one_height_end_as_from_single_places(seed, monkeypatch):
    """Walls, steps and roofs at random."""
    rng = np.random.default_rng(seed)
    floor = np.zeros((30, 30, 2))
    floor[..., 0] = rng.choice([-0.3, 0.0, 0.15, 1.0], (30, 30), p=(0.05, 0.75, 0.1, 0.1))
    floor[..., 1] = np.where(rng.random((30, 30)) < 0.1, 1.3, np.nan)
    ceiling = np.full_like(floor, np.inf)
    ceiling[..., 0] = np.where(np.isnan(floor[..., 1]), np.inf, 1.2)
    free_width = FreeWidth.build(columns_of(floor, ceiling), WIDE)
    found = []
    for number in (1, 10_000):
        monkeypatch.setattr("terrainkit.feasibility.free_width.MIN_LEVEL_NODES", number)
        found.append(free_width.at_nodes())
    np.testing.assert_allclose(found[0], found[1], atol=1e-9)
    assert (found[0] < 2 * WIDE.body_width).any()

import numpy as np
import pytest

from terrainkit.geometry.free_space import clearance, first_surface, free_intervals

NAN, INF = np.nan, np.inf
GROUND = np.array([0.0, 1.0])
BAR = np.array([[[0.4, 0.6], [2.0, 2.5]], [[NAN, NAN], [NAN, NAN]]])


@pytest.mark.parametrize(
    ("z", "direction", "expected"),
    [
        (20.0, "down", 2.5),
        (1.0, "down", 0.6),
        (0.3, "down", 0.0),
        (0.0, "down", 0.0),
        (-1.0, "down", NAN),
        (0.5, "down", 0.4),  # the far side of a solid around the start
        (0.5, "up", 0.6),
        (0.3, "up", 0.4),
        (0.4, "up", 0.4),
        (3.0, "up", NAN),
    ],
)
def test_first_surface_under_and_over_bars(z, direction, expected):
    found = first_surface(GROUND[:1], BAR[:1], np.array([z]), direction)
    np.testing.assert_array_equal(found, [expected])


def test_free_intervals_between_ground_and_solids():
    expected = [[[0.0, 0.4], [0.6, 2.0], [2.5, INF]], [[1.0, INF], [NAN, NAN], [NAN, NAN]]]
    np.testing.assert_array_equal(free_intervals(GROUND, BAR), expected)


@pytest.mark.parametrize(
    ("solids", "expected"),
    [
        ([[0.0, 1.0], [0.5, 0.7], [0.9, 2.0]], [[2.0, INF]]),  # one on the other, on the ground
        ([[-1.0, -0.5], [0.3, 0.4]], [[0.0, 0.3], [0.4, INF]]),  # one within the ground
        ([[0.3, 2.0], [0.5, 0.6], [3.0, 4.0]], [[0.0, 0.3], [2.0, 3.0], [4.0, INF]]),  # nested
        ([[0.00009, 1.0]], [[1.0, INF]]),  # a gap of less than a contact
        ([[0.00011, 1.0]], [[0.0, 0.00011], [1.0, INF]]),
    ],
)
def test_free_intervals_of_overlapping_solids(solids, expected):
    found = free_intervals(np.zeros(1), np.array([solids]))
    assert found[0].tolist() == expected


@pytest.mark.parametrize(
    ("solid", "expected"),
    [
        ((0.4, 0.6), 0.4),
        ((-0.2, 0.5), 0.0),
        ((-2.0, -1.0), INF),
        ((-1.0, 0.00009), INF),  # within the ground
        ((-1.0, 0.00011), 0.0),
        ((0.00009, 1.0), 0.0),
        ((0.00011, 1.0), 0.00011),
        ((NAN, NAN), INF),
    ],
)
def test_clearance_of_ground_roof_and_block(solid, expected):
    spans = np.array([[solid, (3.0, 4.0)], [(NAN, NAN), (2.7, 2.8)]])
    found = clearance(np.array([0.0, 2.0]), spans)
    assert found.tolist() == pytest.approx([min(expected, 3.0), 0.7], abs=1e-12)


def test_clearance_under_the_open_sky_is_infinite():
    assert clearance(np.zeros(2), np.empty((2, 0, 2))).tolist() == [INF, INF]

import numpy as np
import pytest

from terrainkit.geometry.free_space import clearance, first_surface, free_intervals

NAN, INF = np.nan, np.inf
GROUND = np.array([0.0, 1.0])
BAR = np.array([[[0.4, 0.6], [2.0, 2.5]], [[NAN, NAN], [NAN, NAN]]])


def test_first_surface_under_and_over_a_bar():
    """The three answers of the design: from above, from below, and upward from below."""
    for z, direction, expected in (
        (20.0, "down", 2.5),
        (1.0, "down", 0.6),
        (0.3, "down", 0.0),
        (0.3, "up", 0.4),
        (3.0, "up", NAN),
        (-1.0, "down", NAN),
    ):
        found = first_surface(GROUND[:1], BAR[:1], np.array([z]), direction)
        assert found[0] == pytest.approx(expected, nan_ok=True)


def test_first_surface_inside_a_solid_is_its_far_side():
    assert first_surface(GROUND[:1], BAR[:1], np.array([0.5]), "down")[0] == 0.4
    assert first_surface(GROUND[:1], BAR[:1], np.array([0.5]), "up")[0] == 0.6


def test_free_intervals_between_ground_and_solids():
    found = free_intervals(GROUND, BAR)
    assert found[0].tolist() == [[0.0, 0.4], [0.6, 2.0], [2.5, INF]]
    assert found[1, 0].tolist() == [1.0, INF]
    assert np.isnan(found[1, 1:]).all()


@pytest.mark.parametrize(
    ("solids", "expected"),
    [
        ([[0.0, 1.0], [0.5, 0.7], [0.9, 2.0]], [[2.0, INF]]),  # one on the other, on the ground
        ([[-1.0, -0.5], [0.3, 0.4]], [[0.0, 0.3], [0.4, INF]]),  # one within the ground
        ([[0.3, 2.0], [0.5, 0.6], [3.0, 4.0]], [[0.0, 0.3], [2.0, 3.0], [4.0, INF]]),  # nested
        ([[0.00005, 1.0]], [[1.0, INF]]),  # a gap of less than a contact
    ],
)
def test_free_intervals_of_overlapping_solids(solids, expected):
    found = free_intervals(np.zeros(1), np.array([solids]))
    assert found[0].tolist() == expected


def test_clearance_of_ground_roof_and_block():
    spans = np.array([[[0.4, 0.6]], [[-0.2, 0.5]], [[-2.0, -1.0]], [[NAN, NAN]]])
    assert clearance(np.zeros(4), spans).tolist() == [0.4, 0.0, INF, INF]
    assert clearance(np.zeros(2), np.empty((2, 0, 2))).tolist() == [INF, INF]

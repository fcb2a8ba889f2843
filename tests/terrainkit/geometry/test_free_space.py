import numpy as np
import pytest

from terrainkit.geometry.free_space import clearance, first_surface, free_intervals
from tests.tables import read_table

NAN, INF = np.nan, np.inf
GROUND = np.array([0.0, 1.0])
BAR = np.array([[[0.4, 0.6], [2.0, 2.5]], [[NAN, NAN], [NAN, NAN]]])


@pytest.mark.parametrize(("z", "direction", "expected"), read_table(__file__, "first_surface"))
def test_first_surface_under_and_over_bars(z, direction, expected):
    found = first_surface(GROUND[:1], BAR[:1], np.array([z]), direction)
    np.testing.assert_array_equal(found, [expected])


def test_free_intervals_between_ground_and_solids():
    expected = [[[0.0, 0.4], [0.6, 2.0], [2.5, INF]], [[1.0, INF], [NAN, NAN], [NAN, NAN]]]
    np.testing.assert_array_equal(free_intervals(GROUND, BAR), expected)


@pytest.mark.parametrize(("solids", "expected"), read_table(__file__, "free_intervals"))
def test_free_intervals_of_overlapping_solids(solids, expected):
    found = free_intervals(np.zeros(1), np.array([solids]))
    assert found[0].tolist() == expected


@pytest.mark.parametrize(("solid", "step", "expected"), read_table(__file__, "clearance"))
def test_clearance_of_ground_roof_and_block(solid, step, expected):
    spans = np.array([[solid, (3.0, 4.0)], [(NAN, NAN), (2.7, 2.8)]])
    found = clearance(np.array([0.0, 2.0]), spans, step)
    assert found.tolist() == pytest.approx([expected, 0.7], abs=1e-12)


def test_clearance_under_the_open_sky_is_infinite():
    assert clearance(np.zeros(2), np.empty((2, 0, 2)), 0.1).tolist() == [INF, INF]

import numpy as np
import pytest

from terrainkit.importing.readers.holes import dig_holes

PATTERNS = {
    # A strip without ground parts the file.
    "strip": ("00__00", "00__00", "00__00"),
    # The part in the ring stands apart.
    "ring": ("00000", "0___0", "0_0_0", "0___0", "00000"),
    "hole": ("0000", "0__0", "0000"),
    "notch": ("0000", "0__0", "0__0"),
    "islands": ("0____", "_____", "__0__", "_____", "____0"),
    "corner_and_island": ("000__", "000__", "000_0"),
}


def heights_of(pattern):
    return np.array(
        [[np.nan if sample == "_" else float(sample) for sample in row] for row in pattern]
    )


@pytest.mark.parametrize("name", PATTERNS)
def test_missing_ground_inside_is_a_hole(name):
    given = heights_of(PATTERNS[name])
    heights, holes = dig_holes(given, 0.5)
    np.testing.assert_array_equal(holes, np.isnan(given))
    np.testing.assert_array_equal(heights, np.where(np.isnan(given), -0.5, 0.0))


@pytest.mark.parametrize(
    "pattern", [("00__", "00__", "0000"), ("_00_", "0000", "_00_"), ("__", "__")]
)
def test_missing_ground_outside_is_missing(pattern):
    given = heights_of(pattern)
    heights, holes = dig_holes(given, 0.5)
    assert not holes.any()
    np.testing.assert_array_equal(heights, given)


def test_hole_beside_missing_ground():
    heights, holes = dig_holes(heights_of(("00___", "0_0__", "00000")), 0.5)
    expected = heights_of(("00___", "0_0__", "00000"))
    expected[1, 1] = -0.5
    np.testing.assert_array_equal(heights, expected)
    assert holes.sum() == 1


def test_hole_is_below_its_own_lowest_edge():
    given = heights_of(("555555", "5_33_1", "555555"))
    heights, _ = dig_holes(given, 2.0)
    assert (heights[1, 1], heights[1, 4]) == (1.0, -1.0)


def test_depth_0_digs_no_holes():
    given = heights_of(PATTERNS["hole"])
    heights, holes = dig_holes(given, 0.0)
    assert np.isnan(heights).sum() == 2
    assert not holes.any()

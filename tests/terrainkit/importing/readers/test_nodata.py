import numpy as np
import pytest

from terrainkit.importing.readers.nodata import find_nodata

GROUND = np.linspace(0.0, 20.0, 201)


def find(values, markers, scale=1.0, dtype=np.float32):
    """Return what is found in values with three of each marker."""
    array = np.concatenate([values, np.repeat(np.asarray(markers, float), 3)])
    return find_nodata(array, np.dtype(dtype), scale)


@pytest.mark.parametrize(
    "markers", [[-32768], [-32767], [-9999], [-3.4e38], [-32768, -9999], [1e38, -9999], [np.inf]]
)
@pytest.mark.parametrize("factor", [1.0, 100.0])  # meters and centimeters
def test_markers_far_from_the_ground_are_found(markers, factor):
    assert find(GROUND * factor, markers) == {float(each): 3 for each in markers}


@pytest.mark.parametrize(
    ("values", "marker", "options", "is_found"),
    [
        # A tenth of the range: 10000 m of ground below -9999.
        (np.linspace(-8999.0, 1000.0, 300), -9999, {}, True),
        (np.linspace(-9000.0, 1001.0, 300), -9999, {}, False),
        # Ends of integers: ten times the range.
        (np.arange(100.0) + 991, 0, {"dtype": np.uint16}, True),
        (np.arange(100.0) + 990, 0, {"dtype": np.uint16}, False),
        (np.arange(100.0) + 65535 - 99 - 991, 65535, {"dtype": np.uint16}, True),
        (np.arange(100.0) + 1000, 0, {"dtype": np.int16}, False),
        (np.arange(16.0) + 200, 0, {"dtype": np.uint8}, False),
        # Other values: a hundred times the range and 100 m, and ground that is not flat.
        (GROUND, -1981.0, {}, False),
        (GROUND, -2001.0, {}, True),
        (GROUND / 100, -101.0, {}, True),
        (GROUND / 100, -99.0, {}, False),
        (GROUND, -2001.0, {"scale": 0.01}, False),
        (GROUND.round(-1), -2001.0, {}, False),
        (np.zeros(9), 1000.0, {}, False),
    ],
)
def test_other_values_are_found_only_far_from_the_ground(values, marker, options, is_found):
    assert find(values, [marker], **options) == ({marker: 3} if is_found else {})


def test_only_a_file_of_common_markers_is_missing_as_a_whole():
    assert find([], [-9999]) == {-9999.0: 3}
    assert find([], [0], dtype=np.uint16) == find([], [-77.0]) == {}

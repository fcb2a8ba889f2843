"""What the adapters share."""

from types import SimpleNamespace

import numpy as np
import pytest

from terrainkit.integrations import column_names, load_map, pad_points
from tests.tables import read_table

NAN = (np.nan,) * 3


def test_pad_points_repeats_last_point_or_origin():
    points = np.array([[[(1, 2, 3), (4, 5, 6), NAN, NAN], [NAN] * 4]], np.float32)
    origins = np.array([[(0, 0, 0), (7, 8, 9)]], np.float32)
    expected = [[[(1, 2, 3), (4, 5, 6), (4, 5, 6), (4, 5, 6)], [(7, 8, 9)] * 4]]
    np.testing.assert_array_equal(pad_points(points, origins), expected)
    assert pad_points(np.empty((2, 3, 0, 3)), np.zeros((2, 3, 3))).shape == (2, 3, 0, 3)


def test_column_names_are_unique(parkour, parkour_path):
    names = [["flat", "pit", "flat", "gap", "flat"], ["flat", "gap", "flat", "pit", "flat"]]
    found = column_names(SimpleNamespace(patch_names=np.array(names)))
    assert found == ["flat", "mixed", "flat#2", "mixed#2", "flat#3"]
    assert load_map(parkour) is parkour
    assert load_map(str(parkour_path)).config == parkour.config


@pytest.mark.parametrize(("name", "package"), read_table(__file__, "missing_framework_is_one_line"))
def test_missing_framework_is_one_line(load_adapter, name, package):
    with pytest.raises(ModuleNotFoundError, match=r"^.* is not installed; install it with: .+$"):
        load_adapter(name, {package: None})

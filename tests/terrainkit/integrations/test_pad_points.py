import numpy as np

from terrainkit.integrations import pad_points

NAN = (np.nan,) * 3


def test_pad_points_repeats_last_point_or_origin():
    points = np.array([[[(1, 2, 3), (4, 5, 6), NAN, NAN], [NAN] * 4]], np.float32)
    origins = np.array([[(0, 0, 0), (7, 8, 9)]], np.float32)
    expected = [[[(1, 2, 3), (4, 5, 6), (4, 5, 6), (4, 5, 6)], [(7, 8, 9)] * 4]]
    np.testing.assert_array_equal(pad_points(points, origins), expected)


def test_pad_points_without_points():
    assert pad_points(np.empty((2, 3, 0, 3)), np.zeros((2, 3, 3))).shape == (2, 3, 0, 3)

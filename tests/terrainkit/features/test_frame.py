import numpy as np
import pytest

from terrainkit.features.frame import frame_rectangles


def test_frame_rectangles_by_hand():
    center, size = frame_rectangles((1.0, 2.0), (2.0, 1.0), (4.0, 5.0))
    assert center == pytest.approx(np.array([[-0.5, 2], [2.5, 2], [1, 0.5], [1, 3.5]]))
    assert size == pytest.approx(np.array([[1, 5], [1, 5], [2, 2], [2, 2]]))
    assert size.prod(axis=1).sum() == pytest.approx(4 * 5 - 2 * 1)


def test_frame_rectangles_leaves_out_sides_without_width():
    center, size = frame_rectangles((0.0, 0.0), (2.0, 4.0), (6.0, 4.0))
    assert center.tolist() == [[-2.0, 0.0], [2.0, 0.0]]
    assert size.tolist() == [[2.0, 4.0], [2.0, 4.0]]

import numpy as np
import pytest

from terrainkit.features.blocks import (
    SINK,
    make_blocks,
    make_ramps,
    make_standing_boxes,
    make_walls,
    max_number,
)
from terrainkit.geometry.solid_index import SolidIndex


@pytest.mark.parametrize(
    ("pitch", "extent", "number"), [(0.1, 0.3, 3), (0.5, 1.2, 2), (2.0, 1.0, 0), (1.0, -1.0, 0)]
)
def test_max_number_counts_whole_elements(pitch, extent, number):
    assert max_number("stones", pitch, extent) == number


def test_make_standing_boxes_begin_below_the_ground():
    boxes = make_standing_boxes(
        [[1.0, 2.0], [3.0, 4.0]], (2.0, 1.0), [0.5, 1.0], floor=-1.0, yaw=[0.0, np.pi / 2]
    )
    lower, upper = boxes.bounds()
    assert lower == pytest.approx(np.array([[0, 1.5, -1 - SINK], [2.5, 3, -1 - SINK]]))
    assert upper == pytest.approx(np.array([[2, 2.5, 0.5], [3.5, 5, 1]]))


def test_make_blocks_span_both_corners():
    lower, upper = make_blocks([[1.0, 2.0, -1.0]], [[1.5, 3.0, 0.25]]).bounds()
    assert lower.tolist() == [[1.0, 2.0, -1.0]]
    assert upper.tolist() == [[1.5, 3.0, 0.25]]


@pytest.mark.parametrize("axis", [0, 1])
def test_make_walls_stand_across_the_axis(axis):
    walls = make_walls(axis, [2.0, 5.0], [0.0, 1.0], [3.0, 1.5], (0.2, 0.8))
    lower, upper = walls.bounds()
    order = [axis, 1 - axis, 2]
    assert lower[:, order] == pytest.approx(np.array([[1.9, 0.0, -SINK], [4.9, 1.0, -SINK]]))
    assert upper[:, order] == pytest.approx(np.array([[2.1, 3.0, 0.8], [5.1, 1.5, 0.8]]))


def test_make_ramps_top_is_the_plane_of_the_corners():
    # Rises by 0.2 m along x and by 0.1 m along y.
    ramp = make_ramps([[1.0, 2.0]], [[2.0, 3.0]], [[0.0, 0.2, 0.3, 0.1]], floor=-1.0)
    xy = [[1.5, 2.5], [1.9, 2.1], [1.1, 2.8]]
    (low, high) = SolidIndex(ramp).intervals(np.array(xy))[:, 0].T
    assert high == pytest.approx([0.15, 0.19, 0.1])
    assert low == pytest.approx(-1 - SINK)

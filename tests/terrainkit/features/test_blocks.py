import numpy as np
import pytest

from terrainkit.features.blocks import (
    SINK,
    make_ramps,
    max_number,
)
from terrainkit.geometry.solid_index import SolidIndex


@pytest.mark.parametrize(
    ("pitch", "extent", "number"), [(0.1, 0.3, 3), (0.5, 1.2, 2), (2.0, 1.0, 0), (1.0, -1.0, 0)]
)
def test_max_number_counts_whole_elements(pitch, extent, number):
    assert max_number("stones", pitch, extent) == number


def test_make_ramps_top_is_the_plane_of_the_corners():
    # Rises by 0.2 m along x and by 0.1 m along y.
    ramp = make_ramps([[1.0, 2.0]], [[2.0, 3.0]], [[0.0, 0.2, 0.3, 0.1]], floor=-1.0)
    xy = [[1.5, 2.5], [1.9, 2.1], [1.1, 2.8]]
    (low, high) = SolidIndex(ramp).intervals(np.array(xy))[:, 0].T
    assert high == pytest.approx([0.15, 0.19, 0.1])
    assert low == pytest.approx(-1 - SINK)

import numpy as np
import pytest

from terrainkit.geometry.segments import segment_indices


@pytest.mark.parametrize(
    ("lengths", "owner", "place"),
    [
        ([2, 0, 3], [0, 0, 2, 2, 2], [0, 1, 0, 1, 2]),
        ([1], [0], [0]),
        ([], [], []),
    ],
)
def test_segment_indices_of_consecutive_segments(lengths, owner, place):
    found = segment_indices(np.array(lengths, dtype=np.int64))
    assert [each.tolist() for each in found] == [owner, place]

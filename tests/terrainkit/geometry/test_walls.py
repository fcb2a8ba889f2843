import numpy as np
import pytest

from terrainkit.geometry.walls import wall_edges
from tests.terrainkit.geometry.heightfields import samples


@pytest.mark.parametrize(
    ("heights", "threshold", "along_x", "along_y"),
    [
        ([[0, 0], [1, 0], [1, 1]], 0.5, [[1, 0], [0, 1]], [[0], [1], [0]]),
        ([[1], [0]], 0.5, [[1]], [[], []]),
        ([[0], [0.5], [1.25]], 0.5, [[0], [1]], [[], [], []]),  # the threshold is no wall
        ([[0, 1e30], [-1e30, 0]], np.inf, [[0, 0]], [[0], [0]]),
        ([[3]], 0.5, [], [[]]),
    ],
    ids=["both axes", "down", "threshold", "infinite", "single"],
)
def test_wall_edges_are_separate_by_axis(heights, threshold, along_x, along_y):
    found = wall_edges(samples(heights), threshold)
    assert [each.tolist() for each in found] == [along_x, along_y]


def test_wall_edges_do_not_depend_on_blocks_of_rows():
    heights = np.random.default_rng(0).random((67, 5), np.float32)
    for k, found in enumerate(wall_edges(heights, 0.5)):
        assert np.array_equal(found, np.abs(np.diff(heights, axis=k)) > 0.5)

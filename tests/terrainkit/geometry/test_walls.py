import numpy as np
import pytest

from terrainkit.geometry.walls import wall_edges
from tests.tables import read_table
from tests.terrainkit.geometry.heightfields import samples


@pytest.mark.parametrize(
    ("heights", "threshold", "along_x", "along_y"),
    read_table(__file__, "wall_edges_are_separate_by_axis"),
    ids=["both axes", "down", "threshold", "infinite", "single"],
)
def test_wall_edges_are_separate_by_axis(heights, threshold, along_x, along_y):
    found = wall_edges(samples(heights), threshold)
    assert [each.tolist() for each in found] == [along_x, along_y]


def test_wall_edges_do_not_depend_on_blocks_of_rows():
    heights = np.random.default_rng(0).random((67, 5), np.float32)
    for k, found in enumerate(wall_edges(heights, 0.5)):
        assert np.array_equal(found, np.abs(np.diff(heights, axis=k)) > 0.5)

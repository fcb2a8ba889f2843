import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from terrainkit.geometry.grid import Grid
from terrainkit.geometry.mesh.node_grid import NodeGrid
from terrainkit.geometry.mesh.rectangles import Rectangles

MASKS = arrays(bool, array_shapes(min_dims=2, max_dims=2, max_side=8), elements=st.booleans())


def spans(found):
    return list(zip(*(getattr(found, k).tolist() for k in ("i0", "i1", "j0", "j1")), strict=True))


def count(found, shape):
    quads = np.zeros(shape, dtype=int)
    for i0, i1, j0, j1 in spans(found):
        quads[i0:i1, j0:j1] += 1
    return quads


@pytest.mark.parametrize("find", [Rectangles.flat, Rectangles.along_y, Rectangles.along_x])
@given(mask=MASKS)
@settings(deadline=None, derandomize=True, max_examples=60)
def test_rectangles_cover_each_remaining_quad_once(find, mask):
    left = mask.copy()
    found = find(left)
    assert np.array_equal(count(found, mask.shape), left)
    assert not (left & ~mask).any()
    assert all((i1 - i0) * (j1 - j0) >= 3 for i0, i1, j0, j1 in spans(found))


def test_rectangles_merge_level_quads_of_equal_columns():
    mask = np.zeros((5, 6), dtype=bool)
    mask[1:4, 2:5] = True
    assert spans(Rectangles.flat(mask)) == [(1, 4, 2, 5)]


def test_rectangles_of_sloping_quads_are_one_deep():
    mask = np.zeros((4, 6), dtype=bool)
    mask[1:3, 2:5] = True
    assert spans(Rectangles.along_y(mask.copy())) == [(1, 2, 2, 5), (2, 3, 2, 5)]
    assert spans(Rectangles.along_x(mask.T.copy())) == [(2, 5, 1, 2), (2, 5, 2, 3)]


@pytest.fixture
def node_grid():
    # 4 x 5 nodes at 0, 0.5, 1.5, 2 and 0, 0.5, 1.5, 2.5, 3
    return NodeGrid.from_heights(
        np.zeros((2, 3), dtype=np.float32), Grid(shape=(2, 3), cell=1.0), 0.5
    )


def test_rectangles_boundary_is_counterclockwise(node_grid):
    rectangle = Rectangles.flat(np.ones((3, 4), dtype=bool))
    kept = np.zeros((4, 5), dtype=bool)
    rectangle.keep_corners(kept)
    assert np.argwhere(kept).tolist() == [[0, 0], [0, 4], [3, 0], [3, 4]]
    kept[2, 4] = kept[1, 1] = True  # on the rim, and inside
    loop = rectangle.polygons(node_grid, kept)
    assert loop.vertices.tolist() == [0, 15, 19, 14, 4]
    assert loop.centers.tolist() == [[1.0, 1.5, 0.0]]

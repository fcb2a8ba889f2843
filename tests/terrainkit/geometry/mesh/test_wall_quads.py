import numpy as np
import pytest

from terrainkit.geometry.mesh.wall_quads import wall_quads
from tests.tables import read_table
from tests.terrainkit.geometry.heightfields import node_grid_of

CELL = 0.1


def center_quad(corners, first=100):
    low_left, low_right, high_right, high_left = corners
    node_grid = node_grid_of([[low_left, high_left], [low_right, high_right]], 0.1, cell=CELL)
    blocks = wall_quads(node_grid, np.array([4]), first)  # the middle one of 3 x 3
    triangles, vertices = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
    return triangles, vertices


def test_wall_quads_of_no_quads_are_empty():
    assert not list(wall_quads(node_grid_of([[0, 0]], 0.1), np.array([], dtype=np.int64), 7))


@pytest.mark.parametrize(("corners", "centers"), read_table(__file__, "wall_quads_center"))
def test_wall_quads_center_has_one_vertex_per_height(corners, centers):
    triangles, vertices = center_quad(corners)
    np.testing.assert_allclose(vertices, [(CELL, CELL, z) for z in centers], rtol=1e-6)
    extra = np.unique(triangles[triangles >= 100])
    assert extra.tolist() == list(range(100, 100 + len(centers)))


@pytest.mark.parametrize("corners", [(1, 0, 1, 0), (0, 1, 0, 1), (3, 0, 2, 1), (0, 3, 1, 2)])
def test_wall_quads_separate_touching_high_corners(corners):
    triangles, vertices = center_quad(corners)
    toward = (np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) - 0.5)[np.argmax(corners)]
    places = CELL + np.array([[1], [-1]]) * toward * CELL / 128  # 1/128 of half a cell, each way
    for place, high in zip(places, sorted(corners)[:1:-1], strict=True):
        line = vertices[np.isclose(vertices[:, :2], place, rtol=0, atol=1e-7).all(axis=1)]
        assert line[:, 2].tolist() == sorted({*sorted(corners)[:2], high})
    # The low corners are connected where they are level.
    low = 100 + np.flatnonzero(vertices[:, 2] == 0)
    assert (np.isin(triangles, low).sum(axis=1) == 2).sum() >= 2

import numpy as np
import pytest

from terrainkit.geometry.grid import Grid
from terrainkit.geometry.mesh.node_grid import NodeGrid
from terrainkit.geometry.mesh.wall_quads import wall_quads

CELL = 0.1


def lattice_of(rows, threshold=0.1):
    heights = np.array(rows, dtype=np.float32)
    return NodeGrid.from_heights(heights, Grid(shape=heights.shape, cell=CELL), threshold)


def center_quad(corners, first=100):
    low_left, low_right, high_right, high_left = corners
    node_grid = lattice_of([[low_left, high_left], [low_right, high_right]])
    blocks = wall_quads(node_grid, np.array([4]), first)  # the middle one of 3 x 3
    triangles, vertices = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
    return triangles, vertices


def test_wall_quads_of_no_quads_are_empty():
    assert not list(wall_quads(lattice_of([[0, 0]]), np.array([], dtype=np.int64), 7))


@pytest.mark.parametrize(
    ("corners", "centers"),
    [
        ((0, 1, 1, 0), [0.0, 1.0]),
        ((1, 0, 0, 0), [0.0, 1.0]),
        ((0, 1, 2, 3), [0.0, 1.0, 2.0, 3.0]),
        ((0, 0.0625, 1, 3), [0.03125, 1.0, 3.0]),  # 0 and 0.0625 are joined
        ((0, 0.09375, 0.1875, 0.09375), [0.09375]),  # no wall at all
        ((0, 0.0625, 0.125, 0.1875), [0.09375]),  # one wall: (0 + 1 + 2 + 3) / 4 sixteenths
    ],
)
def test_wall_quads_center_has_one_vertex_per_height(corners, centers):
    triangles, vertices = center_quad(corners)
    assert vertices[:, 2].tolist() == centers
    np.testing.assert_allclose(vertices[:, :2], CELL)
    added = np.unique(triangles[triangles >= 100])
    assert added.tolist() == list(range(100, 100 + len(centers)))


@pytest.mark.parametrize("corners", [(1, 0, 1, 0), (0, 1, 0, 1), (3, 0, 2, 1), (0, 3, 1, 2)])
def test_wall_quads_separate_touching_high_corners(corners):
    _, vertices = center_quad(corners)
    places = np.unique(vertices[:, :2], axis=0)
    assert len(places) == 2
    assert 0 < np.abs(places - CELL).max() < 0.001
    high = vertices[vertices[:, 2] == max(corners)]
    toward = (np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) - 0.5)[np.argmax(corners)]
    assert ((high[:, :2] - CELL) * toward > 0).all(axis=1).any()


@pytest.mark.parametrize("corners", [(1, 0, 1, 0), (3, 0, 2, 1)])
def test_wall_quads_connect_low_saddle_corners(corners):
    triangles, vertices = center_quad(corners)
    low = 100 + np.flatnonzero(vertices[:, 2] == 0)
    assert len(low) == 2
    floor = np.isin(triangles, low).sum(axis=1) == 2
    assert floor.sum() == 2

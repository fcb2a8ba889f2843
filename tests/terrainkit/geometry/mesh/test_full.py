import numpy as np
import pytest

from terrainkit.geometry.grid import Grid
from terrainkit.geometry.mesh.full import full_mesh


def mesh_of(rows, threshold):
    heights = np.array(rows, dtype=np.float32)
    return full_mesh(heights, Grid(shape=heights.shape, cell=1.0), threshold)


def test_full_mesh_has_two_faces_per_quad():
    # 3 x 2 samples and the rim around them are 5 x 4 nodes, with 4 * 3 quads in between.
    mesh = mesh_of(np.zeros((3, 2)), threshold=0.1)
    assert len(mesh.vertices) == 5 * 4
    assert len(mesh.triangles) == 2 * 4 * 3


def test_full_mesh_diagonal_is_low_to_high_corner(ray_down):
    # Along (0, 0)-(1, 1) the middle is at (0 + 2) / 2; along the other diagonal at (4 + 6) / 2.
    mesh = mesh_of([[0, 6], [4, 2]], threshold=np.inf)
    found = ray_down(mesh.vertices, mesh.triangles, [(1.0, 1.001), (1.001, 1.0)])
    np.testing.assert_allclose(found, 1.0, atol=0.01)


def test_full_mesh_wall_adds_eight_faces():
    # 5 x 3 nodes; the wall cuts 2 of their 4 * 2 quads. A cut quad has three faces on either side
    # of the wall and two in each half of the wall.
    plain, cut = (mesh_of([[0], [0], [step]], threshold=0.1) for step in (0, 1))
    assert len(plain.triangles) == 8 * 2
    assert len(cut.triangles) == 6 * 2 + 2 * (2 * 3 + 2 * 2)


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (5, 1)])
def test_full_mesh_of_a_single_row(shape):
    mesh = mesh_of(np.ones(shape), threshold=0.1)
    assert mesh.vertices.max(axis=0).tolist() == [*map(float, shape), 1.0]

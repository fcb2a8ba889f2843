import numpy as np
import pytest

from terrainkit.geometry.mesh.full import full_mesh
from tests.terrainkit.geometry.heightfields import mesh_of


@pytest.mark.parametrize(
    ("heights", "vertices", "triangles"),
    [
        # 3 x 2 samples and the rim around them are 5 x 4 nodes, with 4 x 3 quads in between.
        (np.zeros((3, 2)), 5 * 4, 2 * 4 * 3),
        (np.ones((1, 5)), 3 * 7, 2 * 2 * 6),
        # The wall cuts 2 of the 4 x 2 quads. A cut quad has three faces on either side of the wall
        # and two in each half of the wall. Each of 3 edges has two midpoints, and quads a center.
        ([[0], [0], [1]], 5 * 3 + 3 * 2 + 2 * 2, 2 * 6 + 2 * (2 * 3 + 2 * 2)),
    ],
    ids=["plane", "row", "wall"],
)
def test_full_mesh_has_two_faces_per_quad_and_more_at_walls(heights, vertices, triangles):
    mesh = mesh_of(full_mesh, heights, threshold=0.1)
    assert (len(mesh.vertices), len(mesh.triangles)) == (vertices, triangles)


def test_full_mesh_diagonal_is_low_to_high_corner(ray_down):
    # Along (0, 0)-(1, 1) the middle is at (0 + 2) / 2; along the other diagonal at (4 + 6) / 2.
    mesh = mesh_of(full_mesh, [[0, 6], [4, 2]], threshold=np.inf)
    found = ray_down(mesh.vertices, mesh.triangles, [(1.0, 1.001), (1.001, 1.0)])
    np.testing.assert_allclose(found, 1.0, atol=0.01)

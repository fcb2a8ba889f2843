import numpy as np
import pytest

from terrainkit.geometry.mesh import TriMesh


@pytest.mark.parametrize("block", [1, 2, 100])
def test_boundary_has_directed_edges_of_one_face(monkeypatch, block):
    monkeypatch.setattr("terrainkit.geometry.mesh.tri_mesh.EDGES_PER_BLOCK", block)
    mesh = TriMesh(vertices=np.zeros((4, 3)), triangles=np.array([[0, 1, 2], [0, 2, 3]]))
    # 2 (4 min + max) + (a > b) of the edges 0-1, 0-2, 2-0, 3-0, 1-2 and 2-3.
    assert mesh.edge_numbers().tolist() == [2, 4, 5, 7, 12, 22]
    assert mesh.boundary().tolist() == [[0, 1], [3, 0], [1, 2], [2, 3]]

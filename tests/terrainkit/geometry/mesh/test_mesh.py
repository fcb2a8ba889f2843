import numpy as np
import pytest

from terrainkit.errors import MemoryLimitError
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.ground_surface import surface_at
from terrainkit.geometry.mesh import full_mesh, merged_mesh
from tests.terrainkit.geometry.heightfields import any_ground, mesh_of

every_mesh = pytest.mark.parametrize("build", [full_mesh, merged_mesh])


def doubled_normals(mesh):
    a, b, c = (mesh.vertices[mesh.triangles[:, k]].astype(float) for k in range(3))
    return np.cross(b - a, c - a)


@every_mesh
@any_ground
def test_mesh_is_one_surface(build, heights, threshold):
    mesh = mesh_of(build, heights, threshold)
    # Every interior edge has two faces.
    edges = [tuple(edge) for edge in mesh.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).tolist()]
    assert len(set(edges)) == len(edges)
    ends = np.array([edge for edge in edges if edge[::-1] not in set(edges)])
    x, y = np.moveaxis(mesh.vertices[ends], -1, 0)[:2]
    nx, ny = heights.shape
    sides = [(x == 0), (x == nx), (y == 0), (y == ny)]
    assert np.logical_or.reduce([side.all(axis=1) for side in sides]).all()
    # No face is degenerate or points down, and they cover the map once.
    normals = doubled_normals(mesh)
    assert (np.linalg.norm(normals, axis=1) > 1e-3).all()
    assert (normals[:, 2] > (-1e-6 if np.isfinite(threshold) else 0.01)).all()
    assert normals[:, 2].sum() / 2 == pytest.approx(heights.size)
    # Vertices are unique and used.
    assert len(np.unique(mesh.vertices, axis=0)) == len(mesh.vertices)
    assert np.unique(mesh.triangles).tolist() == list(range(len(mesh.vertices)))
    assert (mesh.vertices.dtype, mesh.triangles.dtype) == (np.float32, np.int32)


@every_mesh
@any_ground
def test_mesh_matches_the_surface(ray_down, build, heights, threshold):
    mesh = mesh_of(build, heights, threshold)
    # In quarters of the map's cells, off the walls and the diagonals.
    offsets = np.array([(0.03, 0.21), (0.22, 0.16), (0.09, 0.04)])
    corners = np.argwhere(np.ones([4 * n for n in heights.shape])) / 4
    place = (corners[:, None] + offsets).reshape(-1, 2)
    surface = surface_at(heights, place - 0.5, rule=threshold)
    found = ray_down(mesh.vertices, mesh.triangles, place)
    np.testing.assert_allclose(found, surface.height, atol=1e-4)


@every_mesh
def test_mesh_extends_to_the_map_edges(build):
    grid = Grid(shape=(4, 2), cell=0.5, lower=(-1.0, 7.0))
    mesh = build(np.zeros(grid.shape, dtype=np.float32), grid, 0.1)
    assert mesh.vertices.min(axis=0).tolist() == [-1.0, 7.0, 0.0]
    assert mesh.vertices.max(axis=0).tolist() == [1.0, 8.0, 0.0]


@every_mesh
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize(("width", "height"), [(1, 0.5), (3, 0.5), (1, -0.5), (3, -0.5)])
def test_mesh_feature_of_n_cells_is_n_cells_wide(build, axis, width, height):
    heights = np.zeros((8, 5))
    heights[3 : 3 + width] = height
    mesh = mesh_of(build, heights if axis == 0 else heights.T, 0.1, cell=0.5)
    upright = np.abs(doubled_normals(mesh)[:, 2]) < 1e-9
    walls = mesh.vertices[mesh.triangles[upright]]
    # The walls stand halfway between two samples, where cells meet.
    assert np.unique(walls[..., axis]).tolist() == [1.5, 1.5 + width * 0.5]
    assert np.unique(walls[..., 2]).tolist() == sorted([0.0, height])


@every_mesh
def test_mesh_beyond_memory_is_rejected(build):
    heights = np.broadcast_to(np.float32(0), (10**6, 10**6))
    with pytest.raises(MemoryLimitError, match=r"a mesh of 1000000000000 samples needs .* GB"):
        build(heights, Grid(shape=heights.shape, cell=1.0), 0.1)

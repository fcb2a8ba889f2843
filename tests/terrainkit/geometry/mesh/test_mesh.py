import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from terrainkit.errors import MemoryLimitError
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.mesh import full_mesh, merged_mesh
from terrainkit.geometry.surface import surface_at

SMALL = arrays(
    np.float32,
    array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=6),
    elements=st.integers(0, 3),
)
WIDE = SMALL.map(lambda heights: np.kron(heights, np.ones((2, 3), dtype=np.float32)))
HEIGHTFIELDS = SMALL | WIDE  # wide: with level ground and straight walls, which are merged
THRESHOLDS = st.sampled_from([0.5, 1.5, np.inf])

every_mesh = pytest.mark.parametrize("build", [full_mesh, merged_mesh])


def any_ground(test):
    test = given(heights=HEIGHTFIELDS, threshold=THRESHOLDS)(test)
    return every_mesh(settings(deadline=None, derandomize=True, max_examples=60)(test))


def mesh_of(build, heights, threshold, cell=1.0):
    return build(heights, Grid(shape=heights.shape, cell=cell), threshold)


def doubled_normals(mesh):
    a, b, c = (mesh.vertices[mesh.triangles[:, k]].astype(float) for k in range(3))
    return np.cross(b - a, c - a)


@any_ground
def test_mesh_interior_edges_have_two_faces(build, heights, threshold):
    mesh = mesh_of(build, heights, threshold)
    edges = [tuple(edge) for edge in mesh.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).tolist()]
    assert len(set(edges)) == len(edges)
    ends = np.array([edge for edge in edges if edge[::-1] not in set(edges)])
    x, y = np.moveaxis(mesh.vertices[ends], -1, 0)[:2]
    nx, ny = heights.shape
    sides = [(x == 0), (x == nx), (y == 0), (y == ny)]
    assert np.logical_or.reduce([side.all(axis=1) for side in sides]).all()


@any_ground
def test_mesh_has_no_degenerate_faces(build, heights, threshold):
    normals = doubled_normals(mesh_of(build, heights, threshold))
    assert (np.linalg.norm(normals, axis=1) > 1e-3).all()


@any_ground
def test_mesh_has_no_downward_faces(build, heights, threshold):
    assert (doubled_normals(mesh_of(build, heights, threshold))[:, 2] > -1e-6).all()


@any_ground
def test_mesh_covers_the_map_once(build, heights, threshold):
    area = doubled_normals(mesh_of(build, heights, threshold))[:, 2].sum() / 2
    assert area == pytest.approx(heights.size)


@any_ground
def test_mesh_vertices_are_unique_and_used(build, heights, threshold):
    mesh = mesh_of(build, heights, threshold)
    assert len(np.unique(mesh.vertices, axis=0)) == len(mesh.vertices)
    assert np.unique(mesh.triangles).tolist() == list(range(len(mesh.vertices)))


@any_ground
def test_mesh_matches_the_surface(ray_down, build, heights, threshold):
    mesh = mesh_of(build, heights, threshold)
    # In quarters of the map's cells, off the walls and the diagonals.
    offsets = np.array([(0.03, 0.21), (0.22, 0.16), (0.09, 0.04)])
    corners = np.argwhere(np.ones([4 * n for n in heights.shape])) / 4
    place = (corners[:, None] + offsets).reshape(-1, 2)
    surface = surface_at(heights, place - 0.5, threshold=threshold)
    found = ray_down(mesh.vertices, mesh.triangles, place)
    np.testing.assert_allclose(found, surface.height, atol=1e-4)


@every_mesh
def test_mesh_matches_the_map_height(ray_down, terrain_map, build):
    mesh = terrain_map.mesh(merged=build is merged_mesh)
    rng = np.random.default_rng(0)
    xy = rng.uniform(terrain_map.grid.lower, terrain_map.grid.upper, size=(3000, 2))
    found = ray_down(mesh.vertices, mesh.triangles, xy)
    np.testing.assert_allclose(found, terrain_map.height(xy), atol=1e-3)


@every_mesh
def test_mesh_extends_to_the_map_edges(build):
    grid = Grid(shape=(4, 2), cell=0.5, lower=(-1.0, 7.0))
    mesh = build(np.zeros(grid.shape, dtype=np.float32), grid, 0.1)
    assert mesh.vertices.min(axis=0).tolist() == [-1.0, 7.0, 0.0]
    assert mesh.vertices.max(axis=0).tolist() == [1.0, 8.0, 0.0]


@every_mesh
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("width", [1, 2, 3])
@pytest.mark.parametrize("height", [0.5, -0.5], ids=["ridge", "gap"])
def test_mesh_feature_of_n_cells_is_n_cells_wide(build, axis, width, height):
    heights = np.zeros((8, 5), dtype=np.float32)
    heights[3 : 3 + width] = height
    mesh = mesh_of(build, heights if axis == 0 else heights.T, 0.1, cell=0.5)
    upright = np.abs(doubled_normals(mesh)[:, 2]) < 1e-9
    walls = mesh.vertices[mesh.triangles[upright]]
    # The walls stand halfway between two samples, where cells meet.
    assert np.unique(walls[..., axis]).tolist() == [1.5, 1.5 + width * 0.5]
    assert np.unique(walls[..., 2]).tolist() == sorted([0.0, height])


@every_mesh
def test_mesh_without_walls_at_infinite_threshold(build):
    heights = np.array([[0, 9, 0], [9, 0, 9], [5, 5, -40]], dtype=np.float32)
    normals = doubled_normals(mesh_of(build, heights, np.inf))
    assert (normals[:, 2] > 0.1).all()


@every_mesh
def test_mesh_has_compact_dtypes(build):
    mesh = mesh_of(build, np.array([[0, 1, 0], [0, 0, 2]], dtype=np.float32), 0.5)
    assert mesh.vertices.dtype == np.float32
    assert mesh.triangles.dtype == np.int32


@every_mesh
def test_mesh_beyond_memory_is_rejected(build):
    heights = np.broadcast_to(np.float32(0), (10**6, 10**6))
    with pytest.raises(MemoryLimitError, match=r"a mesh of 1000000000000 samples needs .* GB"):
        mesh_of(build, heights, 0.1)

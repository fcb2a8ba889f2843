import manifold3d
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from terrainkit.geometry.grid import Grid
from terrainkit.geometry.mesh import closed_mesh, full_mesh, merged_mesh

SMALL = arrays(
    np.float32,
    array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=6),
    elements=st.integers(0, 3),
)
HEIGHTFIELDS = SMALL | SMALL.map(lambda z: np.kron(z, np.ones((2, 3), dtype=np.float32)))
THRESHOLDS = st.sampled_from([0.5, 1.5, np.inf])

every_mesh = pytest.mark.parametrize("build", [full_mesh, merged_mesh])
any_ground = given(heights=HEIGHTFIELDS, threshold=THRESHOLDS)
modestly = settings(deadline=None, derandomize=True, max_examples=60)


def solid_of(build, heights, threshold, cell=1.0):
    mesh = closed_mesh(build(heights, Grid(shape=heights.shape, cell=cell), threshold))
    return trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)


@every_mesh
@any_ground
@modestly
def test_closed_mesh_is_watertight_and_oriented(build, heights, threshold):
    solid = solid_of(build, heights, threshold)
    assert solid.is_watertight
    assert solid.is_winding_consistent
    assert solid.volume > 0
    assert (solid.area_faces > 1e-4).all()


@every_mesh
@any_ground
@modestly
def test_closed_mesh_is_accepted_by_manifold3d(build, heights, threshold):
    solid = solid_of(build, heights, threshold)
    manifold = manifold3d.Manifold(
        manifold3d.Mesh(solid.vertices.astype(np.float32), solid.faces.astype(np.uint32))
    )
    assert manifold.status() == manifold3d.Error.NoError
    assert manifold.volume() == pytest.approx(solid.volume, rel=1e-4)


@any_ground
@modestly
def test_closed_mesh_volume_does_not_depend_on_merging(heights, threshold):
    full, merged = (solid_of(build, heights, threshold) for build in (full_mesh, merged_mesh))
    assert merged.volume == pytest.approx(full.volume, rel=1e-6)


@every_mesh
@given(heights=HEIGHTFIELDS)
@modestly
def test_closed_mesh_of_walls_is_columns(build, heights):
    # A metre below the lowest; where four walls meet, they stand a little aside.
    columns = (heights.astype(float) - heights.min() + 1.0).sum()
    assert solid_of(build, heights, 0.5).volume == pytest.approx(columns, rel=0.01)


@every_mesh
def test_closed_mesh_of_level_ground_is_a_block(build):
    solid = solid_of(build, np.full((4, 2), 3.0, dtype=np.float32), 0.1, cell=0.5)
    assert solid.bounds.tolist() == [[0.0, 0.0, 2.0], [2.0, 1.0, 3.0]]
    assert solid.volume == pytest.approx(2.0)


@every_mesh
def test_closed_mesh_of_a_slope_is_a_wedge(build):
    # Level for half a cell, up by 3 over 3 cells, level for half a cell; 2 cells wide, 1 m below.
    solid = solid_of(build, np.array([[0, 0], [1, 1], [2, 2], [3, 3]], dtype=np.float32), np.inf)
    assert solid.volume == pytest.approx(2 * (0.5 * 1 + 3 * (1 + 4) / 2 + 0.5 * 4))


@every_mesh
def test_closed_mesh_keeps_the_surface(build):
    heights = np.array([[0, 2, 0], [1, 1, 0]], dtype=np.float32)
    surface = build(heights, Grid(shape=heights.shape, cell=1.0), 0.5)
    solid = closed_mesh(surface)
    assert np.array_equal(solid.vertices[: len(surface.vertices)], surface.vertices)
    assert np.array_equal(solid.triangles[: len(surface.triangles)], surface.triangles)


@pytest.mark.parametrize("merged", [True, False])
def test_closed_mesh_of_a_map_is_watertight(terrain_map, merged):
    mesh = terrain_map.mesh(merged=merged, closed=True)
    solid = trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)
    assert solid.is_watertight
    assert solid.is_winding_consistent
    lowest = terrain_map.heights.min()
    assert solid.bounds[0] == pytest.approx([-1.2, -1.2, lowest - 1.0])

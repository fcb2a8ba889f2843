import manifold3d
import numpy as np
import pytest
import trimesh

from terrainkit.geometry.mesh import closed_mesh, full_mesh, merged_mesh
from terrainkit.geometry.mesh.solid_mesh import manifold
from tests.terrainkit.geometry.heightfields import any_ground, mesh_of

every_mesh = pytest.mark.parametrize("build", [full_mesh, merged_mesh])


def solid_of(mesh):
    solid = trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)
    assert solid.is_watertight
    assert solid.is_winding_consistent
    return solid


@any_ground
def test_closed_mesh_is_a_solid_of_the_same_volume_for_each_mesh(heights, threshold):
    full, merged = (mesh_of(build, heights, threshold) for build in (full_mesh, merged_mesh))
    volumes = []
    for surface in (full, merged):
        mesh = closed_mesh(surface)
        solid = solid_of(mesh)
        assert (solid.area_faces > 1e-4).all()
        assert np.array_equal(mesh.vertices[: len(surface.vertices)], surface.vertices)
        assert np.array_equal(mesh.triangles[: len(surface.triangles)], surface.triangles)
        volumes += [solid.volume, manifold(mesh.vertices, mesh.triangles).volume()]
        assert manifold(mesh.vertices, mesh.triangles).status() == manifold3d.Error.NoError
    assert volumes == pytest.approx([volumes[0]] * 4, rel=1e-4)
    if threshold == 0.5:
        # Columns from a meter below the lowest; where four walls meet, they stand a little aside.
        columns = (heights.astype(float) - heights.min() + 1.0).sum()
        assert volumes[0] == pytest.approx(columns, rel=0.01)


@every_mesh
def test_closed_mesh_of_a_slope_is_a_wedge(build):
    # Level for half a cell, up by 3 over 3 cells, level for half a cell; 2 cells wide, 1 m below.
    solid = solid_of(closed_mesh(mesh_of(build, [[0, 0], [1, 1], [2, 2], [3, 3]], np.inf)))
    assert solid.volume == pytest.approx(2 * (0.5 * 1 + 3 * (1 + 4) / 2 + 0.5 * 4))

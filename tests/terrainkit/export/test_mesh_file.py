import dataclasses
import json
import struct
import subprocess
import sys
import tracemalloc

import numpy as np
import pytest
import trimesh

from terrainkit import TerrainMap
from terrainkit.errors import ExportError, TerrainkitWarning
from terrainkit.export.mesh_file import _FACES_PER_BLOCK
from terrainkit.geometry.solids import Solids

SUFFIXES = (".stl", ".ply", ".obj", ".glb")

lossy = pytest.mark.filterwarnings("ignore:a mesh file has")
every_suffix = pytest.mark.parametrize("suffix", SUFFIXES)


def saved(terrain_map, folder, suffix, **options):
    return trimesh.load_mesh(terrain_map.save(folder / f"map{suffix}", **options))


def peak_memory(terrain_map, path):
    """Return the peak memory of writing a map [bytes], after all imports."""
    terrain_map.save(path)
    tracemalloc.start()
    try:
        terrain_map.save(path, overwrite=True)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def points(terrain_map):
    grid = terrain_map.grid
    return np.random.default_rng(0).uniform(grid.lower, grid.upper, size=(1000, 2))


@every_suffix
@pytest.mark.parametrize("merged", [True, False])
def test_mesh_file_matches_the_ground(ray_down, terrain_map, tmp_path, suffix, merged):
    mesh = saved(terrain_map, tmp_path, suffix, full=not merged)
    assert len(mesh.faces) == len(terrain_map.mesh(merged=merged).triangles)
    xy = points(terrain_map)
    found = ray_down(mesh.vertices, mesh.faces, xy)
    np.testing.assert_allclose(found, terrain_map.height(xy), atol=1e-3)


@every_suffix
def test_mesh_file_is_in_the_map_frame(terrain_map, tmp_path, suffix):
    bounds = saved(terrain_map, tmp_path, suffix).bounds
    np.testing.assert_allclose(bounds[:, :2], [[-1.2, -1.2], [17.2, 13.2]], atol=1e-5)
    heights = terrain_map.heights
    np.testing.assert_allclose(bounds[:, 2], [heights.min(), heights.max()], atol=1e-5)


@every_suffix
@pytest.mark.parametrize("merged", [True, False])
def test_mesh_file_closed_is_a_solid(ray_down, terrain_map, tmp_path, suffix, merged):
    mesh = saved(terrain_map, tmp_path, suffix, full=not merged, closed=True)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0
    xy = points(terrain_map)
    found = ray_down(mesh.vertices, mesh.faces, xy)
    np.testing.assert_allclose(found, terrain_map.height(xy), atol=1e-3)


@every_suffix
def test_mesh_file_y_up_rotates_about_x(ray_down, terrain_map, tmp_path, suffix):
    mesh = saved(terrain_map, tmp_path, suffix, closed=True, y_up=True)
    assert mesh.volume > 0  # turned, not mirrored
    # x stays, z is up as y, and y comes out of the picture as -z.
    x, up, toward = np.asarray(mesh.vertices).T
    xy = points(terrain_map)
    found = ray_down(np.column_stack([x, -toward, up]), mesh.faces, xy)
    np.testing.assert_allclose(found, terrain_map.height(xy), atol=1e-3)


@pytest.mark.parametrize("suffix", [".ply", ".glb"])
def test_mesh_file_is_exact(terrain_map, tmp_path, suffix):
    path = terrain_map.save(tmp_path / f"map{suffix}")
    read, mesh = trimesh.load_mesh(path, process=False), terrain_map.mesh()
    assert read.vertices.astype(np.float32).tobytes() == mesh.vertices.tobytes()
    assert read.faces.astype(np.int32).tobytes() == mesh.triangles.tobytes()


def test_mesh_file_stl_is_exact(terrain_map, tmp_path):
    path = terrain_map.save(tmp_path / "map.stl", full=True)
    read, mesh = trimesh.load_mesh(path, process=False), terrain_map.mesh(merged=False)
    assert len(mesh.triangles) > _FACES_PER_BLOCK
    corners = mesh.vertices[mesh.triangles]
    assert read.triangles.astype(np.float32).tobytes() == corners.tobytes()
    # An independent computation of the normals that the file holds.
    np.testing.assert_allclose(trimesh.triangles.normals(corners)[0], read.face_normals, atol=1e-5)


@every_suffix
def test_mesh_file_does_not_import_trimesh(tmp_path, suffix):
    script = (
        "import sys, terrainkit as t\n"
        "t.generate(t.MapConfig(rows=1, cols=3, preset='stairs')).save(sys.argv[1])\n"
        "assert 'trimesh' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", script, str(tmp_path / f"map{suffix}")], check=True)


@every_suffix
def test_mesh_file_is_written_in_blocks(terrain_map, tmp_path, suffix, monkeypatch):
    mesh = terrain_map.mesh()
    monkeypatch.setattr(TerrainMap, "mesh", lambda *_, **__: mesh)
    monkeypatch.setattr("terrainkit.export.mesh_file._FACES_PER_BLOCK", 256)
    # Besides the mesh, writing needs a small part of its memory.
    views = mesh.vertices.nbytes + mesh.triangles.nbytes
    assert peak_memory(terrain_map, tmp_path / f"map{suffix}") < views / 2


def test_mjcf_is_written_in_rows(terrain_map, tmp_path):
    path = tmp_path / "map.xml"
    peak = peak_memory(terrain_map, path)
    assert peak < 2.5 * (terrain_map.heights.nbytes + path.stat().st_size)


def test_mesh_file_glb_header_limits_size(terrain_map, tmp_path, monkeypatch):
    monkeypatch.setattr("terrainkit.export.mesh_file._MAX_GLB_BYTES", 1000)
    path = tmp_path / "map.glb"
    with pytest.raises(ExportError, match=r"a \.glb file: got \d+ bytes; expected at most 1000;"):
        terrain_map.save(path)
    assert not path.exists()


def test_mesh_file_glb_has_friction_extras(terrain_map, tmp_path):
    data = terrain_map.save(tmp_path / "map.glb").read_bytes()
    # A header of 12 bytes, then the length and the kind of the first chunk, which is JSON.
    (length,) = struct.unpack("<I", data[12:16])
    (mesh,) = json.loads(data[20 : 20 + length])["meshes"]
    contact = {"static_friction": 0.8, "dynamic_friction": 0.6, "restitution": 0.1}
    assert contact.items() <= mesh["extras"].items()


@lossy
@every_suffix
def test_mesh_file_has_the_solids_that_collide(solid_map, tmp_path, suffix):
    mesh = saved(solid_map, tmp_path, suffix, closed=True)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    ground = dataclasses.replace(solid_map, solids=Solids.empty()).mesh(closed=True)
    plain = trimesh.Trimesh(ground.vertices, ground.triangles, process=False)
    # The box is free of the ground. The cylinder stands 0.1 m in it, the hull on it.
    box, cylinder = 0.5 * 2 * 0.2, np.pi * 0.2**2 * 0.7
    hull = trimesh.convex.convex_hull(solid_map.solids.hull_vertices).volume
    assert mesh.volume - plain.volume == pytest.approx(box + cylinder + hull, rel=1e-2)


@lossy
@every_suffix
def test_mesh_file_open_has_ground_and_solids(solid_map, tmp_path, suffix):
    mesh = saved(solid_map, tmp_path, suffix)
    assert len(mesh.faces) == len(solid_map.mesh().triangles)
    assert mesh.bounds[1, 2] == pytest.approx(0.7, abs=1e-6)


@lossy
def test_mesh_file_warns_about_several_frictions(solid_map, tmp_path):
    with pytest.warns(TerrainkitWarning, match=r"a mesh file has one friction, 1: .*; use \.npz"):
        solid_map.save(tmp_path / "map.stl")


@lossy
def test_mesh_file_warns_about_visibility_of_solids(solid_map, tmp_path):
    with pytest.warns(TerrainkitWarning, match=r"solids that collide, visible or not: 2 solids"):
        solid_map.save(tmp_path / "map.stl")

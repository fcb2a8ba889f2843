import json
import struct
import tracemalloc

import numpy as np
import pytest
import trimesh

from terrainkit import TerrainMap
from terrainkit.errors import ExportError, TerrainkitWarning
from terrainkit.export import mesh_file
from terrainkit.geometry.mesh.tri_mesh import TriMesh

lossy = pytest.mark.filterwarnings("ignore:a mesh file has")
every_suffix = pytest.mark.parametrize("suffix", mesh_file.SUFFIXES)


@lossy
@every_suffix
@pytest.mark.parametrize("options", [{}, {"full": True}, {"closed": True}, {"y_up": True}], ids=str)
def test_mesh_file_has_the_triangles_of_the_map(request, tmp_path, monkeypatch, suffix, options):
    monkeypatch.setattr(mesh_file, "FACES_PER_BLOCK", 100)
    terrain_map = request.getfixturevalue("solid_map" if options else "terrain_map")
    path = terrain_map.save(tmp_path / f"map{suffix}", **options)
    mesh = terrain_map.mesh(merged="full" not in options, closed="closed" in options)
    x, y, z = mesh.vertices.T
    vertices = np.column_stack([x, z, -y] if "y_up" in options or suffix == ".glb" else [x, y, z])
    found = trimesh.load_mesh(path, process=False)
    tolerance = 6e-7 if suffix == ".obj" else 0
    np.testing.assert_allclose(found.triangles, vertices[mesh.triangles], rtol=0, atol=tolerance)


def test_stl_has_normals_except_of_faces_without_area(tmp_path):
    vertices = np.array([[0, 0, 0], [3, 0, 0], [0, 0, 4], [6, 0, 0]], np.float32)
    mesh = TriMesh(vertices=vertices, triangles=np.array([[0, 1, 2], [0, 1, 3]], np.int32))
    mesh_file.write_stl(mesh, tmp_path / "a.stl")
    data = (tmp_path / "a.stl").read_bytes()
    assert data[:84] == b"terrain, in meters".ljust(80) + bytes([2, 0, 0, 0])
    faces = np.frombuffer(data[84:], mesh_file._STL_FACE)
    assert faces["normal"].tolist() == [[0, -1, 0], [0, 0, 0]]
    assert faces["corners"].tolist() == vertices[mesh.triangles].tolist()
    assert not faces["attribute"].any()


def test_glb_is_a_scene_with_the_friction_as_extras(terrain_map, tmp_path):
    data = terrain_map.save(tmp_path / "map.glb").read_bytes()
    mesh = terrain_map.mesh()
    (vertices, _), (triangles, _) = mesh.vertices.shape, mesh.triangles.shape
    low, high = (f(axis=0).tolist() for f in (mesh.vertices.min, mesh.vertices.max))
    magic, version, total, length, kind = struct.unpack("<4sIII4s", data[:20])
    assert (magic, version, total, kind) == (b"glTF", 2, len(data), b"JSON")
    assert json.loads(data[20 : 20 + length]) == {
        "asset": {"version": "2.0", "generator": "terrainkit"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "terrain", "mesh": 0}],
        "meshes": [
            {
                "extras": {"static_friction": 0.8, "dynamic_friction": 0.6, "restitution": 0.1},
                "primitives": [{"attributes": {"POSITION": 0}, "indices": 1}],
            }
        ],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": vertices,
                "type": "VEC3",
                "min": [low[0], low[2], -high[1]],  # y up
                "max": [high[0], high[2], -low[1]],
            },
            {"bufferView": 1, "componentType": 5125, "count": 3 * triangles, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 12 * vertices, "target": 34962},
            {
                "buffer": 0,
                "byteOffset": 12 * vertices,
                "byteLength": 12 * triangles,
                "target": 34963,
            },
        ],
        "buffers": [{"byteLength": 12 * (vertices + triangles)}],
    }
    assert length % 4 == 0
    last = struct.pack("<I4s", 12 * (vertices + triangles), b"BIN\0")
    turned = mesh.vertices[:, [0, 2, 1]] * np.float32([1, 1, -1])
    assert data[20 + length :] == last + turned.tobytes() + mesh.triangles.tobytes()


def test_glb_header_limits_size(terrain_map, tmp_path, monkeypatch):
    path = terrain_map.save(tmp_path / "map.glb")
    size = path.stat().st_size
    monkeypatch.setattr(mesh_file, "MAX_GLB_BYTES", size)
    terrain_map.save(path, overwrite=True)
    monkeypatch.setattr(mesh_file, "MAX_GLB_BYTES", size - 1)
    message = f"a .glb file: got {size} bytes; expected at most {size - 1}; use .ply"
    with pytest.raises(ExportError, match=message):
        terrain_map.save(path, overwrite=True)


@every_suffix
def test_mesh_file_is_written_in_blocks(terrain_map, tmp_path, suffix, monkeypatch):
    mesh = terrain_map.mesh()
    monkeypatch.setattr(TerrainMap, "mesh", lambda *_, **__: mesh)
    monkeypatch.setattr(mesh_file, "FACES_PER_BLOCK", 256)
    # Besides the mesh, writing needs a small part of its memory.
    views = mesh.vertices.nbytes + mesh.triangles.nbytes
    path = terrain_map.save(tmp_path / f"map{suffix}")  # after all imports
    tracemalloc.start()
    terrain_map.save(path, overwrite=True)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < views / 2


def test_mesh_file_warns_about_frictions_and_visibility(solid_map, tmp_path):
    with pytest.warns(TerrainkitWarning) as caught:
        solid_map.save(tmp_path / "map.stl")
    visibility, friction = (str(each.message) for each in caught)
    assert "solids that collide, visible or not: 2 solids are only one of both" in visibility
    assert friction.startswith("a mesh file has one friction, 1: ")

"""Write the trimesh.

Blocks of vertices and faces are written one after the other, so that no second copy of the mesh is
needed.
"""

import json
import struct
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from terrainkit.errors import ExportError
from terrainkit.export.requirements import warn_about_loss
from terrainkit.geometry.mesh.tri_mesh import TriMesh

if TYPE_CHECKING:
    from terrainkit.map.terrain_map import TerrainMap

SUFFIXES = (".stl", ".ply", ".obj", ".glb")
BYTES_PER_SAMPLE = 20

FACES_PER_BLOCK = 1 << 15
"""Faces or vertices that are written at a time."""

MAX_GLB_BYTES = (1 << 32) - 1
"""Largest file that the header of a .glb can describe."""

_STL_FACE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_PLY_FACE = np.dtype([("count", "u1"), ("vertices", "<i4", 3)])


def export(
    terrain_map: "TerrainMap",
    path: Path,
    *,
    full: bool = False,
    closed: bool = False,
    y_up: bool = False,
) -> None:
    """Write the surface as triangles. A .glb also has friction and restitution as extras.

    Args:
        terrain_map: The map.
        path: Target.
        full: Write two triangles per cell instead of merging coplanar faces.
        closed: Add sides and a bottom to make a watertight solid.
        y_up: Rotate the map so that y is up, as game engines expect. A .glb always has y up.
    """
    warn_about_loss(terrain_map, "a mesh file")
    mesh = terrain_map.mesh(merged=not full, closed=closed)
    suffix = path.suffix.lower()
    if y_up or suffix == ".glb":
        y, z = mesh.vertices[:, 1].copy(), mesh.vertices[:, 2].copy()
        mesh.vertices[:, 1], mesh.vertices[:, 2] = z, -y
    if suffix == ".stl":
        write_stl(mesh, path)
        return
    with path.open("wb") as file:
        if suffix == ".ply":
            _write_ply(mesh, file)
        elif suffix == ".obj":
            _write_obj(mesh, file)
        else:
            _write_glb(mesh, file, terrain_map.config.contact)


def write_stl(mesh: TriMesh, path: Path) -> None:
    """Write a binary STL file, in which each face has its normal and the positions of its corners.

    A header that starts with `solid` would mark a text file.
    """
    with path.open("wb") as file:
        file.write(b"terrain, in meters".ljust(80))
        file.write(np.array(len(mesh.triangles), dtype="<u4").tobytes())
        for start in range(0, len(mesh.triangles), FACES_PER_BLOCK):
            corners = mesh.vertices[mesh.triangles[start : start + FACES_PER_BLOCK]]
            normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            lengths = np.linalg.norm(normals, axis=1, keepdims=True)
            faces = np.zeros(len(corners), dtype=_STL_FACE)
            faces["normal"] = normals / np.where(lengths > 0, lengths, 1)
            faces["corners"] = corners
            file.write(faces.tobytes())


def _write_ply(mesh: TriMesh, file: BinaryIO) -> None:
    """Write a binary PLY file."""
    header = f"""ply
format binary_little_endian 1.0
element vertex {len(mesh.vertices)}
property float x
property float y
property float z
element face {len(mesh.triangles)}
property list uchar int vertex_indices
end_header
"""
    file.write(header.encode())
    file.write(np.ascontiguousarray(mesh.vertices, dtype="<f4").data)
    for start in range(0, len(mesh.triangles), FACES_PER_BLOCK):
        triangles = mesh.triangles[start : start + FACES_PER_BLOCK]
        faces = np.empty(len(triangles), dtype=_PLY_FACE)
        faces["count"], faces["vertices"] = 3, triangles
        file.write(faces.tobytes())


def _write_obj(mesh: TriMesh, file: BinaryIO) -> None:
    """Write an OBJ file: text with a vertex or face per line, in which vertices count from 1."""
    for line, values, first in (
        ("v %.6f %.6f %.6f\n", mesh.vertices, 0),
        ("f %d %d %d\n", mesh.triangles, 1),
    ):
        for start in range(0, len(values), FACES_PER_BLOCK):
            block = values[start : start + FACES_PER_BLOCK] + first
            file.write((line * len(block) % tuple(block.ravel().tolist())).encode())


def _write_glb(mesh: TriMesh, file: BinaryIO, extras: dict[str, float]) -> None:
    """Write a binary glTF 2.0 file: a header, a chunk of JSON, and a chunk with the arrays.

    Raises:
        ExportError: if the file would exceed the size that its header can describe.
    """
    vertices = np.ascontiguousarray(mesh.vertices, "<f4")
    # The indices are unsigned, and int32 has the same bytes.
    triangles = np.ascontiguousarray(mesh.triangles, "<i4")
    num_bytes = vertices.nbytes + triangles.nbytes
    unsigned_int, single = 5125, 5126
    bounds = {"min": vertices.min(axis=0).tolist(), "max": vertices.max(axis=0).tolist()}
    positions = {"componentType": single, "count": len(vertices), "type": "VEC3", **bounds}
    indices = {"componentType": unsigned_int, "count": triangles.size, "type": "SCALAR"}
    second = {"byteOffset": vertices.nbytes, "byteLength": triangles.nbytes, "target": 34963}
    scene = {
        "asset": {"version": "2.0", "generator": "terrainkit"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "terrain", "mesh": 0}],
        "meshes": [
            {"extras": extras, "primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}
        ],
        "accessors": [{"bufferView": 0, **positions}, {"bufferView": 1, **indices}],
        "bufferViews": [
            {"buffer": 0, "byteLength": vertices.nbytes, "target": 34962},
            {"buffer": 0, **second},
        ],
        "buffers": [{"byteLength": num_bytes}],
    }
    text = json.dumps(scene, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)  # chunks begin at multiples of 4 bytes
    total = 12 + 8 + len(text) + 8 + num_bytes
    if total > MAX_GLB_BYTES:
        raise ExportError(
            f"a .glb file: got {total} bytes; expected at most {MAX_GLB_BYTES}; use .ply"
        )
    file.write(struct.pack("<4sII", b"glTF", 2, total))
    file.write(struct.pack("<I4s", len(text), b"JSON") + text)
    file.write(struct.pack("<I4s", num_bytes, b"BIN\0"))
    file.write(vertices.data)
    file.write(triangles.data)

"""Write the trimesh. Binary STL and PLY need no other library; OBJ and GLB need trimesh."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from terrainkit.mesh.node_grid import BYTES_PER_NODE
from terrainkit.mesh.tri_mesh import TriMesh

if TYPE_CHECKING:
    from terrainkit.terrain_map import TerrainMap

SUFFIXES = (".stl", ".ply", ".obj", ".glb")
BYTES_PER_SAMPLE = BYTES_PER_NODE

_FACES_PER_BLOCK = 1 << 15
"""Faces that are written at a time, so that no copy of the whole mesh is needed."""

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
        y_up: Rotate the map so that y is up, as glTF viewers expect; by default z is up.
    """
    terrain_map.warn_about_friction("a mesh file")
    mesh = terrain_map.mesh(merged=not full, closed=closed)
    if y_up:
        vertices = mesh.vertices[:, [0, 2, 1]] * np.array([1, 1, -1], dtype=np.float32)
        mesh = TriMesh(vertices=vertices, triangles=mesh.triangles)
    suffix = path.suffix.lower()
    if suffix == ".stl":
        _write_stl(mesh, path)
    elif suffix == ".ply":
        _write_ply(mesh, path)
    else:
        import trimesh

        trimesh.Trimesh(
            vertices=mesh.vertices,
            faces=mesh.triangles,
            process=False,
            metadata=terrain_map.config.contact,
        ).export(path)


def _write_stl(mesh: TriMesh, path: Path) -> None:
    """Write a binary STL file, in which each face has its normal and the positions of its corners.

    A header that starts with `solid` would mark a text file.
    """
    with path.open("wb") as file:
        file.write(b"terrain, in meters".ljust(80))
        file.write(np.array(len(mesh.triangles), dtype="<u4").tobytes())
        for start in range(0, len(mesh.triangles), _FACES_PER_BLOCK):
            corners = mesh.vertices[mesh.triangles[start : start + _FACES_PER_BLOCK]]
            normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            lengths = np.linalg.norm(normals, axis=1, keepdims=True)
            faces = np.zeros(len(corners), dtype=_STL_FACE)
            faces["normal"] = normals / np.where(lengths > 0, lengths, 1)
            faces["corners"] = corners
            file.write(faces.tobytes())


def _write_ply(mesh: TriMesh, path: Path) -> None:
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
    with path.open("wb") as file:
        file.write(header.encode())
        file.write(np.ascontiguousarray(mesh.vertices, dtype="<f4").data)
        for start in range(0, len(mesh.triangles), _FACES_PER_BLOCK):
            triangles = mesh.triangles[start : start + _FACES_PER_BLOCK]
            faces = np.empty(len(triangles), dtype=_PLY_FACE)
            faces["count"], faces["vertices"] = 3, triangles
            file.write(faces.tobytes())

"""Read the vertices and triangles of mesh files, without the scale of the robot file."""

import re
from collections.abc import Callable
from functools import partial
from io import BytesIO

import numpy as np

from terrainkit_robots.mesh.collada import read_dae
from terrainkit_robots.mesh.hull import convex_hull
from terrainkit_robots.mesh.sniff import STL_FACE, STL_HEADER, Format
from terrainkit_robots.mesh.surface import (
    STL_RECORD,
    MeshError,
    Points,
    Surface,
    parse_float_list,
    parse_int_list,
    triangulate_fan,
    unique_points,
    welded,
)

STL_FORMATS: tuple[Format, ...] = ("stl", "ascii-stl")
"""Formats without shared vertices."""


def read_mesh(mesh_format: Format, data: bytes) -> Surface:
    """Return the triangles of a mesh file, without unused vertices, and those of STL merged.

    Args:
        mesh_format: Format of the file.
        data: Content of the file.

    Raises:
        MeshError: If the file is malformed or has no triangles.
    """
    reader = _READERS.get(mesh_format)
    if reader is None:
        raise MeshError("has an unsupported format")
    surface = reader(data)
    points, faces = surface.points, surface.faces
    if not len(points) or not len(faces):
        raise MeshError("has no triangles")
    if faces.min() < 0 or faces.max() >= len(points):
        index = faces.min() if faces.min() < 0 else faces.max()
        raise MeshError(f"has a face with vertex index {index}; expected 0 to {len(points) - 1:,}")
    surface = _remove_unused_points(Surface(points=points, faces=faces.astype(np.int32)))
    finite = np.isfinite(surface.points).all(axis=1)
    if not finite.all():
        raise MeshError(f"has {np.count_nonzero(~finite):,} vertices that are not finite")
    # STL repeats a vertex in about six triangles, so that this saves most of the memory.
    return welded(surface) if mesh_format in STL_FORMATS else surface


def _remove_unused_points(surface: Surface) -> Surface:
    if len(surface.points) == surface.faces.size:
        return surface  # no shared vertices, as in STL
    used = np.bincount(surface.faces.ravel(), minlength=len(surface.points)) > 0
    place = np.cumsum(used, dtype=np.int32) - 1
    return Surface(points=surface.points[used], faces=place[surface.faces])


def _binary_stl(data: bytes) -> Surface:
    count = (len(data) - STL_HEADER) // STL_FACE
    corners = np.frombuffer(data, STL_RECORD, count, STL_HEADER)["corners"].reshape(-1, 3)
    return _triangle_soup(corners)


def _ascii_stl(data: bytes) -> Surface:
    lines = re.findall(rb"vertex[ \t]([^\r\n]*)", data, re.IGNORECASE)
    corners = parse_float_list(b" ".join(lines))
    if corners.size != 3 * len(lines) or len(lines) % 3:
        raise MeshError(
            "is an ASCII STL with invalid vertices; expected three per face, three numbers each"
        )
    return _triangle_soup(corners.reshape(-1, 3))


def _triangle_soup(corners: Points) -> Surface:
    return Surface(points=corners, faces=np.arange(len(corners)).reshape(-1, 3))


def _obj(data: bytes) -> Surface:
    lines = re.sub(rb"\\\r?\n", b" ", data).splitlines()
    points = obj_points([line for line in lines if line[:2] in (b"v ", b"v\t")])
    faces = [line[2:] for line in lines if line[:2] in (b"f ", b"f\t")]
    # only the first of the three indices is a vertex: 7/1/3 -> 7
    corners = re.sub(rb"/\S*", b"", b"\n".join(faces))
    counts = np.array([len(face.split()) for face in corners.split(b"\n")])
    indices = parse_int_list(corners)
    indices = np.where(indices < 0, indices + len(points), indices - 1)
    return Surface(points=points, faces=triangulate_fan(indices, counts))


def obj_points(lines: list[bytes]) -> Points:
    """Return the vertices of an OBJ file.

    Args:
        lines: The lines that start with `v`, which may have weights and colors.

    Returns:
        Vertices, shape (n, 3).

    Raises:
        MeshError: if there are no vertices, or a vertex is not three numbers.
    """
    if not lines:
        raise MeshError("has no vertices")
    values = parse_float_list(b" ".join(line[2:] for line in lines))
    width, rest = divmod(values.size, len(lines))
    if rest or width < 3:
        raise MeshError("has vertices that are not three numbers each")
    return values.reshape(-1, width)[:, :3]


def _msh(data: bytes) -> Surface:
    vertices, normals, textures, faces = (int(n) for n in np.frombuffer(data, "<i4", 4))
    parts = 12 * vertices, 12 * normals, 8 * textures, 12 * faces
    if min(parts) < 0 or 16 + sum(parts) > len(data):
        raise MeshError(f"is truncated: its header declares more than {len(data):,} bytes")
    points = np.frombuffer(data, "<f4", 3 * vertices, 16).reshape(-1, 3)
    if not faces:
        return _hull_of_points(points)
    start = 16 + 12 * vertices + 12 * normals + 8 * textures
    return Surface(points=points, faces=np.frombuffer(data, "<i4", 3 * faces, start).reshape(-1, 3))


def _hull_of_points(points: Points) -> Surface:
    """Return the convex hull, which MuJoCo uses for meshes without faces."""
    if not np.isfinite(points).all():
        raise MeshError("has vertices that are not finite")
    return convex_hull(unique_points(points)[0])


def _read_with_trimesh(mesh_format: str, data: bytes) -> Surface:
    import trimesh

    try:
        # without a resolver, no other files are opened
        mesh = trimesh.load(BytesIO(data), file_type=mesh_format, force="mesh", process=False)
        return Surface(points=np.asarray(mesh.vertices), faces=np.asarray(mesh.faces))
    except Exception as error:  # trimesh raises many types
        raise MeshError(f"cannot be read: {type(error).__name__}: {error}") from None


_READERS: dict[Format, Callable[[bytes], Surface]] = {
    "stl": _binary_stl,
    "ascii-stl": _ascii_stl,
    "obj": _obj,
    "dae": read_dae,
    "msh": _msh,
    "ply": partial(_read_with_trimesh, "ply"),
    "glb": partial(_read_with_trimesh, "glb"),
}

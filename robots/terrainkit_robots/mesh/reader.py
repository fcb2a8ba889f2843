"""Reading mesh files: points and triangles as they are in the file, without the robot's scale."""

import re
from collections.abc import Callable
from io import BytesIO

import numpy as np

from terrainkit_robots.mesh.collada import read_dae
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
)


def read_mesh(kind: Format, data: bytes) -> Surface:
    """Return the triangles in a file, without the points that are a corner of none.

    Raises:
        MeshError: if it holds none, or is not what it claims to be.
    """
    reader = _READERS.get(kind)
    if reader is None:
        raise MeshError("is in a format that is not read")
    surface = reader(data)
    points, faces = surface.points, surface.faces
    if not len(points) or not len(faces):
        raise MeshError("holds no triangles")
    if faces.min() < 0 or faces.max() >= len(points):
        wrong = faces.min() if faces.min() < 0 else faces.max()
        raise MeshError(f"has {len(points):,} corners, and names number {wrong}, counted from 0")
    surface = _used(surface)
    finite = np.isfinite(surface.points).all(axis=1)
    if not finite.all():
        raise MeshError(f"has {np.count_nonzero(~finite):,} corners that are not numbers")
    return surface


def _used(surface: Surface) -> Surface:
    if len(surface.points) == surface.faces.size:
        return surface  # corners of their own for each triangle, as in STL
    used = np.bincount(surface.faces.ravel(), minlength=len(surface.points)) > 0
    place = np.cumsum(used) - 1
    return Surface(points=surface.points[used], faces=place[surface.faces])


def _binary_stl(data: bytes) -> Surface:
    count = (len(data) - STL_HEADER) // STL_FACE
    corners = np.frombuffer(data, STL_RECORD, count, STL_HEADER)["corners"].reshape(-1, 3)
    return _loose(corners)


def _ascii_stl(data: bytes) -> Surface:
    lines = re.findall(rb"vertex[ \t]([^\r\n]*)", data, re.IGNORECASE)
    corners = parse_float_list(b" ".join(lines))
    if corners.size != 3 * len(lines) or len(lines) % 3:
        raise MeshError("is an ASCII STL whose corners are not three numbers each, three a face")
    return _loose(corners.reshape(-1, 3))


def _loose(corners: Points) -> Surface:
    return Surface(points=corners, faces=np.arange(len(corners)).reshape(-1, 3))


def _obj(data: bytes) -> Surface:
    lines = re.sub(rb"\\\r?\n", b" ", data).splitlines()
    points = obj_points([line for line in lines if line[:2] in (b"v ", b"v\t")])
    faces = [line[2:] for line in lines if line[:2] in (b"f ", b"f\t")]
    # only the first of the three indices is a corner's: 7/1/3 -> 7
    corners = re.sub(rb"/\S*", b"", b"\n".join(faces))
    counts = np.array([len(face.split()) for face in corners.split(b"\n")])
    indices = parse_int_list(corners)
    indices = np.where(indices < 0, indices + len(points), indices - 1)
    return Surface(points=points, faces=triangulate_fan(indices, counts))


def obj_points(lines: list[bytes]) -> Points:
    """Return the corners in the `v` lines of an OBJ, which may have a weight or a color as well."""
    if not lines:
        raise MeshError("holds no corners")
    values = parse_float_list(b" ".join(line[2:] for line in lines))
    width, rest = divmod(values.size, len(lines))
    if rest or width < 3:
        raise MeshError("has corners that are not three numbers each")
    return values.reshape(-1, width)[:, :3]


def _msh(data: bytes) -> Surface:
    vertices, normals, textures, faces = (int(n) for n in np.frombuffer(data, "<i4", 4))
    parts = 12 * vertices, 12 * normals, 8 * textures, 12 * faces
    if min(parts) < 0 or 16 + sum(parts) > len(data):
        raise MeshError(f"claims more than the {len(data):,} bytes that it has")
    points = np.frombuffer(data, "<f4", 3 * vertices, 16).reshape(-1, 3)
    if not faces:
        return _without_faces(points)
    start = 16 + 12 * vertices + 12 * normals + 8 * textures
    return Surface(points=points, faces=np.frombuffer(data, "<i4", 3 * faces, start).reshape(-1, 3))


def _without_faces(points: Points) -> Surface:
    """Return the hull, which is what MuJoCo takes for a mesh of nothing but points."""
    from terrainkit_robots.mesh.hull import convex_hull

    if not np.isfinite(points).all():
        raise MeshError("has corners that are not numbers")
    return convex_hull(unique_points(points)[0])


def _through_trimesh(kind: str) -> Callable[[bytes], Surface]:
    def read(data: bytes) -> Surface:
        import trimesh

        try:
            # without a resolver it follows no name of another file
            mesh = trimesh.load(BytesIO(data), file_type=kind, force="mesh", process=False)
            return Surface(points=np.asarray(mesh.vertices), faces=np.asarray(mesh.faces))
        except Exception as error:  # a reader of many authors raises whatever it likes
            raise MeshError(f"cannot be read: {type(error).__name__}: {error}") from None

    return read


_READERS: dict[Format, Callable[[bytes], Surface]] = {
    "stl": _binary_stl,
    "ascii-stl": _ascii_stl,
    "obj": _obj,
    "dae": read_dae,
    "msh": _msh,
    "ply": _through_trimesh("ply"),
    "glb": _through_trimesh("glb"),
}

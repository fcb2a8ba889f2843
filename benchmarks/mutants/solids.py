"""Meshes of simple solids, and their files."""

from functools import cache

import numpy as np

Triangles = np.ndarray


def box(lower: np.ndarray, upper: np.ndarray) -> Triangles:
    """Return the triangles of a box with outward normals, shape (12, 3, 3)."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    triangles: Triangles = (lower + corners * (upper - lower))[np.array(faces)].astype(float)
    return triangles


@cache
def sphere(rings: int, segments: int) -> Triangles:
    """Return a sphere of radius 1, shape (2 (rings - 1) segments, 3, 3)."""
    polar = np.linspace(0, np.pi, rings + 1)[:, None]
    around = np.linspace(0, 2 * np.pi, segments, endpoint=False)[None]
    points = np.stack(
        [
            np.sin(polar) * np.cos(around),
            np.sin(polar) * np.sin(around),
            np.broadcast_to(np.cos(polar), (rings + 1, segments)),
        ],
        axis=-1,
    )
    points[0], points[-1] = (0, 0, 1), (0, 0, -1)
    beside = np.roll(points, -1, axis=1)
    upper = np.stack([points[:-1], points[1:], beside[1:]], axis=2)[:-1]
    lower = np.stack([points[:-1], beside[1:], beside[:-1]], axis=2)[1:]
    return np.concatenate([upper.reshape(-1, 3, 3), lower.reshape(-1, 3, 3)])


def cylinder(radius: float, length: float, segments: int = 24) -> Triangles:
    """Return the triangles of a cylinder along z."""
    angle = np.linspace(0, 2 * np.pi, segments, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=-1) * radius
    low = np.column_stack([ring, np.full(segments, -length / 2)])
    high = np.column_stack([ring, np.full(segments, length / 2)])
    after = np.roll(np.arange(segments), -1)
    center = np.array([0, 0, length / 2])
    faces = [
        np.stack([low, low[after], high[after]], axis=1),
        np.stack([low, high[after], high], axis=1),
        np.stack([high, high[after], np.broadcast_to(center, high.shape)], axis=1),
        np.stack([low[after], low, np.broadcast_to(-center, low.shape)], axis=1),
    ]
    return np.concatenate(faces)


def channel(lower: np.ndarray, upper: np.ndarray) -> Triangles:
    """Return a U of three boxes; the volume of its convex hull is nearly three times its own."""
    size = upper - lower
    wall = size * [1, 0.1, 1]
    floor = size * [1, 1, 0.1]
    left = box(lower, lower + wall)
    right = box(upper - wall, upper)
    return np.concatenate([left, right, box(lower, lower + floor)])


def stl(triangles: Triangles, name: str = "mutant") -> bytes:
    """Return a binary STL."""
    records = np.zeros(
        len(triangles), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")]
    )
    records["corners"] = triangles
    sides = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    records["normal"] = sides / np.maximum(np.linalg.norm(sides, axis=1, keepdims=True), 1e-30)
    head = name.encode().ljust(80, b" ") + np.uint32(len(triangles)).tobytes()
    return head + records.tobytes()


def read_stl(data: bytes) -> Triangles:
    """Return the triangles of a binary STL."""
    count = int(np.frombuffer(data[80:84], "<u4")[0])
    records = np.frombuffer(
        data[84:], dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")]
    )
    return records["corners"][:count].astype(float)


def ascii_stl(triangles: Triangles) -> bytes:
    lines = ["solid mutant"]
    for corners in triangles:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += [f"vertex {x:.6g} {y:.6g} {z:.6g}" for x, y, z in corners]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid mutant", ""]).encode()


def ply(triangles: Triangles) -> bytes:
    points = triangles.reshape(-1, 3)
    head = ["ply", "format ascii 1.0", f"element vertex {len(points)}"]
    head += [f"property float {axis}" for axis in "xyz"]
    head += [f"element face {len(triangles)}", "property list uchar int vertex_indices"]
    body = [f"{x:.6g} {y:.6g} {z:.6g}" for x, y, z in points]
    body += [f"3 {3 * k} {3 * k + 1} {3 * k + 2}" for k in range(len(triangles))]
    return "\n".join([*head, "end_header", *body, ""]).encode()


def collada(triangles: Triangles) -> bytes:
    points = triangles.reshape(-1, 3)
    numbers = " ".join(f"{value:.6g}" for value in points.ravel())
    order = " ".join(str(k) for k in range(len(points)))
    return f"""<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset><unit name="meter" meter="1"/><up_axis>Z_UP</up_axis></asset>
  <library_geometries><geometry id="shape"><mesh>
    <source id="places"><float_array id="array" count="{3 * len(points)}">{numbers}</float_array>
      <technique_common><accessor source="#array" count="{len(points)}" stride="3">
        <param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
      </accessor></technique_common></source>
    <vertices id="corners"><input semantic="POSITION" source="#places"/></vertices>
    <triangles count="{len(triangles)}"><input semantic="VERTEX" source="#corners" offset="0"/>
      <p>{order}</p></triangles>
  </mesh></geometry></library_geometries>
  <library_visual_scenes><visual_scene id="scene"><node id="node">
    <instance_geometry url="#shape"/></node></visual_scene></library_visual_scenes>
  <scene><instance_visual_scene url="#scene"/></scene>
</COLLADA>
""".encode()

"""The shapes of a scene as one mesh."""

from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.importing.readers.height_source import Array

PLANE_MARGIN = 2.0
"""Width of an infinite plane around the other shapes [m]."""

Faces = NDArray[np.int32]


@dataclass
class SceneMesh:
    """The triangles of the shapes of a scene, z up, in meters."""

    vertices: list[Array] = field(default_factory=list)
    faces: list[Faces] = field(default_factory=list)
    planes: list[tuple[Array, Array, Array]] = field(default_factory=list)
    num_vertices: int = 0

    max_vertices: int = 50_000_000
    """Most vertices, copies included."""

    def add(self, vertices: Array, faces: Faces) -> None:
        """Add a mesh.

        Args:
            vertices: Vertices in the frame of the world [m], shape (n, 3).
            faces: Triangles, shape (nf, 3).

        Raises:
            ValueError: if the scene has more than `max_vertices` vertices.
        """
        self.vertices.append(vertices)
        self.faces.append(faces + np.int32(self.num_vertices))
        self.num_vertices += len(vertices)
        if self.num_vertices > self.max_vertices:
            raise ValueError(f"got more than {self.max_vertices} vertices, copies included")

    def add_plane(self, point: Array, normal: Array, size: Array) -> None:
        """Add an infinite plane.

        Args:
            point: A point of the plane [m], shape (3,).
            normal: Its normal, shape (3,).
            size: Half of its sides [m] if the scene has only planes, shape (3,).
        """
        self.planes.append((point, normal, size))

    def arrays(self) -> dict[str, Any]:
        """Return `vertices` and `faces`; planes end `PLANE_MARGIN` beyond the other shapes.

        Raises:
            ValueError: if a plane does not face up.
        """
        filled = [mesh for mesh in self.vertices if len(mesh)]
        if filled:
            lower = np.min([mesh.min(axis=0) for mesh in filled], axis=0)
            upper = np.max([mesh.max(axis=0) for mesh in filled], axis=0)
        elif self.planes:
            point, _, size = self.planes[0]
            lower, upper = point - size, point + size
        for point, normal, _ in self.planes:
            self.add(*_plane(point, normal, lower - PLANE_MARGIN, upper + PLANE_MARGIN))
        return {
            "vertices": np.concatenate([np.empty((0, 3)), *self.vertices]),
            "faces": np.concatenate([np.empty((0, 3), np.int32), *self.faces]),
        }


@cache
def unit_shapes(level: int = 4) -> dict[str, tuple[Array, Faces]]:
    """Return the vertices and faces of a box, a cylinder and a sphere with half size 1.

    At level 4, a cylinder has 128 sides: for a radius of 1 m, the error is 0.3 mm.
    """
    from trimesh import creation

    meshes = {
        "box": creation.box((2.0, 2.0, 2.0)),
        "cylinder": creation.cylinder(1.0, 2.0, sections=8 << level),
        "sphere": creation.icosphere(level),
    }
    return {
        name: (np.array(mesh.vertices), mesh.faces.astype(np.int32))
        for name, mesh in meshes.items()
    }


def triangulate(points: Array, polygons: Faces) -> Faces:
    """Return the triangles of polygons with one number of corners; those may be concave.

    Args:
        points: Points, shape (n, 3).
        polygons: Indices of the corners, shape (number of polygons, number of corners).
    """
    import manifold3d

    arms = points[polygons] - points[polygons[:, :1]]
    fans = np.cross(arms[:, 1:-1], arms[:, 2:])
    normals = fans.sum(axis=1)
    is_concave = (np.einsum("pci,pi->pc", fans, normals) < 0).any(axis=1)
    size = polygons.shape[1]
    numbers = np.column_stack([np.zeros(size - 2, int), np.arange(1, size - 1), np.arange(2, size)])
    found = [polygons[~is_concave][:, numbers].reshape(-1, 3)]
    for k in np.flatnonzero(is_concave).tolist():
        side = arms[k, 1]
        flat = arms[k] @ np.column_stack([side, np.cross(normals[k], side)])
        found.append(polygons[k][manifold3d.triangulate([flat])])
    return np.concatenate(found).astype(np.int32)


def _plane(point: Array, normal: Array, lower: Array, upper: Array) -> tuple[Array, Faces]:
    """Return the rectangle of a plane above the square from `lower` to `upper`."""
    if abs(normal[2]) < 0.1:
        raise ValueError(f"got a plane with normal {normal.round(3)}; expected one that faces up")
    x, y = np.array([[lower[0], upper[0], upper[0], lower[0]], np.repeat([lower[1], upper[1]], 2)])
    z = point[2] - ((x - point[0]) * normal[0] + (y - point[1]) * normal[1]) / normal[2]
    return np.column_stack([x, y, z]), np.array([[0, 1, 2], [0, 2, 3]], np.int32)

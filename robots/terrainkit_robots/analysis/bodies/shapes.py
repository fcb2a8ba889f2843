"""Bounding boxes, lowest points and volumes of shapes.

The support function of a convex shape gives its bounding box and its lowest point in any pose
exactly, without a mesh of the shape.
"""

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import BodyShape
from terrainkit_robots.description.model import Geometry
from terrainkit_robots.transforms import Matrix

if TYPE_CHECKING:
    from terrainkit_robots.mesh.mesh_cache import Meshes

_MAX_SIZE = 1e6
"""A larger shape counts as unknown [m]."""

_SIZE_COUNTS = {"box": 3, "sphere": 1, "cylinder": 2, "capsule": 2, "ellipsoid": 3}


def support(geometry: Geometry, direction: Matrix, meshes: "Meshes") -> float:
    """Return the support function of a shape: its largest extent along a direction.

    Args:
        geometry: The shape.
        direction: Unit vector in the frame of the shape, shape (3,).
        meshes: Mesh files.

    Returns:
        Distance from the origin of the shape [m].

    Raises:
        MeshError: if the shape is a mesh that cannot be read.
        ValueError: if the shape is unbounded or unknown, such as a plane.
    """
    d, size = direction, geometry.size
    match geometry.shape:
        case "box":
            return float(np.abs(d) @ np.array(size))
        case "sphere":
            return size[0]
        case "cylinder":
            return float(size[0] * np.hypot(d[0], d[1]) + size[1] * abs(d[2]))
        case "capsule":
            return float(size[0] + size[1] * abs(d[2]))
        case "ellipsoid":
            return float(np.linalg.norm(np.array(size) * d))
        case "mesh" if geometry.mesh is not None:
            return float((meshes.vertices(geometry.mesh) @ d).max())
    raise ValueError(f"shape: got {geometry.shape}; expected a bounded shape")


def has_bounds(geometry: Geometry, meshes: "Meshes") -> bool:
    """Return whether a shape is a primitive with valid sizes or a mesh that can be read."""
    if geometry.shape == "mesh":
        return geometry.mesh is not None and meshes.is_readable(geometry.mesh)
    return (
        len(geometry.size) == _SIZE_COUNTS.get(geometry.shape, -1)
        and bool(np.isfinite(geometry.size).all())
        and max(map(abs, geometry.size)) < _MAX_SIZE
    )


def bounds(shapes: Iterable[BodyShape], meshes: "Meshes") -> Matrix | None:
    """Return the bounding box of shapes along the axes of their body.

    Args:
        shapes: Shapes of one body.
        meshes: Cache of the meshes.

    Returns:
        Lower and upper corner [m], shape (2, 3); None if no shape has bounds.
    """
    boxes = []
    for shape in shapes:
        if not has_bounds(shape.geometry, meshes):
            continue
        axes, center = shape.pose[:3, :3].T, shape.pose[:3, 3]
        upper = [support(shape.geometry, axes[:, k], meshes) for k in range(3)]
        lower = [support(shape.geometry, -axes[:, k], meshes) for k in range(3)]
        boxes.append((center - lower, center + upper))
    if not boxes:
        return None
    lowers, uppers = zip(*boxes, strict=True)
    return np.array([np.min(lowers, axis=0), np.max(uppers, axis=0)])


def shape_key(geometry: Geometry) -> tuple[object, ...]:
    """Return what two shapes have in common that are equal apart from their poses."""
    mesh = geometry.mesh
    return geometry.shape, geometry.size, mesh and (mesh.filename, mesh.scale)


def min_height(shape: BodyShape, pose: Matrix, meshes: "Meshes") -> float:
    """Return the lowest z of a shape.

    Args:
        shape: The shape.
        pose: Pose of its body in the world, shape (4, 4) [m].
        meshes: Cache of the meshes.

    Returns:
        Lowest z [m]; without bounds, z of the shape's origin.
    """
    world = pose @ shape.pose
    if not has_bounds(shape.geometry, meshes):
        return float(world[2, 3])
    return float(world[2, 3] - support(shape.geometry, -world[2, :3], meshes))


def volume(geometry: Geometry, meshes: "Meshes") -> float:
    """Return the volume of a shape [m3]; for a mesh that is not closed, of its convex hull.

    Args:
        geometry: The shape.
        meshes: Cache of the meshes.

    Raises:
        MeshError: if the shape is a mesh that cannot be read.
        ValueError: if the shape has no volume, such as a plane.
    """
    s = geometry.size
    match geometry.shape:
        case "box":
            return 8 * s[0] * s[1] * s[2]
        case "sphere":
            return 4 / 3 * np.pi * s[0] ** 3
        case "cylinder":
            return 2 * np.pi * s[0] ** 2 * s[1]
        case "capsule":
            return 2 * np.pi * s[0] ** 2 * s[1] + 4 / 3 * np.pi * s[0] ** 3
        case "ellipsoid":
            return 4 / 3 * np.pi * s[0] * s[1] * s[2]
        case "mesh" if geometry.mesh is not None:
            return float(meshes.volume(geometry.mesh))
    raise ValueError(f"shape: got {geometry.shape}; expected a shape with a volume")

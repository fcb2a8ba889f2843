"""Shapes: how far each one reaches in a direction, and how much room it takes.

The support function of a convex shape gives its bounding box and its lowest point in any pose,
exactly, without a mesh of it.
"""

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Placed
from terrainkit_robots.description.model import Geometry
from terrainkit_robots.transforms import Matrix

if TYPE_CHECKING:
    from terrainkit_robots.mesh.mesh_cache import Meshes


def reach(geometry: Geometry, direction: Matrix, meshes: "Meshes") -> float:
    """Return how far the shape reaches from its origin along a unit vector in its frame [m].

    Raises:
        MeshError: if the shape is a mesh that cannot be read.
        ValueError: if the shape has no extent that is known, such as a plane.
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
    raise ValueError(f"a {geometry.shape} has no extent")


def has_extent(geometry: Geometry, meshes: "Meshes") -> bool:
    """Return whether `reach` has an answer: a primitive with sizes, or a mesh that can be read."""
    if geometry.shape == "mesh":
        return geometry.mesh is not None and meshes.is_readable(geometry.mesh)
    wanted = {"box": 3, "sphere": 1, "cylinder": 2, "capsule": 2, "ellipsoid": 3}
    return (
        len(geometry.size) == wanted.get(geometry.shape, -1)
        and bool(np.isfinite(geometry.size).all())
        and max(map(abs, geometry.size)) < _LARGEST
    )


_LARGEST = 1e6
"""Of a shape larger than this nothing is asked [m]."""


def bounds(shapes: Iterable[Placed], meshes: "Meshes") -> Matrix | None:
    """Return the box around `shapes` along the axes of their body, shape (2, 3) [m].

    None if none of them has an extent.
    """
    boxes = []
    for placed in shapes:
        if not has_extent(placed.geometry, meshes):
            continue
        turned, center = placed.pose[:3, :3].T, placed.pose[:3, 3]
        above = [reach(placed.geometry, turned[:, k], meshes) for k in range(3)]
        below = [reach(placed.geometry, -turned[:, k], meshes) for k in range(3)]
        boxes.append((center - below, center + above))
    if not boxes:
        return None
    lower, upper = zip(*boxes, strict=True)
    return np.array([np.min(lower, axis=0), np.max(upper, axis=0)])


def lowest(placed: Placed, pose: Matrix, meshes: "Meshes") -> float:
    """Return the lowest z of a shape whose body is at `pose` [m]; of its origin without extent."""
    whole = pose @ placed.pose
    if not has_extent(placed.geometry, meshes):
        return float(whole[2, 3])
    return float(whole[2, 3] - reach(placed.geometry, -whole[2, :3], meshes))


def volume(geometry: Geometry, meshes: "Meshes") -> float:
    """Return the volume of a shape [m3]; that of a mesh if it is closed, else of its hull.

    Raises:
        MeshError: if the shape is a mesh that cannot be read.
        ValueError: if it has no volume that is known.
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
    raise ValueError(f"a {geometry.shape} has no volume")

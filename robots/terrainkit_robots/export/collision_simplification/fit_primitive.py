"""Fit the smallest enclosing sphere, capsule, cylinder or box to points."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import trimesh

from terrainkit_robots.description.model import ShapeKind
from terrainkit_robots.export.collision_simplification.oriented_box import oriented_box
from terrainkit_robots.transforms import Matrix

_MAX_VOLUME_RATIO = 0.98
"""A shape with more expensive collision checks must have less than this share of the volume."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PrimitiveFit:
    """A primitive that encloses points."""

    shape: ShapeKind

    size: tuple[float, ...]
    """MuJoCo's size parameters, as in `Geometry` [m]."""

    pose: Matrix
    """Pose in the frame of the points, shape (4, 4) [m]."""

    volume: float
    """Volume of the primitive [m3]."""


def fit_primitive(points: Matrix) -> PrimitiveFit:
    """Return the enclosing sphere, capsule, cylinder or box with the smallest volume.

    Args:
        points: Points that do not lie in a plane, shape (n, 3) [m].
    """
    best: PrimitiveFit | None = None
    for candidate in _candidates(trimesh.convex.convex_hull(points)):
        if best is None or candidate.volume < _MAX_VOLUME_RATIO * best.volume:
            best = candidate
    assert best is not None
    return best


def _candidates(hull: trimesh.Trimesh) -> Iterator[PrimitiveFit]:
    """Yield the primitives around a convex hull, the cheapest to collide with first."""
    points = np.asarray(hull.vertices, dtype=np.float64)
    center, radius = trimesh.nsphere.minimum_nsphere(points)
    yield PrimitiveFit(
        shape="sphere",
        size=(float(radius),),
        pose=trimesh.transformations.translation_matrix(center),
        volume=4 / 3 * np.pi * radius**3,
    )
    box_pose, half_size = oriented_box(points)
    cylinder = trimesh.bounds.minimum_cylinder(hull)
    for axis in (*np.eye(3), cylinder["transform"][:3, 2], *box_pose[:3, :3].T):
        yield _capsule(points, axis)
    yield PrimitiveFit(
        shape="cylinder",
        size=(float(cylinder["radius"]), float(cylinder["height"]) / 2),
        pose=np.asarray(cylinder["transform"]),
        volume=np.pi * cylinder["radius"] ** 2 * cylinder["height"],
    )
    x, y, z = map(float, half_size)
    yield PrimitiveFit(shape="box", size=(x, y, z), pose=box_pose, volume=8 * x * y * z)


def _capsule(points: Matrix, axis: Matrix) -> PrimitiveFit:
    """Return the smallest capsule along an axis that encloses points."""
    rotation = np.linalg.inv(trimesh.geometry.align_vectors(axis, [0, 0, 1])[:3, :3])
    local = points @ rotation
    center, radius = trimesh.nsphere.minimum_nsphere(local[:, :2])
    # height of the spherical cap over each point
    squared = radius**2 - ((local[:, :2] - center) ** 2).sum(axis=1)
    cap = np.sqrt(np.maximum(squared, 0))
    # A point is inside if the center of the end cap is at least as high as the point minus its cap.
    upper, lower = float((local[:, 2] - cap).max()), float((local[:, 2] + cap).min())
    # Negative if a sphere encloses all points.
    half_length = max(0.0, (upper - lower) / 2)
    pose = np.eye(4)
    pose[:3, :3] = rotation
    pose[:3, 3] = rotation @ np.array([*center, (upper + lower) / 2])
    return PrimitiveFit(
        shape="capsule" if half_length > 0 else "sphere",
        size=(float(radius), half_length) if half_length > 0 else (float(radius),),
        pose=pose,
        volume=2 * np.pi * radius**2 * half_length + 4 / 3 * np.pi * radius**3,
    )

"""The primitive that fits points best: a sphere, capsule, cylinder or box around all of them."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from terrainkit_robots.description.model import ShapeKind
from terrainkit_robots.export.collision_simplification.bounding_sphere import bounding_sphere
from terrainkit_robots.export.collision_simplification.oriented_box import (
    frame_about,
    oriented_box,
    principal_axes,
)
from terrainkit_robots.transforms import Matrix

_CLEARLY = 0.98
"""A shape that costs more to collide with is taken if it has less than this share of the volume."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FittedPrimitive:
    """A primitive around points."""

    shape: ShapeKind

    size: tuple[float, ...]
    """MuJoCo's size numbers, as in `Geometry` [m]."""

    pose: Matrix
    """Its pose in the frame of the points, shape (4, 4) [m]."""

    volume: float
    """[m3]"""


def fitted_primitive(points: Matrix, normals: Matrix | None = None) -> FittedPrimitive:
    """Return the sphere, capsule, cylinder or box of the least volume around points.

    Args:
        points: Not all in a plane, shape (n, 3) [m].
        normals: Unit vectors that a side of a box may have, shape (m, 3).
    """
    best: FittedPrimitive | None = None
    for candidate in _candidates(points, normals):
        if best is None or candidate.volume < _CLEARLY * best.volume:
            best = candidate
    assert best is not None
    return best


def _candidates(points: Matrix, normals: Matrix | None) -> Iterator[FittedPrimitive]:
    """Yield primitives, those that are cheap to collide with first, then those along an axis."""
    yield _sphere(points)
    pose, half = oriented_box(points, normals)
    axes = [*np.eye(3), *pose[:3, :3].T, *principal_axes(points).T]
    rods = [_rods(points, axis) for axis in axes]
    for capsule, _ in rods:
        yield capsule
    for _, cylinder in rods:
        yield cylinder
    x, y, z = map(float, half)
    yield FittedPrimitive(shape="box", size=(x, y, z), pose=pose, volume=8 * x * y * z)


def _sphere(points: Matrix) -> FittedPrimitive:
    center, radius = bounding_sphere(points)
    pose = np.eye(4)
    pose[:3, 3] = center
    return FittedPrimitive(
        shape="sphere", size=(radius,), pose=pose, volume=4 / 3 * np.pi * radius**3
    )


def _rods(points: Matrix, axis: Matrix) -> tuple[FittedPrimitive, FittedPrimitive]:
    """Return the capsule and the cylinder around points along an axis."""
    frame = frame_about(axis)
    local = points @ frame
    center, radius = bounding_sphere(local[:, :2])
    # where the round end of a capsule may begin, so that it still covers each point
    away = ((local[:, :2] - center) ** 2).sum(axis=1)
    end = np.sqrt(np.maximum(radius**2 - away, 0))
    upper, lower = float((local[:, 2] - end).max()), float((local[:, 2] + end).min())
    half = max(0.0, (upper - lower) / 2)
    capsule = FittedPrimitive(
        shape="capsule" if half > 0 else "sphere",
        size=(radius, half) if half > 0 else (radius,),
        pose=_placed(frame, center, (upper + lower) / 2),
        volume=2 * np.pi * radius**2 * half + 4 / 3 * np.pi * radius**3,
    )
    lowest, highest = float(local[:, 2].min()), float(local[:, 2].max())
    cylinder = FittedPrimitive(
        shape="cylinder",
        size=(radius, (highest - lowest) / 2),
        pose=_placed(frame, center, (highest + lowest) / 2),
        volume=np.pi * radius**2 * (highest - lowest),
    )
    return capsule, cylinder


def _placed(frame: Matrix, center: Matrix, height: float) -> Matrix:
    pose = np.eye(4)
    pose[:3, :3] = frame
    pose[:3, 3] = frame @ np.array([*center, height])
    return pose

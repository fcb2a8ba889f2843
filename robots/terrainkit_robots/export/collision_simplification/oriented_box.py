"""The smallest box around points, turned as it fits best."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.transforms import Matrix

_BETTER = 0.99
"""A box is worth turning if it takes less than this share of the room."""

_MOST_POINTS = 2000
"""The turn is looked for with so many of the points; the box is around them all."""

_ANGLES = 90
"""Turns about an axis that are tried, over a right angle, and once more around the best of them."""


def oriented_box(points: Matrix, normals: Matrix | None = None) -> tuple[Matrix, Matrix]:
    """Return the pose of a small box around points, shape (4, 4), and its half lengths, (3,) [m].

    It is along the axes unless another is clearly smaller.

    Args:
        points: Shape (n, 3) [m].
        normals: Unit vectors that a side may have, shape (m, 3), beside the principal axes.
    """
    some = points[:: len(points) // _MOST_POINTS + 1]
    best, room = np.eye(3), _room(some, np.eye(3))
    for turn in _turns(some, normals):
        other = _room(some, turn)
        if other < _BETTER * room:
            best, room = turn, other
    along = points @ best
    lower, upper = along.min(axis=0), along.max(axis=0)
    pose = np.eye(4)
    pose[:3, :3] = best
    pose[:3, 3] = best @ ((lower + upper) / 2)
    return pose, (upper - lower) / 2


def principal_axes(points: Matrix) -> Matrix:
    """Return the axes along which points are spread, as columns of a rotation, shape (3, 3)."""
    centered = points - points.mean(axis=0)
    _, axes = np.linalg.eigh(centered.T @ centered)
    # one sign for each axis, whatever the library makes of it
    largest = np.abs(axes).argmax(axis=0)
    axes = axes * np.where(axes[largest, range(3)] < 0, -1.0, 1.0)
    if np.linalg.det(axes) < 0:
        axes[:, 0] *= -1
    return np.asarray(axes, dtype=np.float64)


def frame_about(axis: Matrix) -> Matrix:
    """Return a rotation with `axis`, a unit vector, as its third column, shape (3, 3).

    That by the smallest turn from z: none for z itself.
    """
    x, y, z = map(float, axis)
    if z < 0:
        return frame_about(-axis) @ np.diag([1.0, -1.0, -1.0])
    a, b = -1 / (1 + z), -x * y / (1 + z)
    return np.array([[1 + a * x * x, b, x], [b, 1 + a * y * y, y], [-x, -y, z]])


def _room(points: Matrix, turn: Matrix) -> float:
    """Return the volume of the box along the columns of a rotation [m3]; of flat ones the area."""
    sides = np.sort(np.ptp(points @ turn, axis=0))
    return float(np.maximum(sides, 1e-6 * sides[2]).prod())


def _turns(points: Matrix, normals: Matrix | None) -> Iterator[Matrix]:
    principal = principal_axes(points)
    yield principal
    axes = [*np.eye(3), *principal.T, *(() if normals is None else normals)]
    for axis in axes:
        frame = frame_about(axis)
        flat = points @ frame[:, :2]
        step = np.pi / 2 / _ANGLES
        angle = _best_angle(flat, np.arange(_ANGLES) * step)
        angle = _best_angle(flat, angle + np.arange(-_ANGLES, _ANGLES + 1) * (step / _ANGLES))
        c, s = np.cos(angle), np.sin(angle)
        yield frame @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def _best_angle(flat: Matrix, angles: NDArray[np.floating[Any]]) -> float:
    """Return by which angle a rectangle around points of a plane is to be turned."""
    c, s = np.cos(angles), np.sin(angles)
    width = np.ptp(flat[:, :1] * c + flat[:, 1:] * s, axis=0)
    height = np.ptp(flat[:, 1:] * c - flat[:, :1] * s, axis=0)
    return float(angles[(width * height).argmin()])

"""Rigid motions: made of quaternions, undone, and how far apart two of them are."""

import math

import numpy as np

from terrainkit_robots.model import Matrix


def inverse(poses: Matrix) -> Matrix:
    """Return the inverses of rigid motions, shape (..., 4, 4)."""
    result = np.zeros_like(poses)
    turned = np.swapaxes(poses[..., :3, :3], -1, -2)
    result[..., :3, :3] = turned
    result[..., :3, 3] = -(turned @ poses[..., :3, 3, None])[..., 0]
    result[..., 3, 3] = 1.0
    return result


def apart(a: Matrix, b: Matrix) -> tuple[Matrix, Matrix]:
    """Return distances [m] and angles [rad] between poses, each without the last two axes.

    The angle comes from |A - B|, which is sqrt(8) sin(angle / 2): exact for small angles, unlike
    the arc cosine of the trace.
    """
    distance = np.linalg.norm(a[..., :3, 3] - b[..., :3, 3], axis=-1)
    between = np.linalg.norm(a[..., :3, :3] - b[..., :3, :3], axis=(-2, -1))
    return distance, 2 * np.arcsin(np.clip(between / math.sqrt(8), 0.0, 1.0))


def turned_by(quat: Matrix) -> Matrix:
    """Return the rotation of a quaternion w, x, y, z, of any length above zero, shape (3, 3)."""
    w, x, y, z = map(float, quat)
    if x == y == z == 0:
        return np.eye(3)
    length = math.sqrt(w * w + x * x + y * y + z * z)
    w, x, y, z = w / length, x / length, y / length, z / length
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )

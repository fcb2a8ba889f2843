"""Rotations of many bodies at once; quaternions are (w, x, y, z), as MuJoCo's."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float32]


def quat_rotate_inverse(quat: FloatArray, vector: FloatArray) -> FloatArray:
    """Return vectors of the world in the frames of bodies, shape (n, 3).

    With q = (w, u): v' = v - 2 w (u x v) + 2 u x (u x v), the rotation by the conjugate of q.

    Args:
        quat: Unit quaternions of the bodies, shape (n, 4).
        vector: Vectors in the world's frame, shape (n, 3).
    """
    w, u = quat[:, :1], quat[:, 1:]
    twice = 2 * _cross(u, vector)
    return vector - w * twice + _cross(u, twice)


def projected_gravity(quat: FloatArray) -> FloatArray:
    """Return the unit vector of gravity in the frames of bodies, shape (n, 3).

    It is minus the third row of their rotation matrices.
    """
    w, x, y, z = quat.T
    return np.stack([2 * (w * y - x * z), -2 * (w * x + y * z), 2 * (x * x + y * y) - 1], axis=1)


def quat_to_yaw(quat: FloatArray) -> FloatArray:
    """Return the heading of bodies [rad], shape (n,)."""
    w, x, y, z = quat.T
    yaw: FloatArray = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return yaw


def wrap_to_pi(angle: FloatArray) -> FloatArray:
    """Return angles as those between -pi and pi [rad]."""
    return (angle + np.float32(np.pi)) % np.float32(2 * np.pi) - np.float32(np.pi)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the cross product of rows; `np.cross` takes three times as long."""
    ax, ay, az = a.T
    bx, by, bz = b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)

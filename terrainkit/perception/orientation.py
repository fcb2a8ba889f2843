"""Yaw and direction of gravity of robots, from quaternions that rotate from robot to world."""

import numpy as np
from numpy.typing import NDArray

from terrainkit.curriculum.arrays import Array, like
from terrainkit.perception.height_scan import to_floats


def quat_to_yaw(quat: Array) -> Array:
    """Return the yaw of robots: the rotation about z that follows roll and pitch, as in URDF.

    Args:
        quat: Unit quaternions (w, x, y, z), shape (..., 4).

    Returns:
        Yaw from -pi to pi, to the left [rad], shape (...).

    Raises:
        ConfigError: if the shape is wrong, or a value is not finite.
    """
    w, x, y, z = _components(quat)
    return like(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)), quat)


def projected_gravity(quat: Array) -> Array:
    """Return the direction of gravity in the frames of robots.

    Args:
        quat: Unit quaternions (w, x, y, z), shape (..., 4).

    Returns:
        Unit vectors, shape (..., 3): (0, 0, -1) for a level robot.

    Raises:
        ConfigError: if the shape is wrong, or a value is not finite.
    """
    w, x, y, z = _components(quat)
    gravity = [2 * (w * y - x * z), -2 * (w * x + y * z), 2 * (x * x + y * y) - 1]
    return like(np.stack(gravity, axis=-1), quat)


def _components(quat: Array) -> NDArray[np.floating]:
    return np.moveaxis(to_floats("quat", quat, [*np.shape(quat)[:-1], 4]), -1, 0)

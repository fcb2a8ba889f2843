"""Roll, pitch and yaw of a rotation, as URDF writes it."""

import math

import numpy as np

from terrainkit_robots.model import Matrix

_UPRIGHT = 1e-13
"""With a cosine of the pitch below this, x points straight up or down: of roll and yaw only the sum
or difference means anything, and roll is 0."""


def roll_pitch_yaw(turn: Matrix) -> Matrix:
    """Return the angles about the fixed axes x, then y, then z of a rotation, shape (3,) [rad].

    The rotation is Rz(yaw) Ry(pitch) Rx(roll). Yaw is found last, of what is left when roll is
    undone, Rz(yaw) Ry(pitch): so it makes up for a roll that near the pole is little more than
    noise, and the three together are exact everywhere.

    Args:
        turn: Rotation matrix, shape (3, 3).
    """
    across = math.hypot(turn[2, 1], turn[2, 2])
    roll = math.atan2(turn[2, 1], turn[2, 2]) if across > _UPRIGHT else 0.0
    pitch = math.atan2(-turn[2, 0], across)
    s, c = math.sin(roll), math.cos(roll)
    yaw = math.atan2(s * turn[0, 2] - c * turn[0, 1], c * turn[1, 1] - s * turn[1, 2])
    return np.array([roll, pitch, yaw])

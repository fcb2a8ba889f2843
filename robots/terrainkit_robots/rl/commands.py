"""The commands: what robots are asked to do, and when they are asked for more."""

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.rl.rotation import wrapped
from terrainkit_robots.rl.task import Commands

FloatArray = NDArray[np.float32]

_WELL = 0.8
"""Part of the largest tracking reward from which a command is followed well: legged_gym's."""

_WIDER = 0.1
"""How much the range of commands widens at a time [m/s]; legged_gym's 0.5 is most of it."""


def draw_commands(
    rng: np.random.Generator, count: int, settings: Commands, lin_vel_x: tuple[float, float]
) -> tuple[FloatArray, FloatArray]:
    """Return new commands, shape (count, 3), and headings to turn to [rad], shape (count,).

    Args:
        rng: Where they are drawn from.
        count: How many.
        settings: Their ranges.
        lin_vel_x: Range of the forward speed at this time [m/s].
    """
    ranges = np.array([lin_vel_x, settings.lin_vel_y, settings.ang_vel_yaw], np.float32)
    low, high = ranges.T
    commands = low + (high - low) * rng.random((count, 3), dtype=np.float32)
    commands[np.hypot(commands[:, 0], commands[:, 1]) < settings.min_norm, :2] = 0
    commands[np.abs(commands[:, 2]) < settings.min_norm, 2] = 0
    left, right = settings.heading
    heading = (left + (right - left) * rng.random(count)).astype(np.float32)
    standing = rng.random(count) < settings.standing
    commands[standing] = 0
    heading[standing] = np.nan  # to stand is not to turn
    return commands, heading


def turning_to(heading: FloatArray, yaw: FloatArray, settings: Commands) -> FloatArray:
    """Return the turning speed that leads from a yaw to a heading [rad/s]; 0 where that is NaN."""
    speed = np.float32(settings.heading_stiffness) * wrapped(heading - yaw)
    return np.nan_to_num(np.clip(speed, *settings.ang_vel_yaw), nan=0.0)


def widened(
    lin_vel_x: tuple[float, float], followed: float, settings: Commands
) -> tuple[float, float]:
    """Return the range of the forward speed after some episodes.

    Args:
        lin_vel_x: The range before [m/s].
        followed: Mean of `tracking_lin_vel` over those episodes, 0 to 1.
        settings: How far it may widen.
    """
    if not settings.curriculum or followed < _WELL:
        return lin_vel_x
    low, high = lin_vel_x
    most = settings.max_curriculum
    return max(low - _WIDER, min(low, -most)), min(high + _WIDER, max(high, most))

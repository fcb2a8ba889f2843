"""The commands: what robots are asked to do, and when they are asked for more."""

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.rl.ground import Ground
from terrainkit_robots.rl.rotation import wrapped
from terrainkit_robots.rl.task import Commands

FloatArray = NDArray[np.float32]
Ids = NDArray[np.int64]

_WELL = 0.8
"""Part of the largest tracking reward from which a command is followed well: legged_gym's."""

_WIDER = 0.1
"""How much the range of commands widens at a time [m/s]; legged_gym's 0.5 is most of it."""


def asks_headings(settings: Commands, ground: Ground) -> bool:
    """Return whether headings are asked for: unless given, on any ground but a plane."""
    given = settings.heading_command
    return not ground.level if given is None else given


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


class Orders:
    """What n robots are asked for now."""

    def __init__(self, settings: Commands, num_envs: int, dt: float, *, headings: bool) -> None:
        self.commands = np.zeros((num_envs, 3), np.float32)
        """Speed forward and to the left [m/s], turning speed to the left [rad/s], shape (n, 3)."""

        self.heading = np.zeros(num_envs, np.float32)
        """Direction to turn to, NaN for none [rad], shape (n,)."""

        self.headings = headings
        """Whether headings are asked for, in place of turning speeds."""

        self.held: FloatArray | None = None
        """What is asked for all the time, shape (n, 3); None for what is drawn."""

        self.lin_vel_x = settings.lin_vel_x
        """Range of the forward speed at this time [m/s]."""

        self.followed = np.zeros(2)
        """Earned for `tracking_lin_vel` since the range was judged, and in what time [s]."""

        self._settings = settings
        self._every = max(1, round(settings.resampling_time / dt))

    def draw(self, rng: np.random.Generator, ids: Ids) -> None:
        """Ask robots `ids` for something new."""
        self.commands[ids], self.heading[ids] = draw_commands(
            rng, len(ids), self._settings, self.lin_vel_x
        )

    def renew(self, rng: np.random.Generator, steps: Ids) -> None:
        """Ask those for something new whose time has come.

        Args:
            rng: Where it is drawn from.
            steps: Steps of each robot's episode, 0 for one that has just been asked, shape (n,).
        """
        ids = np.flatnonzero((steps % self._every == 0) & (steps > 0))
        if len(ids):
            self.draw(rng, ids)

    def steer(self, yaw: FloatArray) -> None:
        """Ask for what is held, or for turning towards the headings; yaw [rad], shape (n,)."""
        if self.held is not None:
            self.commands[:] = self.held
        elif self.headings:
            self.commands[:, 2] = turning_to(self.heading, yaw, self._settings)

    def widen(self, earned: float, lived: float, *, scale: float, enough: float) -> None:
        """Ask for more, once what is asked was followed well for long enough.

        Args:
            earned: What robots earned for `tracking_lin_vel` in episodes that ended.
            lived: How long these were, in all [s].
            scale: What following to perfection earns in a second.
            enough: Time over which following is judged [s].
        """
        self.followed += earned, lived
        earned, lived = self.followed
        if lived >= enough:
            self.lin_vel_x = widened(self.lin_vel_x, earned / lived / scale, self._settings)
            self.followed[:] = 0

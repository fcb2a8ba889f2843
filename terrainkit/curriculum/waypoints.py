"""Waypoints: the goals of patches as velocity commands, and the progress along them."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

PROMOTION = 0.8
"""Share of the goals that makes an episode a success. Below half of it, the episode is a failure.
Extreme Parkour uses 0.8 and 0.4 as shares of the commanded distance in
`_update_terrain_curriculum`."""


def route_lengths(start: NDArray[np.floating], goals: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return the length of the route from the start of each robot through its goals, up to each.

    Args:
        start: Positions, x and y [m], shape (n, 2).
        goals: Goals, x and y [m], shape (n, k, 2), padded with NaN.

    Returns:
        Lengths [m], shape (n, k), padded with NaN.
    """
    points = np.concatenate([start[:, None], goals], axis=1)
    return np.asarray(np.linalg.norm(np.diff(points, axis=1), axis=2).cumsum(axis=1))


@dataclass(kw_only=True, eq=False)
class Waypoints:
    """The goals of n robots, and the goal that each robot walks to.

    As in Extreme Parkour, a robot walks to its goals in order, and goes on to the next goal as soon
    as it is within a radius of the current one.
    """

    goals: NDArray[np.floating]
    """Goals of each robot, x and y [m], shape (n, k, 2), padded with NaN."""

    index: NDArray[np.int64]
    """Next goal of each robot, shape (n,); the number of its goals after the last one."""

    radius: float
    """Horizontal distance at which a goal is reached [m]."""

    @classmethod
    def make(cls, num_envs: int, num_goals: int, radius: float) -> Self:
        """Return waypoints of robots without goals, with space for a number of goals."""
        goals = np.full((num_envs, num_goals, 2), np.nan)
        return cls(goals=goals, index=np.zeros(num_envs, np.int64), radius=radius)

    @property
    def numbers(self) -> NDArray[np.int64]:
        """Number of goals of each robot, shape (n,)."""
        return np.asarray((~np.isnan(self.goals[..., 0])).sum(axis=1))

    @property
    def progress(self) -> NDArray[np.float64]:
        """Share of the goals that each robot has reached, shape (n,); NaN if it has none."""
        numbers = self.numbers
        return np.where(numbers > 0, self.index / np.maximum(numbers, 1), np.nan)

    def update(self, position: NDArray[np.floating]) -> NDArray[np.bool_]:
        """Advance the robots that are at their goal.

        Args:
            position: Positions, x and y [m], shape (n, 2).

        Returns:
            Whether each robot has reached its last goal, shape (n,).
        """
        reached = np.linalg.norm(self._current() - position, axis=1) <= self.radius
        self.index += reached & (self.index < self.numbers)
        return np.asarray(self.progress == 1)

    def of_episodes(
        self,
        env_ids: NDArray[np.int64],
        fallen: NDArray[np.bool_],
        start: NDArray[np.floating],
        commanded: NDArray[np.floating],
    ) -> NDArray[np.float64]:
        """Return the progress of episodes that end, for the samplers of `terrainkit.curriculum`.

        It is the share of the goals that the robot reached, divided by `PROMOTION`. It is NaN if
        the episode says nothing about the terrain: the robot has no goals, or it followed commands
        that were too slow to reach so many goals.

        Args:
            env_ids: Environments, shape (m,).
            fallen: Whether each robot fell, shape (m,).
            start: Position of each robot at the start of the episode, x and y [m], shape (m, 2).
            commanded: Distance that was commanded [m], shape (m,).

        Returns:
            Progress, 0 to 1 or NaN, shape (m,).
        """
        lengths = route_lengths(start, self.goals[env_ids])
        possible = (lengths - self.radius <= commanded[:, None]).sum(axis=1)
        needed, reached = PROMOTION * self.numbers[env_ids], self.index[env_ids]
        too_slow = ~fallen & (possible < needed) & (reached >= PROMOTION * possible / 2)
        progress = np.minimum(self.progress[env_ids] / PROMOTION, 1)
        return np.where(too_slow & (progress < 1), np.nan, progress)

    def reset(self, env_ids: NDArray[np.int64], goals: NDArray[np.floating]) -> None:
        """Start new episodes of some robots.

        Args:
            env_ids: Robots, shape (m,).
            goals: Their goals, x and y [m], shape (m, k, 2), padded with NaN.
        """
        self.goals[env_ids], self.index[env_ids] = goals, 0

    def commands(
        self,
        position: NDArray[np.floating],
        yaw: NDArray[np.floating],
        speed: ArrayLike,
        stiffness: float,
        max_yaw_rate: tuple[float, float],
    ) -> NDArray[np.float32]:
        """Return velocity commands toward the goals: turn to the goal, and walk ahead.

        Args:
            position: x and y of the robots [m], shape (n, 2).
            yaw: Headings of the robots [rad], shape (n,).
            speed: Forward velocity of a robot that faces its goal [m/s], shape (n,) or ().
            stiffness: Yaw rate per heading error [1/s].
            max_yaw_rate: Limits of the yaw rate, to the right and to the left [rad/s].

        Returns:
            Forward and left velocity [m/s] and yaw rate [rad/s], shape (n, 3); NaN for robots
            without goals or with a speed of NaN.
        """
        x, y = (self._current() - position).T
        error = (np.arctan2(y, x) - yaw + np.pi) % (2 * np.pi) - np.pi
        forward = speed * np.maximum(np.cos(error), 0)
        yaw_rate = np.clip(stiffness * error, *max_yaw_rate)
        return np.column_stack([forward, 0 * forward, yaw_rate + 0 * forward]).astype(np.float32)

    def _current(self) -> NDArray[np.floating]:
        """Return the next goals, the last ones after them, shape (n, 2)."""
        index = np.clip(self.index, 0, np.maximum(self.numbers - 1, 0))
        return self.goals[np.arange(len(index)), index]

"""The earnings: what robots are paid for a step, and for an episode so far."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.rl.rewards import chosen
from terrainkit_robots.rl.robot import Robot
from terrainkit_robots.rl.state import State
from terrainkit_robots.rl.task import Rewards

FloatArray = NDArray[np.float32]
Ids = NDArray[np.int64]


class Earnings:
    """Pay n robots, and keep the books by reward."""

    def __init__(self, settings: Rewards, robot: Robot, dt: float, num_envs: int) -> None:
        self.rewards = chosen(settings)
        """Each reward that counts, by name, with its scale."""

        self.sums = {name: np.zeros(num_envs, np.float32) for name in self.rewards}
        """What each robot earned in its episode so far, by reward, shape (n,)."""

        self._settings, self._robot, self._dt = settings, robot, np.float32(dt)

    def pay(self, state: State, bad: NDArray[np.bool_]) -> FloatArray:
        """Return what a step pays, shape (n,), and add it to the sums.

        Args:
            state: The state after the step.
            bad: Robots whose physics went bad: the state is not theirs but that of a reset, so
                they get no more than what a fall costs. Shape (n,).
        """
        total = np.zeros(len(state.base_pos), np.float32)
        falls = np.zeros_like(total)
        for name, (function, scale) in self.rewards.items():
            earned = function(state, self._robot, self._settings) * np.float32(scale) * self._dt
            if name == "termination":
                falls += earned
            else:
                earned[bad] = 0
                total += earned
            self.sums[name] += earned
        if self._settings.only_positive_rewards:
            np.maximum(total, 0, out=total)
        return total + falls

    def per_second(self, ids: Ids, lived: NDArray[np.floating[Any]]) -> dict[str, float]:
        """Return the mean of what robots `ids` earned per second, by reward.

        Args:
            ids: Robots.
            lived: How long their episodes lasted [s].
        """
        return {name: float((total[ids] / lived).mean()) for name, total in self.sums.items()}

    def forget(self, ids: Ids) -> None:
        """Begin new sums."""
        for total in self.sums.values():
            total[ids] = 0

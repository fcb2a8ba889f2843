"""Roll out a policy, and measure how well the robots follow their commands."""

from collections.abc import Callable, Iterable, Iterator

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict

from terrainkit_robots.rl.env import LeggedEnv

FloatArray = NDArray[np.float32]
BoolArray = NDArray[np.bool_]
Policy = Callable[[TensorDict], torch.Tensor]
Progress = Callable[[float], object]
"""Called after each step with the completed fraction of the time, 0 to 1."""

SETTLING_TIME = 2.0
"""Time after the start and after each new command without measurements [s]."""

AVERAGING_TIME = 1.0
"""Time over which velocities are averaged for the errors ending in `_1s` [s]."""


def rollout(
    env: LeggedEnv, policy: Policy, schedule: Iterable[FloatArray | None]
) -> Iterator[tuple[TensorDict, FloatArray, BoolArray]]:
    """Step the environment with a policy.

    Args:
        env: The environment.
        policy: The policy.
        schedule: The commands of each step, shape (n, 3); None for the task's random commands.

    Yields:
        After each step: the observations before it, the commands during it, shape (n, 3), and which
        robots fell and were reset, shape (n,).
    """
    previous: object = ...  # neither commands nor None, so that the first entry is applied
    for commands in schedule:
        if commands is not previous:
            env.set_commands(commands)
            previous = commands
        state, obs = env.state, env.get_observations()
        with torch.inference_mode():
            actions = policy(obs)
        _, _, dones, extras = env.step(actions)
        yield obs, state.commands, (dones & ~extras["time_outs"]).cpu().numpy()


def command_schedule(commands: FloatArray | None, num_steps: int) -> list[FloatArray | None]:
    """Return the commands of each step.

    Args:
        commands: Commands of shape (n, 3), or a sequence of k commands for equal parts of the time,
            shape (k, n, 3); None for the task's random commands.
        num_steps: Number of steps.
    """
    if commands is None:
        return [None] * num_steps
    parts = list(commands.reshape(-1, *commands.shape[-2:]))
    return [parts[step * len(parts) // num_steps] for step in range(num_steps)]


class EvaluationRollout:
    """A rollout that measures each robot up to its first fall.

    On a map, a robot is measured until it has crossed half a patch: the terrain beyond belongs to
    another patch.

    Attributes:
        falls: Robots that fell, shape (n,).
        crossed: Robots that crossed half a patch, shape (n,).
        error_sums: Sums over steps of the norm of the velocity error, the same for velocities
            averaged over 1 s, the absolute yaw rate error, and the same averaged, shape (4, n).
        error_counts: Number of measured steps, shape (4, n).
    """

    def __init__(self, env: LeggedEnv) -> None:
        n, dt = env.num_envs, env.cfg.dt
        self.env, self.start_xy = env, env.start_pos.copy()
        self.half_patch = np.inf if env.terrain.is_flat else env.terrain.patch_length / 2
        self.falls, self.crossed = np.zeros(n, bool), np.zeros(n, bool)
        self.distance, self.commanded_distance = np.zeros(n), np.zeros(n)
        self.error_sums, self.error_counts = np.zeros((4, n)), np.zeros((4, n), np.int64)
        self._settling_steps = round(SETTLING_TIME / dt)
        self._window = max(1, round(AVERAGING_TIME / dt))
        self._recent_errors = np.zeros((self._window, n, 3), np.float32)  # ring buffer
        self._last_commands = np.full((n, 3), np.nan, np.float32)
        self._command_steps = np.zeros(n, np.int64)  # since the command changed
        self._measured_steps = np.zeros(n, np.int64)  # without interruption
        self._num_steps = 0

    @property
    def success(self) -> BoolArray:
        """Robots that crossed half a patch, or walked half of the commanded distance, (n,)."""
        return self.crossed | (~self.falls & (self.distance >= self.commanded_distance / 2))

    def run(
        self,
        policy: Policy,
        seconds: float,
        commands: FloatArray | None = None,
        progress: Progress = lambda _: None,
        *,
        stop_early: bool = True,
    ) -> None:
        """Run the rollout for some time [s]; see :func:`command_schedule` for `commands`.

        With `stop_early`, it ends once every robot has fallen or crossed half a patch.
        """
        steps = max(1, round(seconds / self.env.cfg.dt))
        schedule = command_schedule(commands, steps)
        for index, step in enumerate(rollout(self.env, policy, schedule), 1):
            self._update(*step[1:])
            progress(index / steps)
            if stop_early and (self.falls | self.crossed).all():
                break

    def _update(self, commands: FloatArray, falls: BoolArray) -> None:
        active = ~(self.falls | self.crossed)
        self.falls |= active & falls
        active &= ~falls
        state = self.env.state
        velocity = np.column_stack([state.base_lin_vel[:, :2], state.base_ang_vel[:, 2]])
        self._update_errors(commands, velocity - commands, active)
        distance = np.linalg.norm(state.base_pos[:, :2] - self.start_xy, axis=1)
        commanded = np.linalg.norm(self.env.curriculum.commanded, axis=1)
        self.distance[active] = distance[active]
        self.commanded_distance[active] = commanded[active]
        self.crossed |= active & (distance > self.half_patch)

    def _update_errors(self, commands: FloatArray, error: FloatArray, active: BoolArray) -> None:
        # A heading command changes the yaw rate at every step, which is no new command.
        command = self.env.velocity_command
        axes = 2 if command.heading_command and command.fixed is None else 3
        same = (commands[:, :axes] == self._last_commands[:, :axes]).all(axis=1)
        self._command_steps = np.where(same, self._command_steps + 1, 1)
        self._last_commands[:] = commands
        settled = active & (self._command_steps > self._settling_steps)
        self._measured_steps = np.where(settled, self._measured_steps + 1, 0)
        self._recent_errors[self._num_steps % self._window] = error
        self._num_steps += 1
        averaged = self._measured_steps >= self._window
        mean_error = self._recent_errors.mean(axis=0)
        for row, (value, mask) in enumerate([(error, settled), (mean_error, averaged)]):
            self.error_sums[row, mask] += np.hypot(value[mask, 0], value[mask, 1])
            self.error_sums[row + 2, mask] += np.abs(value[mask, 2])
            self.error_counts[row::2, mask] += 1

"""The trials: robots walk, and how well they follow, who falls and who arrives is counted.

A trial ends with the first fall. On a map it also ends once half a patch is crossed, since the
ground beyond is another's.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.policy.actor import Act
from terrainkit_robots.policy.rollout import Step, timetable, walk
from terrainkit_robots.rl.env import LeggedEnv

FloatArray = NDArray[np.float32]
Watch = Callable[[float], object]

SETTLING = 2.0
"""Time after the start, and after each new command, that is not measured: robots speed up [s]."""

WINDOW = 1.0
"""Time over which velocities are averaged in the errors called `_1s` [s]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Outcome:
    """How n robots did in their trials."""

    fell: NDArray[np.bool_]
    """Who fell, shape (n,)."""

    success: NDArray[np.bool_]
    """Who crossed half a patch, or came half as far as asked without a fall, shape (n,)."""

    sums: NDArray[np.float64]
    """Sums over steps of the four errors, in the order of `Score`, shape (4, n)."""

    counts: NDArray[np.int64]
    """Steps that were summed, shape (4, n)."""


def roll_out(
    env: LeggedEnv,
    policy: Act,
    seconds: float,
    commands: FloatArray | None = None,
    watch: Watch = lambda _: None,
    *,
    to_the_end: bool = False,
) -> Outcome:
    """Let robots walk that have just begun, and return how they did.

    Args:
        env: The environment.
        policy: What acts.
        seconds: How long they walk [s].
        commands: What they are asked for one after the other, each for the same part of the time,
            shape (n, 3) or (k, n, 3); None for the task's random commands.
        watch: Is told after each step which part of the time is over, 0 to 1.
        to_the_end: Go on when every trial has ended before its time.
    """
    steps = max(1, round(seconds / env.cfg.dt))
    trials = Trials(env)
    for k, step in enumerate(walk(env, policy, timetable(commands, steps)), 1):
        trials.add(step)
        watch(k / steps)
        if trials.ended.all() and not to_the_end:
            break
    return trials.outcome()


class Trials:
    """The first walk of each robot, as it is measured."""

    def __init__(self, env: LeggedEnv) -> None:
        n, dt = env.num_envs, env.cfg.dt
        self._env, self._start = env, env.start_pos.copy()
        self._settling, self._window = round(SETTLING / dt), max(1, round(WINDOW / dt))
        self._half = np.inf if env.terrain.is_flat else env.terrain.patch_length / 2
        self.fell, self.crossed = np.zeros(n, bool), np.zeros(n, bool)
        self._distance, self._asked = np.zeros(n), np.zeros(n)
        self._sums, self._counts = np.zeros((4, n)), np.zeros((4, n), np.int64)
        self._recent = np.zeros((self._window, n, 3), np.float32)
        self._command = np.full((n, 3), np.nan, np.float32)
        self._same = np.zeros(n, np.int64)  # steps since the command changed
        self._streak = np.zeros(n, np.int64)  # steps measured since then
        self._steps = 0

    @property
    def ended(self) -> NDArray[np.bool_]:
        """Whose trial has ended before its time, shape (n,)."""
        return self.fell | self.crossed

    def add(self, step: Step) -> None:
        """Measure a step that was just made."""
        active = ~self.ended
        self.fell |= active & step.fallen
        active &= ~step.fallen
        state = self._env.state
        error = np.column_stack([state.base_lin_vel[:, :2], state.base_ang_vel[:, 2]])
        self._measure(step.commands, error - step.commands, active)
        way = np.linalg.norm(state.base_pos[:, :2] - self._start, axis=1)
        self._distance[active] = way[active]
        self._asked[active] = np.linalg.norm(self._env.curriculum.commanded[active], axis=1)
        self.crossed |= active & (way > self._half)

    def _measure(self, commands: FloatArray, error: FloatArray, active: NDArray[np.bool_]) -> None:
        orders = self._env.velocity_command
        # A heading makes a new turning speed of every step; only new directions count then.
        axes = 2 if orders.heading_command and orders.fixed is None else 3
        same = (commands[:, :axes] == self._command[:, :axes]).all(axis=1)
        self._same = np.where(same, self._same + 1, 1)
        self._command[:] = commands
        measured = active & (self._same > self._settling)
        self._streak = np.where(measured, self._streak + 1, 0)
        self._recent[self._steps % self._window] = error
        self._steps += 1
        full = self._streak >= self._window
        mean = self._recent.mean(axis=0)
        kinds = (error, mean)
        for k, (kind, counted) in enumerate(zip(kinds, (measured, full), strict=True)):
            for at, size in ((k, np.hypot(kind[:, 0], kind[:, 1])), (k + 2, np.abs(kind[:, 2]))):
                self._sums[at, counted] += size[counted]
                self._counts[at, counted] += 1

    def outcome(self) -> Outcome:
        """Return how the trials went."""
        return Outcome(
            fell=self.fell,
            success=self.crossed | (~self.fell & (self._distance >= self._asked / 2)),
            sums=self._sums,
            counts=self._counts,
        )

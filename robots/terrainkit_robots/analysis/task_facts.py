"""Facts of a training task: what known behaviors earn and observe, for the rules of family TSK."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.description.fix import Source

REST = "rest"
"""Name of the part of the reward that a host does not attribute to a term."""


class TaskModel(NamedTuple):
    """What reports print of a task, in the place of a robot's description."""

    name: str
    title: str
    file: Path
    source: Source
    kind: str = "task"
    links: tuple[Any, ...] = ()
    joints: tuple[Any, ...] = ()
    problems: tuple[Any, ...] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class Rollout:
    """What n robots with one behavior earned and observed in s steps of their first episodes."""

    rewards: NDArray[Any]
    """Each term with its scale, per second or, in Gymnasium, per step, shape (s, n, k)."""

    observations: NDArray[Any]
    """What the policy observes, shape (s, n, w)."""

    running: NDArray[np.bool_]
    """Steps before the one in which the episode ends, shape (s, n)."""

    terminated: NDArray[np.bool_]
    """Whether the episode ended with a termination, shape (n,)."""

    rises: NDArray[Any] | None
    """Change of the level after the episode, shape (n,); None without levels."""

    @property
    def means(self) -> NDArray[Any]:
        """Mean of each term, shape (k,); 0 if no episode lasted for a step."""
        steps = max(1, int(self.running.sum()))
        return np.asarray(self.rewards[self.running].sum(axis=0) / steps)


class Training(NamedTuple):
    """What a short training from scratch earned in its first and its last quarter."""

    error: str = ""
    """Why it stopped, in which case there is nothing else."""

    terms: tuple[str, ...] = ()
    """Names of the reward terms."""

    rewards: NDArray[Any] = np.zeros((2, 0))
    """Mean of each term in both quarters [1/s], shape (2, k)."""

    falls: NDArray[Any] = np.zeros(2)
    """Falls of a robot in both quarters [1/s], shape (2,)."""

    robot_seconds: float = 1.0
    """Time of all robots in a quarter [s]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TaskFacts:
    """What the rules of tasks read. A value that is None cannot be measured in the host."""

    model: TaskModel
    host: str
    """Name of the host: terrainkit, gymnasium or mjlab."""

    dt: float
    """Time of a step [s]."""

    terms: tuple[str, ...]
    """Names of the reward terms; `termination` is paid in the step of a fall."""

    observation_names: tuple[str, ...]
    """Term of each observed number, shape (w,)."""

    rollouts: Mapping[str, Rollout]
    """Rollouts by the name of the behavior."""

    missing: Mapping[str, str]
    """Why behaviors and values are missing, by name."""

    clearance: NDArray[Any] | None = None
    """Height of the lowest point of the robots above the ground after a reset [m], shape (n,)."""

    base_height: float | None = None
    """Height of the base in the default pose [m]."""

    commands: NDArray[Any] | None = None
    """Sampled commands, shape (m, 3): forward and left velocity [m/s], yaw rate [rad/s]."""

    max_speed: float | None = None
    """Speed of a foot at the speed limits of the joints, with straight legs [m/s]."""

    joints: tuple[str, ...] = ()
    """Names of the joints with a position as action."""

    targets: NDArray[Any] | None = None
    """Positions of the joints for actions of -1, 0 and 1 standard deviation, shape (3, j)."""

    limits: NDArray[Any] | None = None
    """Limits of the joints, lower and upper, shape (2, j)."""

    action_torque: NDArray[Any] | None = None
    """Torque of an action of 1 at the default pose, relative to the effort, shape (j,)."""

    responses: Mapping[str, str] | None = None
    """Why a joint does not follow a step of its target, by name; empty if it does."""

    training: Training | None = None
    """A short training, if one was asked for."""

    asymmetry: str | None = None
    """How left and right differ; empty if they are mirror images."""

    def rollout(self, behavior: str) -> Rollout:
        """Return the rollout of a behavior.

        Raises:
            CannotCheckError: if the host does not have it.
        """
        if behavior not in self.rollouts:
            raise CannotCheckError(self.missing.get(behavior, f"the task has no {behavior}"))
        return self.rollouts[behavior]

    def total(self, behavior: str) -> float:
        """Return the mean reward of a behavior, without what is paid at its end."""
        return float(self.rollout(behavior).means.sum())

    def positive(self) -> float:
        """Return the positive rewards of the robots that move as commanded."""
        return float(np.maximum(self.rollout("moving").means, 1e-9).sum())

    def value(self, name: str) -> Any:
        """Return a value that a host may not have.

        Raises:
            CannotCheckError: if it is None.
        """
        if getattr(self, name) is None:
            default = f"{self.host} does not tell the {name.replace('_', ' ')}"
            raise CannotCheckError(self.missing.get(name, default))
        return getattr(self, name)

    def to_json(self) -> dict[str, Any]:
        """Return the mean of each term by behavior, without what is paid at the end.

        Scattered robots are left out: their rewards only show which terms can change.
        """
        behaviors = (name for name in self.rollouts if name != "scattered")
        means = {name: (self.rollout(name).means.round(6) + 0).tolist() for name in behaviors}
        rewards = {name: dict(zip(self.terms, row, strict=True)) for name, row in means.items()}
        return {"host": self.host, "rewards": rewards}

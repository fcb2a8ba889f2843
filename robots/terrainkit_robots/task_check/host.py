"""What the behaviors need of an environment that MuJoCo simulates, in any framework."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.integrations.near_geoms import collides
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.task_facts import Training
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.simulation.geoms import lowest_point

Array = NDArray[Any]
Progress = Callable[[str], object]

WEIGHTLESS = int(mujoco.mjtDisableBit.mjDSBL_CONTACT) | int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
"""Flags of MuJoCo with which a body keeps its velocity."""

FROUDE = 0.5
"""Square of the speed over g and the height, at which animals begin to trot (Alexander 1989)."""


class Step(NamedTuple):
    """What one step of n robots returned."""

    rewards: Array  # each term with its scale, shape (n, k)
    observations: Array  # of the policy, shape (n, w)
    terminated: Array  # robots whose episode ended with a termination, shape (n,)
    done: Array  # robots whose episode ended, shape (n,)


class Motion(NamedTuple):
    """The state in which the next step is to end."""

    qpos: Array  # shape (n, nq)
    qvel: Array  # shape (n, nv)


class Host(ABC):
    """n robots in the environment of a task.

    Attributes:
        name: Name of the framework.
        file: File of the task, or its name.
        dt: Time of a step [s].
        std: First standard deviation of the actions.
        terms, observation_names: As in `TaskFacts`.
        model: The MuJoCo model.
        default_qpos: Default pose with the base at its height above the ground, shape (nq,).
        behaviors: Names of the behaviors that it supports.
        steps: Steps of a rollout.
        facts: Values of `TaskFacts` that the host has, by name.
        missing: Why behaviors and values are missing, by name.
    """

    name: str
    file: Path
    dt: float
    std = 1.0
    num_envs: int
    num_actions: int
    terms: tuple[str, ...]
    observation_names: tuple[str, ...]
    model: Any
    default_qpos: Array
    behaviors: tuple[str, ...] = ("statue", "random", "moving", "fall", "scattered")
    steps = 50

    def __init__(self) -> None:
        self.facts: dict[str, Any] = {}
        self.missing: dict[str, str] = {}

    @abstractmethod
    def reset(self, behavior: str) -> None:
        """Start new episodes of all robots."""

    @abstractmethod
    def step(self, actions: Array, motion: Motion | None = None) -> Step:
        """Step all robots, with contacts and gravity or along a motion without them."""

    @abstractmethod
    def qpos(self) -> Array:
        """Return the positions, shape (n, nq)."""

    @abstractmethod
    def set_state(self, qpos: Array, qvel: Array) -> None:
        """Set positions and velocities of all robots."""

    @property
    def commands(self) -> Array:
        """Return the current commands, shape (n, 3); by default ahead, at the speed of a trot."""
        speed = np.sqrt(FROUDE * 9.81 * self.default_qpos[self.height])
        return np.tile([speed, 0.0, 0.0], (self.num_envs, 1))

    @property
    def levels(self) -> Array | None:
        """Return the level of each robot, shape (n,), if there is a terrain curriculum."""
        return None

    def ground(self, xy: Array) -> Array:
        """Return the height of the ground at points of shape (..., 2) [m]; by default 0."""
        return np.zeros(xy.shape[:-1])

    def policy(self) -> Array:
        """Return the actions of the policy, shape (n, a)."""
        raise CannotCheckError("no policy was given")

    def train(self, samples: int, progress: Progress) -> Training:  # noqa: ARG002
        """Train a policy briefly; `progress` gets a text after each iteration.

        Raises:
            ConfigError: if the host has no training.
        """
        raise ConfigError(
            f"--samples: got {samples} for a task of {self.name}; leave it out, since only tasks "
            "of terrainkit have a short training"
        )

    @property
    def height(self) -> int:
        """Index of the height of the base in `qpos`: of a freejoint 2, of a base in a plane 1.

        Raises:
            CannotCheckError: if the base has neither.
        """
        kind, first = mujoco.mjtJoint, self.model.jnt_type[:3].tolist()
        if first[0] == kind.mjJNT_FREE:
            return 2
        if first == [kind.mjJNT_SLIDE, kind.mjJNT_SLIDE, kind.mjJNT_HINGE]:
            return 1
        raise CannotCheckError("the base has no freejoint")

    def start_motion(self, motion: Motion) -> None:
        """Set the state from which a step without forces ends in the state of a motion."""
        start = motion.qpos.copy()
        for qpos, qvel in zip(start, motion.qvel, strict=True):
            mujoco.mj_integratePos(self.model, qpos, qvel, -self.dt)
        self.set_state(start, motion.qvel)

    def clearance(self) -> Array:
        """Return the height of the lowest point of each robot above the ground [m], shape (n,)."""
        model, data = self.model, mujoco.MjData(self.model)
        is_robot = model.body_rootid == model.body_rootid[model.jnt_bodyid[0]]
        geoms = np.flatnonzero(collides(model) & is_robot[model.geom_bodyid]).tolist()
        qpos, heights = self.qpos(), []
        for positions in qpos:
            data.qpos[:] = positions
            with quiet_mujoco():
                mujoco.mj_kinematics(model, data)
            heights.append(min(lowest_point(model, data, geom) for geom in geoms))
        return np.asarray(heights - self.ground(qpos[:, :2]))

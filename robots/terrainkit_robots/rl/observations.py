"""Observations: groups of terms, each with its scale, noise and mirror symmetry.

The policy group is what a real robot can measure, with noise. The privileged group has the same
terms without noise, and terms that only a simulation has. Exported policies use this order.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.rl.config import Task
from terrainkit_robots.spec.robot_arrays import Robot
from terrainkit_robots.transforms import FloatArray, quat_rotate_inverse

if TYPE_CHECKING:
    from terrainkit_robots.rl.env import LeggedEnv

HEIGHT_SCAN_OFFSET = 0.5
"""Base height above the ground that is observed as 0 [m], as in legged_gym."""

Symmetry = (
    Literal["scalar", "vector", "axial", "command", "joints", "actions", "feet", "contacts"]
    | Literal["scan", "phase", "history"]
)


@dataclass(frozen=True, eq=False)
class SignedPermutation:
    """Maps w numbers: number k of the result is `sign[k]` times number `index[k]`."""

    index: NDArray[np.int64]
    sign: FloatArray

    def __call__(self, values: FloatArray) -> FloatArray:
        """Return the mirrored values, shape (n, w)."""
        return values[:, self.index] * self.sign


@dataclass(frozen=True, eq=False)
class ObservationTerm:
    """One term of an observation group: (clip(value - offset, *clip) + noise) * scale."""

    function: Callable[["LeggedEnv"], FloatArray]
    """Returns the value of each environment, shape (n, width)."""

    symmetry: Symmetry | SignedPermutation = "scalar"
    """How the value transforms when left and right are swapped: as a quantity of that kind, or by
    a permutation and signs of its numbers."""

    scale: tuple[float, ...] | float = 1.0
    """Scale factor, or one per number."""

    noise: float = 0.0
    """Half range of the uniform noise on the policy's group, before scaling; `noise.noise_level` of
    the task is a factor on it."""

    offset: FloatArray | float = 0.0
    """Value that is observed as 0."""

    clip: tuple[float, float] | None = None
    """Limits of the value minus the offset."""

    unit: str | tuple[str, ...] = "1"
    """Unit of the value, or of each number, for the description of exported policies."""


_FOOT_CONTACT = ObservationTerm(lambda env: env.state.foot_contact.astype("f4"), "contacts")
"""Which feet are in contact, 0 or 1."""

ObsTerms = Mapping[str, Mapping[str, ObservationTerm]]
"""The terms of each observation group by name."""


class PolicyInterface(Protocol):
    """What a policy of another project observes, and what its actions do."""

    def observation_terms(self, env: "LeggedEnv", groups: ObsTerms) -> dict[str, ObservationTerm]:
        """Return the terms of the policy, in place of those of `groups`."""

    def to_ctrl(self, env: "LeggedEnv", actions: FloatArray) -> FloatArray:
        """Return the controls of all actuators, shape (n, j), for actions of shape (n, a)."""


def uses_height_scan(task: Task, *, is_plane: bool) -> bool:
    """Return whether the policy has a height scan; the default is True except on flat ground."""
    setting = task.terrain.measure_heights
    return not is_plane if setting is None else setting


def policy_terms(env: "LeggedEnv") -> dict[str, ObservationTerm]:
    """Return the policy's terms: 47 numbers for a quadruped; a height scan adds 187."""
    robot, options, term = env.robot, env.cfg.observations, ObservationTerm
    scales, noise, units = env.cfg.normalization.obs_scales, env.cfg.noise, env.scene.joint_units
    command_scale = (scales.lin_vel, scales.lin_vel, scales.ang_vel)
    # The angle of a wheel grows without bound and carries no information.
    dof_pos_scale = tuple(np.where(robot.wheels, 0.0, scales.dof_pos).tolist())
    dof_vel_unit = tuple(f"{unit}/s" for unit in units)
    terms = {
        "commands": term(
            lambda env: env.state.commands, "command", command_scale, unit=("m/s", "m/s", "rad/s")
        ),
        "projected_gravity": term(
            lambda env: env.state.projected_gravity, "vector", noise=noise.gravity
        ),
        "base_ang_vel": term(
            lambda env: env.state.base_ang_vel, "axial", scales.ang_vel, noise.ang_vel, unit="rad/s"
        ),
        "dof_pos": term(
            lambda env: env.state.dof_pos + env.joint_offset,
            "joints",
            dof_pos_scale,
            noise.dof_pos,
            offset=robot.default_pose,
            unit=units,
        ),
        "dof_vel": term(
            lambda env: env.state.dof_vel,
            "joints",
            scales.dof_vel,
            noise.dof_vel,
            unit=dof_vel_unit,
        ),
        "actions": term(lambda env: env.state.actions, "actions"),
    }
    if not env.has_velocity:
        del terms["commands"]
    elif env.cfg.commands.gait_period != 0:
        terms["gait_phase"] = term(lambda env: env.state.gait_phase, "phase")
    if options.base_lin_vel:
        terms["base_lin_vel"] = term(
            lambda env: env.state.base_lin_vel + env.lin_vel_bias,
            "vector",
            scales.lin_vel,
            noise.lin_vel,
            unit="m/s",
        )
    if options.foot_contact:
        terms["foot_contact"] = _FOOT_CONTACT
    if env.history_length > 1:
        terms["history"] = term(lambda env: env.obs_history, "history")
    if env.has_height_scan:
        terms["height_scan"] = term(
            lambda env: env.state.height_scan,
            "scan",
            scales.height_measurements,
            noise.height_measurements,
            offset=HEIGHT_SCAN_OFFSET,
            clip=(-1.0, _deepest(env)),
            unit="m",
        )
    return terms


def history_length(task: Task, robot: Robot) -> int:
    """Return how many of the latest observations the policy has.

    Args:
        task: The task.
        robot: The robot, whose number of feet decides where the task does not.
    """
    options = task.observations
    default = 1 if options.base_lin_vel else 5 if len(robot.spec.feet) == 2 else 3
    return default if options.history_length is None else options.history_length


def history_width(env: "LeggedEnv") -> int:
    """Return the width of the history of the policy: previous observations of the terms before."""
    terms = env.obs_terms["policy"]
    names = [*terms][: [*terms].index("history")] if "history" in terms else []
    width = sum(terms[name].function(env).shape[1] for name in names)
    return (env.history_length - 1) * width


def _deepest(env: "LeggedEnv") -> float:
    """Return the upper limit of the height scan [m]: legged_gym's, or at the task's depth."""
    depth = env.cfg.terrain.scan_depth
    feet = env.robot.base_height_target - HEIGHT_SCAN_OFFSET
    return 1.0 if depth is None else min(1.0, feet + depth)


def privileged_terms(env: "LeggedEnv") -> dict[str, ObservationTerm]:
    """Return the critic's terms; contact forces are in units of the robot's weight."""
    term = ObservationTerm
    # Of the policy's terms, the linear velocity comes last.
    known = {k: v for k, v in policy_terms(env).items() if k not in ("base_lin_vel", "history")}
    return known | {
        "base_lin_vel": _base_lin_vel(env),
        "mean_vel": term(lambda env: env.state.mean_vel, "command"),
        "friction": term(lambda env: env.params.friction),
        "added_mass": term(lambda env: env.params.added_mass),
        "com_shift": term(lambda env: env.params.com_shift, "vector", 10),
        "joint_offset": term(lambda env: env.joint_offset, "joints"),
        "push_vel": term(_push_vel, "vector"),
        "foot_force": term(_foot_force, "feet", 1 / (9.81 * env.mass)),
    }


def estimate_terms(env: "LeggedEnv") -> dict[str, ObservationTerm]:
    """Return the terms that an estimator predicts: base linear velocity and foot contacts."""
    return {"base_lin_vel": _base_lin_vel(env), "foot_contact": _FOOT_CONTACT}


def _base_lin_vel(env: "LeggedEnv") -> ObservationTerm:
    scale = env.cfg.normalization.obs_scales.lin_vel
    return ObservationTerm(lambda env: env.state.base_lin_vel, "vector", scale, unit="m/s")


def _push_vel(env: "LeggedEnv") -> FloatArray:
    return quat_rotate_inverse(env.state.base_quat, env.push_vel)


def _foot_force(env: "LeggedEnv") -> FloatArray:
    n, feet, _ = env.state.foot_force.shape
    quat = np.repeat(env.state.base_quat, feet, axis=0)
    return quat_rotate_inverse(quat, env.state.foot_force.reshape(-1, 3)).reshape(n, -1)


def compute_observations(
    env: "LeggedEnv", terms: Mapping[str, ObservationTerm], rng: np.random.Generator | None = None
) -> FloatArray:
    """Return the observations of a group.

    Args:
        env: The environment.
        terms: Terms of the group by name.
        rng: Generator of the noise; None for no noise.

    Returns:
        Observations, shape (n, width).
    """
    clip = env.cfg.normalization.clip_observations
    values = [term.function(env) for term in terms.values()]
    widths = tuple(value.shape[1] for value in values)
    observations = np.concatenate(values, axis=1, dtype=np.float32)
    offset, low, high, noise, scale = _columns(tuple(terms.values()), widths)
    observations -= offset
    np.clip(observations, low, high, out=observations)
    if rng is not None and env.cfg.noise.noise_level and noise.any():
        noise = np.float32(env.cfg.noise.noise_level) * noise
        noisy = np.flatnonzero(noise)
        start, stop = noisy[0], noisy[-1] + 1  # one block is faster than single columns
        sample = rng.random((len(observations), stop - start), dtype=np.float32)
        observations[:, start:stop] += (2 * sample - 1) * noise[start:stop]
    observations *= scale
    return np.clip(observations, -clip, clip, out=observations)


@lru_cache(maxsize=16)
def _columns(terms: tuple[ObservationTerm, ...], widths: tuple[int, ...]) -> FloatArray:
    """Return offset, limits, noise and scale of each number of a group, shape (5, width)."""
    rows = [
        (term.offset, *(term.clip or (-np.inf, np.inf)), term.noise, term.scale) for term in terms
    ]
    columns = [
        [np.broadcast_to(value, width) for value in row]
        for row, width in zip(rows, widths, strict=True)
    ]
    return np.concatenate(columns, axis=1, dtype=np.float32)


def fill_history(env: "LeggedEnv", observations: FloatArray) -> None:
    """Let the history of a new episode repeat its first observation.

    Args:
        env: The environment.
        observations: Observations of the policy, shape (n, width), which are changed.
    """
    if past := env.history_length - 1:
        new = np.flatnonzero(env.steps_since_reset == 0)
        if not len(new):
            return
        width = env.obs_history.shape[1] // past
        observations[new, width : width * (1 + past)] = np.tile(observations[new, :width], past)

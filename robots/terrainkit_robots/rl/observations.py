"""Observations: groups of terms, each with its scale, noise and mirror symmetry.

The policy group is what a real robot can measure, with noise. The privileged group has the same
terms without noise, and terms that only a simulation knows. Exported policies use this order.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.rl.config import Task
from terrainkit_robots.rl.state import State
from terrainkit_robots.spec.robot import Robot
from terrainkit_robots.transforms import quat_rotate_inverse

FloatArray = NDArray[np.float32]

HEIGHT_SCAN_OFFSET = 0.5
"""Base height above the ground that is observed as 0 [m], as in legged_gym."""


@dataclass(frozen=True, kw_only=True)
class ObservationTerm:
    """One term of an observation group."""

    name: str
    """Name in logs and exports."""
    function: Callable[[State], FloatArray]
    """Computes the term, shape (n, width)."""
    scale: tuple[float, ...] | float = 1.0
    """Scale factor, or one per number."""
    noise: float = 0.0
    """Half range of the uniform noise, added before scaling."""
    symmetry: Literal["scalar", "vector", "axial", "command", "joints", "feet", "scan"] = "scalar"
    """How the term transforms when left and right are swapped; see :mod:`.symmetry`."""


def uses_height_scan(task: Task, *, is_flat: bool) -> bool:
    """Return whether the policy has a height scan; the default is True except on flat ground."""
    setting = task.terrain.measure_heights
    return not is_flat if setting is None else setting


def policy_group(robot: Robot, task: Task, *, scan: bool) -> tuple[ObservationTerm, ...]:
    """Return the policy's terms: 45 numbers for 12 joints, and 187 with the height scan."""
    term, scales, noise = ObservationTerm, task.normalization.obs_scales, task.noise
    level = noise.noise_level
    group = (
        term(
            name="commands",
            function=lambda state: state.commands,
            scale=(scales.lin_vel, scales.lin_vel, scales.ang_vel),
            symmetry="command",
        ),
        term(
            name="projected_gravity",
            function=lambda state: state.projected_gravity,
            noise=level * noise.gravity,
            symmetry="vector",
        ),
        term(
            name="base_ang_vel",
            function=lambda state: state.base_ang_vel,
            scale=scales.ang_vel,
            noise=level * noise.ang_vel,
            symmetry="axial",
        ),
        term(
            name="dof_pos",
            function=lambda state: state.dof_pos + state.joint_offset - robot.default_pose,
            # The angle of a wheel grows without bound and carries no information.
            scale=tuple(np.where(robot.wheels, 0.0, scales.dof_pos).tolist()),
            noise=level * noise.dof_pos,
            symmetry="joints",
        ),
        term(
            name="dof_vel",
            function=lambda state: state.dof_vel,
            scale=scales.dof_vel,
            noise=level * noise.dof_vel,
            symmetry="joints",
        ),
        term(name="actions", function=lambda state: state.actions, symmetry="joints"),
    )
    if not scan:
        return group
    height_scan = term(
        name="height_scan",
        function=lambda state: np.clip(state.height_scan - np.float32(HEIGHT_SCAN_OFFSET), -1, 1),
        scale=scales.height_measurements,
        noise=level * noise.height_measurements,
        symmetry="scan",
    )
    return (*group, height_scan)


def privileged_group(
    robot: Robot, task: Task, *, scan: bool, weight: float
) -> tuple[ObservationTerm, ...]:
    """Return the critic's terms; contact forces are in units of the robot's `weight` [N]."""

    def push_vel(state: State) -> FloatArray:
        return quat_rotate_inverse(state.base_quat, state.push_vel)

    def foot_force(state: State) -> FloatArray:
        n, feet, _ = state.foot_force.shape
        quat = np.repeat(state.base_quat, feet, axis=0)
        return quat_rotate_inverse(quat, state.foot_force.reshape(-1, 3)).reshape(n, -1)

    term = ObservationTerm
    return (
        *(replace(each, noise=0.0) for each in policy_group(robot, task, scan=scan)),
        term(
            name="base_lin_vel",
            function=lambda state: state.base_lin_vel,
            scale=task.normalization.obs_scales.lin_vel,
            symmetry="vector",
        ),
        term(name="friction", function=lambda state: state.friction),
        term(name="added_mass", function=lambda state: state.added_mass),
        term(name="com_shift", function=lambda state: state.com_shift, scale=10, symmetry="vector"),
        term(name="joint_offset", function=lambda state: state.joint_offset, symmetry="joints"),
        term(name="push_vel", function=push_vel, symmetry="vector"),
        term(name="foot_force", function=foot_force, scale=1 / weight, symmetry="feet"),
    )


def compute_observations(
    group: Sequence[ObservationTerm],
    state: State,
    clip: float,
    rng: np.random.Generator | None = None,
) -> FloatArray:
    """Return the observations of a group, shape (n, width), with noise from `rng` if given."""
    values = [term.function(state) for term in group]
    widths = tuple(value.shape[1] for value in values)
    observations = np.concatenate(values, axis=1, dtype=np.float32)
    noise = _per_number(tuple(term.noise for term in group), widths)
    if rng is not None and noise.any():
        noisy = np.flatnonzero(noise)
        start, stop = noisy[0], noisy[-1] + 1  # one block is faster than single columns
        sample = rng.random((len(observations), stop - start), dtype=np.float32)
        observations[:, start:stop] += (2 * sample - 1) * noise[start:stop]
    observations *= _per_number(tuple(term.scale for term in group), widths)
    return np.clip(observations, -clip, clip, out=observations)


@lru_cache(maxsize=64)
def _per_number(
    values: tuple[tuple[float, ...] | float, ...], widths: tuple[int, ...]
) -> FloatArray:
    """Repeat the value of each term over its width; read-only, because it is cached."""
    parts = [np.broadcast_to(value, width) for value, width in zip(values, widths, strict=True)]
    array = np.concatenate(parts).astype(np.float32)
    array.flags.writeable = False
    return array

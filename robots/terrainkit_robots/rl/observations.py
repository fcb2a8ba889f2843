"""Observations: groups of terms, each with its scale, noise and mirror symmetry.

The policy group is what a real robot can measure, with noise. The privileged group has the same
terms without noise, and terms that only a simulation has. Exported policies use this order.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from terrainkit_robots.rl.config import Task
from terrainkit_robots.rl.state import State
from terrainkit_robots.spec.robot import Robot
from terrainkit_robots.transforms import FloatArray, quat_rotate_inverse

HEIGHT_SCAN_OFFSET = 0.5
"""Base height above the ground that is observed as 0 [m], as in legged_gym."""


Symmetry = Literal[
    "scalar",
    "vector",
    "axial",
    "command",
    "joints",
    "actions",
    "feet",
    "contacts",
    "scan",
    "phase",
    "history",
]


@dataclass(frozen=True)
class ObservationTerm:
    """One term of an observation group."""

    name: str  # in logs and exports
    function: Callable[[State], FloatArray]  # computes the term, shape (n, width)
    symmetry: Symmetry = "scalar"  # how it transforms when left and right are swapped
    scale: tuple[float, ...] | float = 1.0  # scale factor, or one per number
    noise: float = 0.0  # half range of the uniform noise, added before scaling


ObsTerms = Mapping[str, Sequence[ObservationTerm]]
"""The terms of each observation group by its name."""


def uses_height_scan(task: Task, *, is_plane: bool) -> bool:
    """Return whether the policy has a height scan; the default is True except on flat ground."""
    setting = task.terrain.measure_heights
    return not is_plane if setting is None else setting


def observes_lin_vel(robot: Robot, task: Task) -> bool:
    """Return whether the policy observes its linear velocity; the default is True on two legs."""
    setting = task.observations.base_lin_vel
    return len(robot.spec.feet) == 2 if setting is None else setting


def policy_group(robot: Robot, task: Task, *, scan: bool) -> tuple[ObservationTerm, ...]:
    """Return the policy's terms: 47 numbers for a quadruped; a height scan adds 187."""
    term, scales = ObservationTerm, task.normalization.obs_scales
    noise = {key: task.noise.noise_level * value for key, value in vars(task.noise).items()}
    command_scale = (scales.lin_vel, scales.lin_vel, scales.ang_vel)
    # The angle of a wheel grows without bound and carries no information.
    dof_pos_scale = tuple(np.where(robot.wheels, 0.0, scales.dof_pos).tolist())

    def dof_pos(state: State) -> FloatArray:
        return state.dof_pos + state.joint_offset - robot.default_pose

    def height_scan(state: State) -> FloatArray:
        # Clipped at 1 m, as in legged_gym.
        return np.clip(state.height_scan - np.float32(HEIGHT_SCAN_OFFSET), -1, 1)

    group: tuple[ObservationTerm, ...] = (
        term("commands", lambda s: s.commands, "command", command_scale),
        term("projected_gravity", lambda s: s.projected_gravity, "vector", 1.0, noise["gravity"]),
        term("base_ang_vel", lambda s: s.base_ang_vel, "axial", scales.ang_vel, noise["ang_vel"]),
        term("dof_pos", dof_pos, "joints", dof_pos_scale, noise["dof_pos"]),
        term("dof_vel", lambda s: s.dof_vel, "joints", scales.dof_vel, noise["dof_vel"]),
        term("actions", lambda s: s.actions, "actions"),
    )
    if task.commands.gait_period != 0:
        group += (term("gait_phase", lambda s: s.gait_phase, "phase"),)
    if observes_lin_vel(robot, task):
        scale, uniform = scales.lin_vel, noise["lin_vel"]
        group += (term("base_lin_vel", lambda s: s.base_lin_vel, "vector", scale, uniform),)
    if task.observations.foot_contact:
        group += (term("foot_contact", lambda s: s.foot_contact.astype("f4"), "contacts"),)
    if task.observations.history_length > 1:
        group += (term("history", lambda s: s.history, "history"),)
    scan_scale, scan_noise = scales.height_measurements, noise["height_measurements"]
    scan_term = term("height_scan", height_scan, "scan", scan_scale, scan_noise)
    return (*group, scan_term) if scan else group


def history_width(robot: Robot, task: Task, num_actions: int) -> int:
    """Return the size of the history: the previous observations, without the height scan."""
    widths = {"command": 3, "vector": 3, "axial": 3, "phase": 2, "actions": num_actions}
    widths |= {"joints": len(robot.default_pose), "contacts": len(robot.spec.feet), "history": 0}
    total = sum(widths[term.symmetry] for term in policy_group(robot, task, scan=False))
    return (task.observations.history_length - 1) * total


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

    term, lin_vel_scale = ObservationTerm, task.normalization.obs_scales.lin_vel
    of_policy = policy_group(robot, task, scan=scan)
    known = "base_lin_vel", "history"  # the former is below
    return (
        *(replace(each, noise=0.0) for each in of_policy if each.name not in known),
        term("base_lin_vel", lambda s: s.base_lin_vel, "vector", lin_vel_scale),
        term("mean_vel", lambda s: s.mean_vel, "command"),
        term("friction", lambda s: s.friction),
        term("added_mass", lambda s: s.added_mass),
        term("com_shift", lambda s: s.com_shift, "vector", 10),
        term("joint_offset", lambda s: s.joint_offset, "joints"),
        term("push_vel", push_vel, "vector"),
        term("foot_force", foot_force, "feet", 1 / weight),
    )


def compute_observations(
    group: Sequence[ObservationTerm],
    state: State,
    clip: float,
    rng: np.random.Generator | None = None,
) -> FloatArray:
    """Return the observations of a group.

    Args:
        group: Terms of the group.
        state: State of n robots.
        clip: Largest magnitude of an observation.
        rng: Generator of the noise; None for no noise.

    Returns:
        Observations, shape (n, width).
    """
    values = [term.function(state) for term in group]
    widths = [value.shape[1] for value in values]
    observations = np.concatenate(values, axis=1, dtype=np.float32)
    noise = np.repeat([term.noise for term in group], widths).astype(np.float32)
    if rng is not None and noise.any():
        noisy = np.flatnonzero(noise)
        start, stop = noisy[0], noisy[-1] + 1  # one block is faster than single columns
        sample = rng.random((len(observations), stop - start), dtype=np.float32)
        observations[:, start:stop] += (2 * sample - 1) * noise[start:stop]
    scales = [np.broadcast_to(term.scale, width) for term, width in zip(group, widths, strict=True)]
    observations *= np.concatenate(scales, dtype=np.float32)
    return np.clip(observations, -clip, clip, out=observations)

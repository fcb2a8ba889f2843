"""The observations: each with its scale, its noise and its mirror image, in one table.

The policy's group is what a real robot can measure, with noise; the privileged group is the same
without noise, and what only a simulation knows. The order is that of the exported policies.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.rl.robot import Robot
from terrainkit_robots.rl.rotation import to_body
from terrainkit_robots.rl.state import State
from terrainkit_robots.rl.task import Task, Terrain

FloatArray = NDArray[np.float32]

Image = Literal["number", "vector", "turn", "command", "joints", "feet", "scan"]
"""What becomes of an observation in a mirror that swaps left and right; see :mod:`.symmetry`."""

_SCAN_OFFSET = 0.5
"""Height of the base above the ground that is observed as 0 [m]: legged_gym's."""


@dataclass(frozen=True, kw_only=True)
class Observation:
    """A part of what is observed."""

    name: str
    """What it is called in logs and exports."""

    read: Callable[[State], FloatArray]
    """What it is in a state, shape (n, width)."""

    scale: tuple[float, ...] | float = 1.0
    """Factor, or one for each number."""

    noise: float = 0.0
    """Uniform noise, to either side, before the scale."""

    image: Image = "number"
    """What a mirror makes of it."""


def sees_heights(settings: Terrain, *, level: bool) -> bool:
    """Return whether the policy has a height scan: unless given, on any ground but a level one."""
    given = settings.measure_heights
    return not level if given is None else given


def policy_group(robot: Robot, task: Task, *, scan: bool) -> tuple[Observation, ...]:
    """Return what the policy observes: 45 numbers for 12 joints, and a scan of 187 heights."""
    scales, noise = task.normalization.obs_scales, task.noise
    level = noise.noise_level
    group = (
        Observation(
            name="commands",
            read=lambda state: state.commands,
            scale=(scales.lin_vel, scales.lin_vel, scales.ang_vel),
            image="command",
        ),
        Observation(
            name="projected_gravity",
            read=lambda state: state.projected_gravity,
            noise=level * noise.gravity,
            image="vector",
        ),
        Observation(
            name="base_ang_vel",
            read=lambda state: state.base_ang_vel,
            scale=scales.ang_vel,
            noise=level * noise.ang_vel,
            image="turn",
        ),
        Observation(
            name="dof_pos",
            read=lambda state: state.dof_pos + state.joint_offset - robot.default_pose,
            # How far a wheel has turned since it was built says nothing, and grows without end.
            scale=tuple(np.where(robot.wheels, 0.0, scales.dof_pos).tolist()),
            noise=level * noise.dof_pos,
            image="joints",
        ),
        Observation(
            name="dof_vel",
            read=lambda state: state.dof_vel,
            scale=scales.dof_vel,
            noise=level * noise.dof_vel,
            image="joints",
        ),
        Observation(name="actions", read=lambda state: state.actions, image="joints"),
    )
    if not scan:
        return group
    heights = Observation(
        name="height_scan",
        read=lambda state: np.clip(state.height_scan - np.float32(_SCAN_OFFSET), -1, 1),
        scale=scales.height_measurements,
        noise=level * noise.height_measurements,
        image="scan",
    )
    return (*group, heights)


def privileged_group(
    robot: Robot, task: Task, *, scan: bool, weight: float
) -> tuple[Observation, ...]:
    """Return what the critic observes: the policy's group without noise, and the unknowable.

    Args:
        robot: The robot.
        task: Its task.
        scan: Whether there is a height scan.
        weight: Weight of the robot, the unit of forces [N].
    """
    known = [replace(each, noise=0.0) for each in policy_group(robot, task, scan=scan)]
    return (
        *known,
        Observation(
            name="base_lin_vel",
            read=lambda state: state.base_lin_vel,
            scale=task.normalization.obs_scales.lin_vel,
            image="vector",
        ),
        Observation(name="friction", read=lambda state: state.friction),
        Observation(name="added_mass", read=lambda state: state.added_mass),
        Observation(
            name="com_shift", read=lambda state: state.com_shift, scale=10.0, image="vector"
        ),
        Observation(name="joint_offset", read=lambda state: state.joint_offset, image="joints"),
        Observation(
            name="push_vel",
            read=lambda state: to_body(state.base_quat, state.push_vel),
            image="vector",
        ),
        Observation(name="foot_force", read=_foot_force, scale=1 / weight, image="feet"),
    )


def _foot_force(state: State) -> FloatArray:
    """Return the forces on the feet in the base's frame [N], shape (n, 3 f)."""
    n, feet, _ = state.foot_force.shape
    quat = np.repeat(state.base_quat, feet, axis=0)
    return to_body(quat, state.foot_force.reshape(-1, 3)).reshape(n, -1)


def observe(
    group: Sequence[Observation],
    state: State,
    clip: float,
    rng: np.random.Generator | None = None,
) -> FloatArray:
    """Return what a group observes in a state, shape (n, width of the group).

    Args:
        group: The observations, in their order.
        state: The state.
        clip: Largest number.
        rng: Where noise is drawn from; None for none.
    """
    values = [each.read(state) for each in group]
    widths = tuple(value.shape[1] for value in values)
    observed = np.concatenate(values, axis=1, dtype=np.float32)
    noise = _by_number(tuple(each.noise for each in group), widths)
    if rng is not None and noise.any():
        noisy = np.flatnonzero(noise)
        start, stop = noisy[0], noisy[-1] + 1  # one block, for speed
        drawn = rng.random((len(observed), stop - start), dtype=np.float32)
        observed[:, start:stop] += (2 * drawn - 1) * noise[start:stop]
    observed *= _by_number(tuple(each.scale for each in group), widths)
    return np.clip(observed, -clip, clip, out=observed)


@lru_cache(maxsize=64)  # the same in every step
def _by_number(
    values: tuple[tuple[float, ...] | float, ...], widths: tuple[int, ...]
) -> FloatArray:
    """Return the value for each number of a group; not to be written to."""
    parts = [np.broadcast_to(value, width) for value, width in zip(values, widths, strict=True)]
    found = np.concatenate(parts).astype(np.float32)
    found.flags.writeable = False
    return found

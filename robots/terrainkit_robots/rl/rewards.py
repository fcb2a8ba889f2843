"""The rewards: one function each, named as its scale in :class:`~.task.Rewards`.

Each takes the state of n robots and returns n numbers, before scale and time step. They are those
of legged_gym (Rudin et al., Learning to Walk in Minutes, 2021) with its faults repaired: the height
is that above the ground, air time pays only where walking is asked for and counts contacts once.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.rl.robot import Robot
from terrainkit_robots.rl.state import State
from terrainkit_robots.rl.task import Rewards

FloatArray = NDArray[np.float32]


_TURNING = 0.1
"""Turning speed from which robots are asked to move [rad/s]: a heading is never reached to the last
digit, and asks for less and less."""

Reward = Callable[[State, Robot, Rewards], FloatArray]

REWARDS: dict[str, Reward] = {}
"""Every reward by name; `@reward` adds one."""


def reward(function: Reward) -> Reward:
    """Make a function a reward, whose scale is the field of its name in the task's `rewards`."""
    REWARDS[function.__name__] = function
    return function


def chosen(settings: Rewards) -> dict[str, tuple[Reward, float]]:
    """Return each reward whose scale is not 0, with that scale."""
    scales = {name: float(getattr(settings, name, 0.0)) for name in REWARDS}
    return {name: (REWARDS[name], scale) for name, scale in scales.items() if scale}


def _squared(values: FloatArray) -> FloatArray:
    """Return the sum of squares of each row."""
    return np.einsum("ij,ij->i", values, values)


def _off(height: FloatArray, target: float) -> FloatArray:
    """Return how far heights are from their target [m]; above a hole, no farther than the ground.

    Without that bound a foot that swings over a pit of 10 m costs more than all else is worth. A
    target of 0 has none: nothing costs less than the ground there.
    """
    most = 2 * target if target > 0 else np.inf
    return np.minimum(height, np.float32(most)) - np.float32(target)


def _asked(state: State) -> NDArray[np.bool_]:
    """Return who is asked to move, shape (n,)."""
    moves = (state.commands[:, :2] != 0).any(axis=1)
    return moves | (np.abs(state.commands[:, 2]) >= _TURNING)


@reward
def tracking_lin_vel(state: State, robot: Robot, settings: Rewards) -> FloatArray:
    """Return 1 for moving just as asked, less the farther off."""
    off = _squared(state.commands[:, :2] - state.base_lin_vel[:, :2])
    return np.exp(-off / settings.tracking_sigma)


@reward
def tracking_ang_vel(state: State, robot: Robot, settings: Rewards) -> FloatArray:
    """Return 1 for turning just as asked, less the farther off."""
    off = np.square(state.commands[:, 2] - state.base_ang_vel[:, 2])
    return np.exp(-off / settings.tracking_sigma)


@reward
def lin_vel_z(state: State, robot: Robot, settings: Rewards) -> FloatArray:
    """Return the vertical speed, squared [m2/s2]."""
    return np.square(state.base_lin_vel[:, 2])


@reward
def ang_vel_xy(state: State, robot: Robot, settings: Rewards) -> FloatArray:
    """Return the speed of roll and pitch, squared [rad2/s2]."""
    return _squared(state.base_ang_vel[:, :2])


@reward
def orientation(state: State, robot: Robot, settings: Rewards) -> FloatArray:
    """Return the squared sine of the tilt."""
    return _squared(state.projected_gravity[:, :2])


@reward
def base_height(state: State, robot: Robot, settings: Rewards) -> FloatArray:
    """Return how far the base is from its target height, squared [m2]."""
    target = settings.base_height_target
    if target is None:
        target = robot.spec.base_height_target
    return np.square(_off(state.base_height, target or 0.0))


@reward
def torques(state: State, robot: Robot, settings: Rewards) -> FloatArray:
    """Return the torques, squared [N2 m2]."""
    return _squared(state.torques)


@reward
def dof_power(state: State, robot: Robot, settings: Rewards) -> FloatArray:
    """Return the mechanical power of all joints, braking included [W]."""
    return np.abs(state.torques * state.dof_vel).sum(axis=1)


@reward
def dof_vel(state: State, robot: Robot, settings: Rewards) -> FloatArray:
    """Return the speeds of the joints, squared [rad2/s2]."""
    return _squared(state.dof_vel)


@reward
def dof_acc(state: State, robot: Robot, settings: Rewards) -> FloatArray:
    """Return the accelerations of the joints, squared [rad2/s4]."""
    return _squared(state.dof_acc)


@reward
def action_rate(state: State, robot: Robot, settings: Rewards) -> FloatArray:
    """Return the change of the action, squared."""
    return _squared(state.actions - state.last_actions)


@reward
def action_smoothness(state: State, robot: Robot, settings: Rewards) -> FloatArray:
    """Return the change of the change of the action, squared."""
    return _squared(state.actions - 2 * state.last_actions + state.last_last_actions)


@reward
def collision(state: State, robot: Robot, settings: Rewards) -> FloatArray:
    """Return how many penalized bodies touch something."""
    return (state.penalized_force > np.float32(0.1)).sum(axis=1, dtype=np.float32)


@reward
def termination(state: State, robot: Robot, settings: Rewards) -> FloatArray:
    """Return 1 for a fall."""
    return state.fallen.astype(np.float32)


@reward
def dof_pos_limits(state: State, robot: Robot, settings: Rewards) -> FloatArray:
    """Return how far the joints are beyond their soft limits, in all [rad]."""
    below = np.maximum(robot.lower - state.dof_pos, 0)
    above = np.maximum(state.dof_pos - robot.upper, 0)
    return (below + above).sum(axis=1)


@reward
def dof_vel_limits(state: State, robot: Robot, settings: Rewards) -> FloatArray:
    """Return how far the speeds are beyond the soft limit, each at most 1 rad/s [rad/s]."""
    over = np.abs(state.dof_vel) - robot.velocity * np.float32(settings.soft_dof_vel_limit)
    return np.clip(over, 0, 1).sum(axis=1)


@reward
def torque_limits(state: State, robot: Robot, settings: Rewards) -> FloatArray:
    """Return how far the torques are beyond the soft limit, in all [N m]."""
    over = np.abs(state.torques) - robot.effort * np.float32(settings.soft_torque_limit)
    return np.maximum(over, 0).sum(axis=1)


@reward
def feet_air_time(state: State, robot: Robot, settings: Rewards) -> FloatArray:
    """Return the air time beyond its target of feet that come down, where asked to move [s]."""
    over = (state.air_time - np.float32(settings.air_time_target)) * state.first_contact
    return over.sum(axis=1) * _asked(state)


@reward
def foot_clearance(state: State, robot: Robot, settings: Rewards) -> FloatArray:
    """Return how far feet are from their target height, squared, by their speed [m3/s]."""
    off = np.square(_off(state.foot_height, settings.foot_clearance_target))
    speed = np.hypot(state.foot_vel[..., 0], state.foot_vel[..., 1])
    return (off * speed).sum(axis=1)


@reward
def stumble(state: State, robot: Robot, settings: Rewards) -> FloatArray:
    """Return 1 where a foot is pushed sideways five times as hard as upwards."""
    sideways = np.hypot(state.foot_force[..., 0], state.foot_force[..., 1])
    hit = sideways > 5 * np.abs(state.foot_force[..., 2])
    return np.asarray(hit.any(axis=1), np.float32)


@reward
def stand_still(state: State, robot: Robot, settings: Rewards) -> FloatArray:
    """Return how far joints, but wheels, are from the default pose where asked to stand [rad]."""
    off = np.abs(state.dof_pos - robot.default_pose) * ~robot.wheels
    return off.sum(axis=1) * ~_asked(state)


@reward
def feet_contact_forces(state: State, robot: Robot, settings: Rewards) -> FloatArray:
    """Return how far forces on feet are beyond what is free of cost, in all [N]."""
    force = np.sqrt(np.einsum("nfi,nfi->nf", state.foot_force, state.foot_force))
    return np.maximum(force - np.float32(settings.max_contact_force), 0).sum(axis=1)

"""Reward terms, mostly those of legged_gym (Rudin et al., Learning to Walk in Minutes, 2021).

Each takes the state of n robots and returns n numbers, before the scale and the time step.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.rl.config import Rewards
from terrainkit_robots.rl.state import State
from terrainkit_robots.spec.robot import Robot
from terrainkit_robots.transforms import FloatArray

MIN_YAW_RATE = 0.1
"""Yaw rate from which a command counts as moving [rad/s]: heading control never reaches 0."""

Reward = Callable[[State, Robot, Rewards], FloatArray]

REWARDS: dict[str, Reward] = {}
"""Every reward term by name."""


def reward(function: Reward) -> Reward:
    """Register a reward term; its scale is the field of the same name in the task's `rewards`."""
    REWARDS[function.__name__] = function
    return function


def active_rewards(cfg: Rewards) -> dict[str, tuple[Reward, float]]:
    """Return each term with a scale other than 0, and that scale."""
    scales = {name: float(getattr(cfg, name, 0.0)) for name in REWARDS}
    return {name: (REWARDS[name], scale) for name, scale in scales.items() if scale}


def _sum_squares(values: FloatArray) -> FloatArray:
    return np.einsum("ij,ij->i", values, values)


def _height_error(height: FloatArray, target: float) -> FloatArray:
    """Return height minus target, at most `target`: over a deep pit the error stays bounded."""
    limit = 2 * target if target > 0 else np.inf
    return np.minimum(height, np.float32(limit)) - np.float32(target)


def _is_moving(state: State) -> NDArray[np.bool_]:
    """Return which commands ask to move, shape (n,)."""
    linear = (state.commands[:, :2] != 0).any(axis=1)
    return linear | (np.abs(state.commands[:, 2]) >= MIN_YAW_RATE)


@reward
def tracking_lin_vel(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Reward tracking of the linear velocity command, 0 to 1."""
    error = _sum_squares(state.commands[:, :2] - state.base_lin_vel[:, :2])
    return np.exp(-error / cfg.tracking_sigma)


@reward
def tracking_ang_vel(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Reward tracking of the yaw rate command, 0 to 1."""
    error = np.square(state.commands[:, 2] - state.base_ang_vel[:, 2])
    return np.exp(-error / cfg.tracking_sigma)


@reward
def lin_vel_z(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Penalize vertical velocity, squared [m2/s2]."""
    return np.square(state.base_lin_vel[:, 2])


@reward
def ang_vel_xy(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Penalize roll and pitch rates, squared [rad2/s2]."""
    return _sum_squares(state.base_ang_vel[:, :2])


@reward
def orientation(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Penalize a tilted base by the squared sine of the tilt."""
    return _sum_squares(state.projected_gravity[:, :2])


@reward
def base_height(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Penalize a base above or below its target height, squared [m2]."""
    default = robot.spec.base_height_target or 0.0
    target = default if cfg.base_height_target is None else cfg.base_height_target
    return np.square(_height_error(state.base_height, target))


@reward
def torques(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Penalize torques, squared [N2 m2]."""
    return _sum_squares(state.torques)


@reward
def dof_power(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Penalize the absolute mechanical power of the joints [W]."""
    return np.abs(state.torques * state.dof_vel).sum(axis=1)


@reward
def dof_vel(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Penalize joint velocities, squared [rad2/s2]."""
    return _sum_squares(state.dof_vel)


@reward
def dof_acc(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Penalize joint accelerations, squared [rad2/s4]."""
    return _sum_squares(state.dof_acc)


@reward
def action_rate(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Penalize changes of the action, squared."""
    return _sum_squares(state.actions - state.last_actions)


@reward
def action_smoothness(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Penalize second differences of the action, squared."""
    return _sum_squares(state.actions - 2 * state.last_actions + state.last_last_actions)


@reward
def collision(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Count penalized bodies that touch something."""
    return (state.penalized_force > np.float32(0.1)).sum(axis=1, dtype=np.float32)


@reward
def termination(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Penalize a fall."""
    return state.fallen.astype(np.float32)


@reward
def dof_pos_limits(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Penalize joint positions beyond their soft limits [rad]."""
    return np.abs(state.dof_pos - np.clip(state.dof_pos, robot.lower, robot.upper)).sum(axis=1)


@reward
def dof_vel_limits(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Penalize joint velocities beyond their soft limits, at most 1 rad/s each [rad/s]."""
    excess = np.abs(state.dof_vel) - robot.velocity * np.float32(cfg.soft_dof_vel_limit)
    return np.clip(excess, 0, 1).sum(axis=1)


@reward
def torque_limits(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Penalize torques beyond their soft limits [N m]."""
    excess = np.abs(state.torques) - robot.effort * np.float32(cfg.soft_torque_limit)
    return np.maximum(excess, 0).sum(axis=1)


@reward
def feet_air_time(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Reward air time above the target at first contact, when commanded to move [s]."""
    excess = (state.air_time - np.float32(cfg.air_time_target)) * state.first_contact
    return excess.sum(axis=1) * _is_moving(state)


@reward
def foot_clearance(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Penalize the squared height error of feet, weighted by their horizontal speed [m3/s]."""
    error = np.square(_height_error(state.foot_height, cfg.foot_clearance_target))
    speed = np.hypot(state.foot_vel[..., 0], state.foot_vel[..., 1])
    return (error * speed).sum(axis=1)


@reward
def stumble(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Penalize a foot whose horizontal force exceeds five times its vertical force."""
    horizontal = np.hypot(state.foot_force[..., 0], state.foot_force[..., 1])
    hit = horizontal > 5 * np.abs(state.foot_force[..., 2])
    return np.asarray(hit.any(axis=1), np.float32)


@reward
def stand_still(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Penalize leaving the default pose when commanded to stand, except for wheels [rad]."""
    error = np.abs(state.dof_pos - robot.default_pose) * ~robot.wheels
    return error.sum(axis=1) * ~_is_moving(state)


@reward
def feet_contact_forces(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Penalize contact forces of feet above the limit [N]."""
    force = np.sqrt(np.square(state.foot_force).sum(axis=2))
    return np.maximum(force - np.float32(cfg.max_contact_force), 0).sum(axis=1)

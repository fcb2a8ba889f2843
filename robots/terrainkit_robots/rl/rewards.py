"""Reward terms of legged_gym (Rudin et al., Learning to Walk in Minutes, 2021), and of a gait.

Each takes the environment and returns a number per robot, before the scale and the time step. Its
scale is the field of the same name in the task's `rewards`. Scales are dimensionless: they fit
robots of any size, since a term is divided by its unit in `UNITS`. The gait follows Siekmann et
al., Sim-to-Real Learning of All Common Bipedal Gaits via Periodic Reward Composition, 2021: each
foot has a phase, in which it should be in the air or on the ground.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit_robots.rl.config import Rewards
from terrainkit_robots.rl.own_terms import checked
from terrainkit_robots.transforms import FloatArray

if TYPE_CHECKING:
    from terrainkit_robots.rl.env import LeggedEnv

MIN_YAW_RATE = 0.1
"""Yaw rate from which a command counts as moving [rad/s]: heading control never reaches 0."""

# With a constant kernel width of 0.25 m2/s2, it was 64 % for the biped's commands.
STANDING_TRACKING = 0.25
"""Value of the wide tracking kernel for a robot that stands, at any command."""

# An error of a tenth of the command costs 1 % of the wide kernel and 10 % of the narrow one. With
# the wide one alone, policies kept errors of 0.1 m/s, and stood before risers for its 25 %.
NARROW = 8.0
"""Width of the wide tracking kernel relative to the narrow one."""

SWING_HEIGHT = 0.18
"""Default height of a swinging foot, as a fraction of the leg length."""

# The bundled quadruped, with legs of 0.448 m, gets 8 cm from `SWING_HEIGHT`.
MAX_SWING_HEIGHT = 0.09
"""Largest default height of a swinging foot on four legs [m]: flat ground needs no more."""

# 0.01 is a tilt of 5.7 degrees.
LEVEL_SIN2 = 0.01
"""Squared sine of the tilt at which `upright` is exp(-1)."""

MIN_AIR_TIME = 0.5
"""Duration of a swing that `feet_air_time` neither rewards nor penalizes [s], as in legged_gym."""

LANDING = 0.6
"""Fraction of the swing from which a foot descends to its foothold."""

CLEARANCE_SIGMA = 0.01
"""Squared error times velocity at which `foot_clearance` is exp(-1) [m3/s]; of LeggedGym-Ex."""

STUMBLE = 5.0
"""Horizontal force on a foot that stumbles, in units of the vertical one, as in legged_gym."""

UNITS = {
    "base_height": (0, 2, 0),
    "lin_vel_z": (0, 2, -2),
    "ang_vel_xy": (0, 0, -2),
    "foot_slip": (0, 2, -2),
    "torques": (2, 4, -4),
    "torque_limits": (1, 2, -2),
    "dof_acc": (0, 0, -4),
    "dof_vel": (0, 0, -2),
    "dof_power": (1, 2, -3),
    "feet_air_time": (0, 0, 1),
}
"""Powers of the robot's mass, its leg length, and sqrt(leg length / g), by term."""

Reward = Callable[["LeggedEnv"], FloatArray]


def reward_scales(rewards: Rewards, mass: float, leg_length: float) -> dict[str, float]:
    """Return the scale in SI units of each term whose scale is not 0.

    Args:
        rewards: Scales and parameters of the rewards.
        mass: Mass of the robot [kg].
        leg_length: Length of a leg [m].
    """
    # Froude scaling: robots of different sizes that move alike have equal rewards in these units.
    time = np.sqrt(leg_length / 9.81)
    units = {k: mass**a * leg_length**b * time**c for k, (a, b, c) in UNITS.items()}
    if rewards.units == "SI":
        units = {}
    scales = {k: scale for k, scale in vars(rewards).items() if scale and k != "units"}
    return {k: scale / units.get(k, 1.0) for k, scale in scales.items()}


def _sum_squares(values: FloatArray) -> FloatArray:
    return np.einsum("ij,ij->i", values, values)


def is_moving(commands: FloatArray) -> NDArray[np.bool_]:
    """Return which commands are not a command to stand still.

    Args:
        commands: Forward and left velocity [m/s] and yaw rate [rad/s], shape (n, 3).

    Returns:
        Mask, shape (n,).
    """
    return (commands[:, :2] != 0).any(axis=1) | (np.abs(commands[:, 2]) >= MIN_YAW_RATE)


def _tracking(env: "LeggedEnv") -> tuple[FloatArray, FloatArray]:
    """Return how well linear and yaw velocity are tracked, 0 to 1.

    On two legs, velocities are averaged over the gait: the sway is larger than small commands.
    The reward is the mean of a wide kernel, which pays for any progress, and a narrow one. Their
    widths are proportional to the command. Where only one of the two velocities is commanded, or
    only a small yaw rate beside a linear velocity, the reward of the other one is multiplied by
    the tracking of the commanded velocity, so that standing still does not earn it.
    """
    commands = env.state.commands
    squared = np.square(commands - env.state.mean_vel)
    errors = squared[:, :2].sum(axis=1), squared[:, 2]
    squares = _sum_squares(commands[:, :2]), np.square(commands[:, 2])
    # A robot that stands still has the squared error s, the squared command. With a width of
    # -s / log(0.25), its wide kernel exp(-s / width) is 0.25 for any command.
    log_standing = np.float32(np.log(STANDING_TRACKING))
    width_at_rest = np.float32(env.cfg.rewards.tracking_sigma)
    widths = [np.where(s > 0, -s / log_standing, width_at_rest) for s in squares]
    # A heading command ends in yaw rates near 0. Their kernels would be narrower than any sway.
    turns_little = (squares[0] > 0) & (widths[1] <= width_at_rest)
    widths[1][turns_little] = width_at_rest
    ratios = (error / width for error, width in zip(errors, widths, strict=True))
    lin, yaw = ((np.exp(-ratio) + np.exp(-NARROW * ratio)) / 2 for ratio in ratios)
    only_yaw = is_moving(commands) & (squares[0] == 0)
    lin, yaw = lin * np.where(only_yaw, yaw, 1), yaw * np.where(turns_little, lin, 1)
    if env.cfg.rewards.tracking_in_gait:
        in_gait = (env.state.foot_contact == (env.state.swing_phase == 0)).all(axis=1)
        return lin * in_gait, yaw * in_gait
    return lin, yaw


def tracking_lin_vel(env: "LeggedEnv") -> FloatArray:
    """Reward tracking of the linear velocity command, 0 to 1."""
    return _tracking(env)[0]


def tracking_ang_vel(env: "LeggedEnv") -> FloatArray:
    """Reward tracking of the yaw rate command, 0 to 1."""
    return _tracking(env)[1]


def progress(env: "LeggedEnv") -> FloatArray:
    """Reward velocity along the command, as a fraction of it, -1 to 1; the mean of both parts."""
    products = env.state.mean_vel * env.state.commands, np.square(env.state.commands)
    along, squares = (np.array([p[:, :2].sum(axis=1), p[:, 2]]) for p in products)
    fractions = along / np.where(squares > 0, squares, np.inf)
    total = np.clip(fractions, -1, 1).sum(axis=0) / np.maximum((squares > 0).sum(axis=0), 1)
    return total.astype(np.float32)


def upright(env: "LeggedEnv") -> FloatArray:
    """Reward a level base, 0 to 1."""
    return np.exp(-_sum_squares(env.state.projected_gravity[:, :2]) / np.float32(LEVEL_SIN2))


def lin_vel_z(env: "LeggedEnv") -> FloatArray:
    """Penalize vertical velocity, squared [m2/s2]."""
    return np.square(env.state.base_lin_vel[:, 2])


def ang_vel_xy(env: "LeggedEnv") -> FloatArray:
    """Penalize roll and pitch rates, squared [rad2/s2]."""
    return _sum_squares(env.state.base_ang_vel[:, :2])


def base_height(env: "LeggedEnv") -> FloatArray:
    """Penalize a base off its target height, squared; bounded over a pit [m2]."""
    target = np.float32(env.robot.base_height_target)
    # Over a deep hole, an unbounded penalty outweighed all rewards of the episode.
    return np.square(np.minimum(env.state.base_height, 2 * target) - target)


def torques(env: "LeggedEnv") -> FloatArray:
    """Penalize torques, squared [N2 m2]."""
    return _sum_squares(env.state.torques)


def dof_acc(env: "LeggedEnv") -> FloatArray:
    """Penalize joint accelerations, mean square [rad2/s4]."""
    return np.square(env.state.dof_acc).mean(axis=1)


def action_rate(env: "LeggedEnv") -> FloatArray:
    """Penalize changes of the action, mean square."""
    return np.square(env.state.actions - env.state.last_actions).mean(axis=1)


def action_l2(env: "LeggedEnv") -> FloatArray:
    """Penalize large actions, mean square."""
    return np.square(env.state.actions).mean(axis=1)


def collision(env: "LeggedEnv") -> FloatArray:
    """Penalize bodies that should not touch anything, by the number that do."""
    return (env.state.penalized_force > np.float32(0.1)).sum(axis=1, dtype=np.float32)


def termination(env: "LeggedEnv") -> FloatArray:
    """Penalize a fall."""
    return env.state.fallen.astype(np.float32)


def dof_pos_limits(env: "LeggedEnv") -> FloatArray:
    """Penalize joint positions beyond their soft limits [rad]."""
    return np.abs(
        env.state.dof_pos - np.clip(env.state.dof_pos, env.robot.lower, env.robot.upper)
    ).sum(axis=1)


def dof_vel_limits(env: "LeggedEnv") -> FloatArray:
    """Penalize joint velocities beyond their limits, at most 1 rad/s of each joint."""
    excess = np.abs(env.state.dof_vel) - env.robot.velocity
    return np.clip(excess, 0, 1).sum(axis=1)


def feet_gait(env: "LeggedEnv") -> FloatArray:
    """Reward the fraction of feet that are in contact exactly when the gait says so."""
    return (env.state.foot_contact == (env.state.swing_phase == 0)).mean(axis=1, dtype=np.float32)


def target_swing_height(env: "LeggedEnv") -> np.float32:
    """Return the height of a swinging foot above the ground [m]."""
    setting = env.cfg.rewards.swing_height
    feet = env.state.foot_height.shape[1]
    target = (setting or SWING_HEIGHT) * env.robot.leg_length
    return np.float32(min(target, MAX_SWING_HEIGHT) if setting is None and feet == 4 else target)


def foot_swing_height(env: "LeggedEnv") -> FloatArray:
    """Penalize feet off the arc that they should swing in, mean square, relative to its height.

    The arc is above the edge ahead of a foot: in front of a riser, the foot has to rise before it
    is above the step, and above a gap it does not have to descend.
    """
    phase = env.state.swing_phase
    height = env.state.foot_height_over_edges / target_swing_height(env)
    # Clipped for the same reason as the base height: a foot may be above or in a hole. With the
    # limit 0, a foot before a riser gained nothing by rising until it was above the step.
    return (np.square(np.clip(height, -1, 2) - np.sin(np.pi * phase)) * (phase > 0)).mean(axis=1)


def foothold(env: "LeggedEnv") -> FloatArray:
    """Penalize feet that stand or land in a hole or near an edge, by the share of lower ground.

    The ground is measured at five points within `NEAR_FOOT`, so that the penalty decreases before a
    foot is out of a hole. A point counts by its depth, up to the height of a swinging foot.
    """
    state = env.state
    depth = np.clip(state.foot_ground_depth / target_swing_height(env), 0, 1).mean(axis=2)
    lands = (state.swing_phase == 0) | (state.swing_phase > LANDING)
    return (depth * lands).mean(axis=1)


def foot_slip(env: "LeggedEnv") -> FloatArray:
    """Penalize the horizontal velocity of feet in contact, mean square [m2/s2]."""
    return (np.square(env.state.foot_vel[..., :2]).sum(axis=2) * env.state.foot_contact).mean(
        axis=1
    )


def stand_still(env: "LeggedEnv") -> FloatArray:
    """Penalize leaving the default pose when commanded to stand, except for wheels [rad]."""
    error = np.abs(env.state.dof_pos - env.robot.default_pose) * ~env.robot.wheels
    return error.mean(axis=1) * ~is_moving(env.state.commands)


def orientation(env: "LeggedEnv") -> FloatArray:
    """Penalize a tilted base: squared sine of the tilt."""
    return _sum_squares(env.state.projected_gravity[:, :2])


def dof_vel(env: "LeggedEnv") -> FloatArray:
    """Penalize joint velocities, squared [rad2/s2]."""
    return _sum_squares(env.state.dof_vel)


def dof_power(env: "LeggedEnv") -> FloatArray:
    """Penalize the mechanical power of the motors, also while they brake [W]."""
    return np.abs(env.state.torques * env.state.dof_vel).sum(axis=1)


def action_smoothness(env: "LeggedEnv") -> FloatArray:
    """Penalize changes of the change of the action, squared."""
    state = env.state
    return _sum_squares(state.actions - 2 * state.last_actions + state.last_last_actions)


def feet_air_time(env: "LeggedEnv") -> FloatArray:
    """Reward long swings, when the foot touches the ground after them [s]."""
    state = env.state
    landed = state.foot_contact & (state.foot_air_time > 0)
    excess = ((state.foot_air_time - np.float32(MIN_AIR_TIME)) * landed).sum(axis=1)
    return excess * (state.commands[:, :2] != 0).any(axis=1)


def foot_clearance(env: "LeggedEnv") -> FloatArray:
    """Reward feet that move at the swing height, 0 to 1, as in LeggedGym-Ex."""
    error = np.square(env.state.foot_height - target_swing_height(env))
    speed = np.linalg.norm(env.state.foot_vel[..., :2], axis=2)
    return np.exp(-(error * speed).sum(axis=1) / np.float32(CLEARANCE_SIGMA))


def hip_pos(env: "LeggedEnv") -> FloatArray:
    """Penalize hips that leave the default pose sideways or about the leg, squared [rad2]."""
    hips = env.scene.hip_joints
    return _sum_squares(env.state.dof_pos[:, hips] - env.robot.default_pose[hips])


def no_fly(env: "LeggedEnv") -> FloatArray:
    """Reward contact of exactly one foot: a walk on two legs, without jumps."""
    return (env.state.foot_contact.sum(axis=1) == 1).astype(np.float32)


def feet_stumble(env: "LeggedEnv") -> FloatArray:
    """Penalize a foot that hits something steep: more than 5 times as much force along x and y."""
    force = env.state.foot_force
    horizontal = np.linalg.norm(force[..., :2], axis=2)
    return (horizontal > STUMBLE * np.abs(force[..., 2])).any(axis=1).astype(np.float32)


def torque_limits(env: "LeggedEnv") -> FloatArray:
    """Penalize torques beyond their soft limits [N m]."""
    limits = np.float32(env.cfg.rewards.soft_torque_limit) * env.robot.effort
    return np.maximum(np.abs(env.state.torques) - limits, 0).sum(axis=1)


REWARDS: dict[str, Reward] = {
    name: term for name, term in globals().items() if name in Rewards.__dataclass_fields__
}
"""Every reward term of this module by name."""

TRACKING = tracking_lin_vel, tracking_ang_vel, progress, feet_gait, foot_swing_height, stand_still
"""Rewards that depend on velocity commands, or on the gait that they ask for."""


def scaled_rewards(env: "LeggedEnv") -> dict[str, tuple[Reward, float]]:
    """Return each reward term with a scale other than 0, and that scale in SI units.

    Without velocity commands, the terms of this module that depend on them are left out.

    Raises:
        ConfigError: If the task has no scale for a term.
    """
    terms, rewards = env.reward_terms(), env.cfg.rewards
    for name in terms.keys() - vars(rewards).keys():
        own = type(rewards).__name__
        raise ConfigError(f"reward {name}: {own} has no field {name}; expected its scale")
    if not env.has_velocity:
        terms = {name: function for name, function in terms.items() if function not in TRACKING}
    scales = reward_scales(rewards, env.mass, env.robot.leg_length)
    return {
        name: (checked("reward", name, function, (env.num_envs,)), scales[name])
        for name, function in terms.items()
        if name in scales
    }

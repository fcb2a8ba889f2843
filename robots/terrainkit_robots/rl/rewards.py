"""Reward terms of legged_gym (Rudin et al., Learning to Walk in Minutes, 2021), and of a gait.

Each takes the state of n robots and returns n numbers, before the scale and the time step. Scales
are dimensionless: they fit robots of any size, since a term is divided by its unit in `UNITS`. The
gait follows Siekmann et al., Sim-to-Real Learning of All Common Bipedal Gaits via Periodic Reward
Composition, 2021: each foot has a phase, in which it should be in the air or on the ground.
"""

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError, is_built_in, plugin_errors
from terrainkit_robots.rl.config import Rewards
from terrainkit_robots.rl.state import State
from terrainkit_robots.spec.robot import Robot
from terrainkit_robots.transforms import FloatArray

MIN_YAW_RATE = 0.1
"""Yaw rate from which a command counts as moving [rad/s]: heading control never reaches 0."""

# With a constant kernel width of 0.25 m2/s2, it was 64 % for the biped's commands.
STANDING_TRACKING = 0.25
"""Share of the tracking rewards that a robot earns by standing, at any command."""

SWING_HEIGHT = 0.18
"""Default height of a swinging foot, as a fraction of the leg length."""

# The bundled quadruped, with legs of 0.448 m, gets 8 cm from `SWING_HEIGHT`.
MAX_SWING_HEIGHT = 0.09
"""Largest default height of a swinging foot on four legs [m]: flat ground needs no more."""

# 0.01 is a tilt of 5.7 degrees.
LEVEL_SIN2 = 0.01
"""Squared sine of the tilt at which `upright` is exp(-1)."""

UNITS = {
    "base_height": (0, 2, 0),
    "lin_vel_z": (0, 2, -2),
    "ang_vel_xy": (0, 0, -2),
    "foot_slip": (0, 2, -2),
    "torques": (2, 4, -4),
    "dof_acc": (0, 0, -4),
}
"""Powers of the robot's mass, its leg length, and sqrt(leg length / g), by term."""

Reward = Callable[[State, Robot, Rewards], FloatArray]

REWARDS: dict[str, Reward] = {}
"""Every reward term by name."""


def reward(function: Reward) -> Reward:
    """Register a reward term; its scale is the field of the same name in the task's `rewards`."""
    REWARDS[function.__name__] = function
    return function


def active_rewards(cfg: Rewards, mass: float, leg_length: float) -> dict[str, tuple[Reward, float]]:
    """Return each term with a scale other than 0, and that scale in SI units.

    Args:
        cfg: Scales and parameters of the rewards.
        mass: Mass of the robot [kg].
        leg_length: Length of a leg [m].

    Raises:
        PluginError: if the scale of a term of another package is not a number.
    """
    # Froude scaling: robots of different sizes that move alike have equal rewards in these units.
    time = np.sqrt(leg_length / 9.81)
    units = {k: mass**a * leg_length**b * time**c for k, (a, b, c) in UNITS.items()}
    terms = {}
    for name, function in REWARDS.items():
        plugin = None if is_built_in(function) else f"reward {name} ({function.__module__})"
        with plugin_errors(plugin):
            scale = float(getattr(cfg, name, 0.0)) / units.get(name, 1.0)
        if scale:
            terms[name] = partial(_checked, plugin, function) if plugin else function, scale
    return terms


def _checked(plugin: str, function: Reward, state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Return the values of a term of another package, after checking their type and shape."""
    with plugin_errors(plugin):
        values = np.asarray(function(state, robot, cfg)).astype(np.float32, casting="same_kind")
        if values.shape != (shape := (len(state.commands),)):
            raise ConfigError(f"got shape {values.shape}; expected {shape}")
        return values


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


def _tracking(state: State, cfg: Rewards) -> tuple[FloatArray, FloatArray]:
    """Return how well linear and yaw velocity are tracked, 0 to 1.

    On two legs, velocities are averaged over the gait: the sway is larger than small commands.
    The width of each kernel is proportional to the command. Where only one of the two velocities is
    commanded, the reward of the other one is multiplied by the tracking of the commanded velocity,
    so that standing still does not earn it.
    """
    commands = state.commands
    squared = np.square(commands - state.mean_vel)
    errors = squared[:, :2].sum(axis=1), squared[:, 2]
    squares = _sum_squares(commands[:, :2]), np.square(commands[:, 2])
    # A robot that stands still has the squared error s, the squared command. With a width of
    # -s / log(0.25), its reward exp(-s / width) is 0.25 for any command.
    log_standing = np.float32(np.log(STANDING_TRACKING))
    width_at_rest = np.float32(cfg.tracking_sigma)
    widths = (np.where(s > 0, -s / log_standing, width_at_rest) for s in squares)
    lin, yaw = (np.exp(-error / width) for error, width in zip(errors, widths, strict=True))
    moving = is_moving(commands)
    only_yaw, only_lin = moving & (squares[0] == 0), moving & (squares[1] < MIN_YAW_RATE**2)
    return lin * np.where(only_yaw, yaw, 1), yaw * np.where(only_lin, lin, 1)


@reward
def tracking_lin_vel(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Reward tracking of the linear velocity command, 0 to 1."""
    return _tracking(state, cfg)[0]


@reward
def tracking_ang_vel(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Reward tracking of the yaw rate command, 0 to 1."""
    return _tracking(state, cfg)[1]


@reward
def progress(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Reward velocity along the command, as a fraction of it, -1 to 1; the mean of both parts."""
    products = state.mean_vel * state.commands, np.square(state.commands)
    along, squares = (np.array([p[:, :2].sum(axis=1), p[:, 2]]) for p in products)
    fractions = along / np.where(squares > 0, squares, np.inf)
    total = np.clip(fractions, -1, 1).sum(axis=0) / np.maximum((squares > 0).sum(axis=0), 1)
    return total.astype(np.float32)


@reward
def upright(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Reward a level base, 0 to 1."""
    return np.exp(-_sum_squares(state.projected_gravity[:, :2]) / np.float32(LEVEL_SIN2))


@reward
def lin_vel_z(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Penalize vertical velocity, squared [m2/s2]."""
    return np.square(state.base_lin_vel[:, 2])


@reward
def ang_vel_xy(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Penalize roll and pitch rates, squared [rad2/s2]."""
    return _sum_squares(state.base_ang_vel[:, :2])


@reward
def base_height(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Penalize a base off its target height, squared; bounded over a pit [m2]."""
    target = np.float32(robot.base_height_target)
    # Over a deep hole, an unbounded penalty outweighed all rewards of the episode.
    return np.square(np.minimum(state.base_height, 2 * target) - target)


@reward
def torques(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Penalize torques, squared [N2 m2]."""
    return _sum_squares(state.torques)


@reward
def dof_acc(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Penalize joint accelerations, mean square [rad2/s4]."""
    return np.square(state.dof_acc).mean(axis=1)


@reward
def action_rate(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Penalize changes of the action, mean square."""
    return np.square(state.actions - state.last_actions).mean(axis=1)


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
def feet_gait(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Reward the fraction of feet that are in contact exactly when the gait says so."""
    return (state.foot_contact == (state.swing_phase == 0)).mean(axis=1, dtype=np.float32)


@reward
def foot_swing_height(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Penalize feet off the arc that they should swing in, mean square, relative to its height."""
    target = (cfg.swing_height or SWING_HEIGHT) * robot.leg_length
    if cfg.swing_height is None and state.foot_height.shape[1] == 4:
        target = min(target, MAX_SWING_HEIGHT)
    arc, height = np.sin(np.pi * state.swing_phase), state.foot_height / np.float32(target)
    # Clipped for the same reason as the base height: the foot may be above a deep hole.
    return (np.square(np.clip(height, 0, 2) - arc) * (state.swing_phase > 0)).mean(axis=1)


@reward
def foot_slip(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Penalize the horizontal velocity of feet in contact, mean square [m2/s2]."""
    return (np.square(state.foot_vel[..., :2]).sum(axis=2) * state.foot_contact).mean(axis=1)


@reward
def stand_still(state: State, robot: Robot, cfg: Rewards) -> FloatArray:
    """Penalize leaving the default pose when commanded to stand, except for wheels [rad]."""
    error = np.abs(state.dof_pos - robot.default_pose) * ~robot.wheels
    return error.mean(axis=1) * ~is_moving(state.commands)

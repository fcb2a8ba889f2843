"""Velocity commands: sampling, resampling, heading control, waypoints, and the gait."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrainkit.curriculum.waypoints import Waypoints
from terrainkit.errors import ConfigError
from terrainkit_robots.rl.config import Commands
from terrainkit_robots.rl.simulation import Ids
from terrainkit_robots.transforms import FloatArray, wrap_to_pi

if TYPE_CHECKING:
    from terrainkit_robots.rl.terrain import Ground

# Without the observed velocity, a biped followed 60 % of its commands after 3.1 M samples with 2.3,
# and 84 % after 3.7 M samples with 3.
GAIT_PERIOD, BIPED_GAIT_PERIOD = 2.3, 3.0
"""Default period of the gait, in units of sqrt(leg length / g): 0.5 s for legs of 0.45 m, and 0.8 s
for two legs of 0.7 m, as in unitree_rl_gym."""

# The step is legged_gym's. Its share is 0.8, of a reward with a wider kernel.
CURRICULUM_STEP, CURRICULUM_TRACKING = 0.5, 0.5
"""Extension of the range of forward velocities [m/s], and the share of the tracking reward from
which it is extended."""


def sample_commands(
    rng: np.random.Generator, count: int, cfg: Commands, lin_vel_x: ArrayLike | None = None
) -> tuple[FloatArray, FloatArray]:
    """Sample velocity commands and headings.

    Args:
        rng: Generator of the random numbers.
        count: Number of commands.
        cfg: Ranges of the commands.
        lin_vel_x: Range of the forward velocity [m/s]; None for the range of `cfg`.

    Returns:
        Commands, forward and left [m/s] and yaw rate [rad/s], shape (count, 3), and headings [rad],
        shape (count,). The heading of a command to stand is NaN.
    """
    forward = cfg.lin_vel_x if lin_vel_x is None else lin_vel_x
    low, high = np.array([forward, cfg.lin_vel_y, cfg.ang_vel_yaw], np.float32).T
    commands = low + (high - low) * rng.random((count, 3), dtype=np.float32)
    # As in legged_gym, small commands are commands to stand.
    commands[np.hypot(commands[:, 0], commands[:, 1]) < cfg.min_norm, :2] = 0
    commands[np.abs(commands[:, 2]) < cfg.min_norm, 2] = 0
    left, right = cfg.heading
    # Also sampled without a heading command, so that the random numbers do not depend on it.
    heading = (left + (right - left) * rng.random(count)).astype(np.float32)
    standing = rng.random(count) < cfg.standing
    commands[standing] = 0
    heading[standing] = np.nan
    return commands, heading


Sample = Callable[[np.random.Generator, int], NDArray[Any]]
"""Returns the values of some robots, shape (count, width), from a generator and their number."""


class CommandTerm:
    """Values that n robots are to follow, sampled at each reset and at intervals.

    Args:
        sample: Function that samples values.
        num_envs: Number of robots.
        resampling_time: Time after which new values are sampled [s].
        dt: Time of a step [s].
    """

    def __init__(self, sample: Sample, num_envs: int, resampling_time: float, dt: float) -> None:
        self.values = np.zeros_like(sample(np.random.default_rng(), num_envs), np.float32)
        self._sample, self._interval = sample, max(1, round(resampling_time / dt))

    def resample(self, rng: np.random.Generator, env_ids: Ids) -> None:
        """Sample new values for some environments.

        Args:
            rng: Generator of the random numbers.
            env_ids: Environments, shape (k,).
        """
        self.values[env_ids] = self._sample(rng, len(env_ids))

    def resample_due(self, rng: np.random.Generator, steps: NDArray[np.int64]) -> None:
        """Sample new values where the resampling time has passed.

        Args:
            rng: Generator of the random numbers.
            steps: Steps of each environment since its reset, shape (n,).
        """
        env_ids = np.flatnonzero((steps % self._interval == 0) & (steps > 0))
        if len(env_ids):
            self.resample(rng, env_ids)

    def hold(self) -> None:
        """Keep the values until the next reset."""
        self._interval = np.iinfo(np.int64).max


class VelocityCommand(CommandTerm):
    """Commanded forward and left velocity [m/s] and yaw rate [rad/s]."""

    def __init__(self, cfg: Commands, num_envs: int, dt: float, *, heading_command: bool) -> None:
        def sample(rng: np.random.Generator, count: int) -> FloatArray:
            return sample_commands(rng, count, cfg)[0]

        super().__init__(sample, num_envs, cfg.resampling_time, dt)
        # The heading to turn to [rad], NaN for none. With a heading command, the yaw rate is
        # computed from the heading.
        self.heading = np.zeros(num_envs, np.float32)
        self.heading_command = heading_command
        self.speed = np.zeros(num_envs, np.float32)  # toward the waypoints [m/s], NaN to stand
        self.waypoints: Waypoints | None = None  # override the commands of robots with goals
        self.fixed: FloatArray | None = None  # overrides the sampled commands, shape (n, 3)
        self.lin_vel_x = np.array(cfg.lin_vel_x)  # range, which the curriculum extends [m/s]
        self.tracked = np.zeros(2)  # sum of the tracking of episodes, 0 to 1, and their number
        self.steps = np.zeros(1, np.int64)  # since the start of training
        self._cfg = cfg

    def resample(self, rng: np.random.Generator, env_ids: Ids) -> None:
        """Sample new commands for some environments.

        Args:
            rng: Generator of the random numbers.
            env_ids: Environments, shape (k,).
        """
        sample = sample_commands(rng, len(env_ids), self._cfg, self.lin_vel_x)
        self.values[env_ids], self.heading[env_ids] = sample
        forward = np.abs(self.values[env_ids, 0])
        if self.steps[0] < self._cfg.forward_steps:
            self.values[env_ids, 0] = forward
        self.speed[env_ids] = np.where(np.isnan(self.heading[env_ids]), np.nan, forward)

    def resample_due(self, rng: np.random.Generator, steps: NDArray[np.int64]) -> None:
        """Count the step, and sample new commands where the resampling time has passed.

        Args:
            rng: Generator of the random numbers.
            steps: Steps of each environment since its reset, shape (n,).
        """
        self.steps += 1
        super().resample_due(rng, steps)

    def end_episodes(self, tracking: FloatArray) -> None:
        """Extend the range of the forward velocity where it is tracked well, as in legged_gym.

        Args:
            tracking: Share of the tracking reward that each ended episode earned, shape (k,).
        """
        self.tracked += tracking.sum(), len(tracking)
        if self._cfg.curriculum and self.tracked[1] >= len(self.values):
            if self.tracked[0] > CURRICULUM_TRACKING * self.tracked[1]:
                limit = self._cfg.max_curriculum
                (low, high) = self.lin_vel_x
                self.lin_vel_x[0] = min(low, max(low - CURRICULUM_STEP, -limit))
                self.lin_vel_x[1] = max(high, min(high + CURRICULUM_STEP, limit))
            self.tracked[:] = 0

    def yaw_rate(self, yaw: FloatArray) -> FloatArray:
        """Return the commanded yaw rates.

        Args:
            yaw: Heading of each robot [rad], shape (n,).

        Returns:
            Yaw rates [rad/s], shape (n,), toward the commanded heading if there is one.
        """
        if self.fixed is not None or not self.heading_command:
            return self.values[:, 2]
        rate = np.float32(self._cfg.heading_stiffness) * wrap_to_pi(self.heading - yaw)
        return np.nan_to_num(np.clip(rate, *self._cfg.ang_vel_yaw), nan=0.0)

    def update(self, yaw: FloatArray, position: FloatArray) -> None:
        """Apply the fixed commands, or update commands that depend on headings and waypoints.

        Args:
            yaw: Yaw of each robot [rad], shape (n,).
            position: Position of each robot, x and y [m], shape (n, 2).
        """
        if self.fixed is not None:
            self.values[:] = self.fixed
            return
        self.values[:, 2] = self.yaw_rate(yaw)
        if self.waypoints:
            stiffness, limits = self._cfg.heading_stiffness, self._cfg.ang_vel_yaw
            toward = self.waypoints.commands(position, yaw, self.speed, stiffness, limits)
            np.copyto(self.values, toward, where=~np.isnan(toward))


def make_waypoints(cfg: Commands, terrain: "Ground", num_envs: int) -> Waypoints | None:
    """Return the goals of n robots, if they are commanded to walk to them.

    Raises:
        ConfigError: If the terrain has no goals.
    """
    if not cfg.waypoints:
        return None
    if np.isnan(terrain.goals).all():
        raise ConfigError(
            "commands.waypoints: got a terrain without goals; expected a map with terrains "
            "such as course, and not collision plane"
        )
    return Waypoints.make(num_envs, terrain.goals.shape[2], cfg.waypoint_radius)


class Gait:
    """The gait to follow while commanded to move: neighboring feet swing in turn."""

    def __init__(self, cfg: Commands, leg_length: float, foot_pos: FloatArray) -> None:
        self.leg_length = leg_length
        is_biped = len(foot_pos) == 2
        default = np.sqrt(leg_length / 9.81) * (BIPED_GAIT_PERIOD if is_biped else GAIT_PERIOD)
        self.period = default if cfg.gait_period is None else cfg.gait_period
        x, y = (foot_pos[:, :2] - foot_pos[:, :2].mean(axis=0)).T
        ring = np.argsort(np.arctan2(y, x) % (2 * np.pi))  # from the left front foot, to the left
        # Neighbors in the ring have opposite phases, except the first and last of an odd number: a
        # trot on four legs, a walk on two.
        self.offset = np.zeros(len(foot_pos))
        self.offset[ring[::2]] = 0.5
        self._swing_fraction = cfg.swing_fraction
        # Time constant of the mean velocity that is to track the command [s]. The sway of two legs
        # exceeds small commands, so that stepping in place would track them less than standing.
        self.averaging_time = self.period if is_biped else 0.0

    def phases(self, time: FloatArray, moving: NDArray[np.bool_]) -> tuple[FloatArray, FloatArray]:
        """Return the phases of the gait.

        Args:
            time: Time since the start of each episode [s], shape (n,).
            moving: Which robots are commanded to move, shape (n,).

        Returns:
            `gait_phase`, shape (n, 2), and `swing_phase`, shape (n, f), of a `State`.
        """
        phase = np.outer(time, [1 / self.period]) if self.period else np.zeros((len(time), 1))
        # Sine and cosine have no jump at the end of the period, unlike the phase itself.
        angle, foot_phase = 2 * np.pi * phase, (phase + self.offset) % 1
        walks = moving[:, None] & (self.period > 0)
        swings = walks & (foot_phase < self._swing_fraction)
        gait_phase = np.where(walks, np.hstack([np.sin(angle), np.cos(angle)]), 0)  # no -0
        swing_phase = np.where(swings, foot_phase / (self._swing_fraction or 1.0), 0)
        return gait_phase.astype(np.float32), swing_phase.astype(np.float32)

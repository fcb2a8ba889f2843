"""Velocity commands: sampling, resampling and heading control."""

import numpy as np

from terrainkit_robots.rl.config import Commands
from terrainkit_robots.rl.simulation import Ids
from terrainkit_robots.transforms import FloatArray, wrap_to_pi


def sample_commands(
    rng: np.random.Generator, count: int, cfg: Commands
) -> tuple[FloatArray, FloatArray]:
    """Sample commands, shape (count, 3), and headings [rad], shape (count,).

    The heading of a command to stand is NaN.
    """
    low, high = np.array([cfg.lin_vel_x, cfg.lin_vel_y, cfg.ang_vel_yaw], np.float32).T
    commands = low + (high - low) * rng.random((count, 3), dtype=np.float32)
    commands[np.hypot(commands[:, 0], commands[:, 1]) < cfg.min_norm, :2] = 0
    commands[np.abs(commands[:, 2]) < cfg.min_norm, 2] = 0
    left, right = cfg.heading
    heading = (left + (right - left) * rng.random(count)).astype(np.float32)
    standing = rng.random(count) < cfg.standing
    commands[standing] = 0
    heading[standing] = np.nan
    return commands, heading


class VelocityCommand:
    """The current commands of n robots."""

    def __init__(self, cfg: Commands, num_envs: int, dt: float, *, heading_command: bool) -> None:
        # Forward and left velocity [m/s] and yaw rate [rad/s], and the heading to turn to [rad],
        # NaN for none. With a heading command, the yaw rate is computed from the heading.
        self.commands = np.zeros((num_envs, 3), np.float32)
        self.heading = np.zeros(num_envs, np.float32)
        self.heading_command = heading_command
        self.fixed: FloatArray | None = None  # overrides the sampled commands, shape (n, 3)
        self._cfg = cfg
        self._interval = max(1, round(cfg.resampling_time / dt))

    def resample(self, rng: np.random.Generator, env_ids: Ids) -> None:
        """Sample new commands for some environments."""
        sample = sample_commands(rng, len(env_ids), self._cfg)
        self.commands[env_ids], self.heading[env_ids] = sample

    def resample_due(self, rng: np.random.Generator, steps: Ids) -> None:
        """Resample where the resampling time has passed; `steps` since reset, shape (n,)."""
        env_ids = np.flatnonzero((steps % self._interval == 0) & (steps > 0))
        if len(env_ids):
            self.resample(rng, env_ids)

    def update_heading(self, yaw: FloatArray) -> None:
        """Apply the fixed commands, or compute yaw rates from headings; yaw [rad], shape (n,)."""
        if self.fixed is not None:
            self.commands[:] = self.fixed
        elif self.heading_command:
            rate = np.float32(self._cfg.heading_stiffness) * wrap_to_pi(self.heading - yaw)
            self.commands[:, 2] = np.nan_to_num(np.clip(rate, *self._cfg.ang_vel_yaw), nan=0.0)

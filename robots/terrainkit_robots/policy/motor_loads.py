"""The loads of motors and feet, as shares of what the robot can bear."""

from typing import Any

import numpy as np

from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.transforms import BoolArray, FloatArray

BINS = 201
"""Bins of the shares of a limit: each percent, and 200 % and more."""


class Loads:
    """Torques, joint speeds and foot forces of n robots, measured in every physics step.

    Torques and speeds are shares of the limits of each joint in the robot's spec, forces are in
    units of the robot's nominal weight.
    """

    def __init__(self, env: LeggedEnv) -> None:
        """Measure an environment from now on."""
        self._env = env
        n = env.num_envs
        limits = np.stack([env.robot.effort, env.robot.velocity])[:, None]
        self._limits = np.where(limits > 0, limits, np.inf)
        self._steps: list[tuple[FloatArray, FloatArray]] = []  # since the last step of the policy
        self._peaks = np.zeros((2, n), np.float32)  # torque and speed of the most loaded joint
        self._forces = np.zeros(n, np.float32)
        self._counts = np.zeros((2, n, limits.shape[2], BINS), np.uint32)
        env.sim.after_step = self._record

    def _record(self) -> None:
        sim = self._env.sim
        joints = np.abs([sim.torque, sim.qvel[:, sim.scene.joint_qvel]]) / self._limits
        force = np.square(sim.sensor("foot_force")).sum(axis=2).max(axis=1)
        self._steps.append((joints.astype(np.float32), np.sqrt(force)))

    def add(self, robots: BoolArray) -> None:
        """Count the physics steps since the last call.

        Args:
            robots: Mask of the measured robots, shape (n,).
        """
        for joints, force in self._steps if robots.any() else ():
            peaks = np.maximum(self._peaks, joints.max(axis=2))
            self._peaks[:, robots] = peaks[:, robots]
            self._forces[robots] = np.maximum(self._forces, force)[robots]
            # Rounded up, so that a share below 1 counts as at most 100 %.
            bins = np.clip(np.ceil(100 * joints - 1e-3), 0, BINS - 1).astype(np.int64)
            flat = np.arange(bins.size).reshape(bins.shape) * BINS + bins
            self._counts.reshape(-1)[flat[:, robots]] += 1  # each bin at most once
        self._steps.clear()

    def metrics(self, robots: BoolArray) -> dict[str, Any]:
        """Return the loads of the robots in a mask, as fields of `RolloutMetrics`.

        Args:
            robots: Mask of the robots, shape (n,).
        """
        counts = self._counts[:, robots].sum(axis=1, dtype=np.int64)
        if not counts.any():
            return {}
        # The percentile of each joint, and of these the largest.
        reached = counts.cumsum(axis=2) >= 0.95 * counts.sum(axis=2, keepdims=True)
        torque, speed = (reached.argmax(axis=2).max(axis=1) / 100).tolist()
        peaks = self._peaks[:, robots].max(axis=1).tolist()
        return {
            "torque_peak": peaks[0],
            "torque_95": torque,
            "joint_speed_peak": peaks[1],
            "joint_speed_95": speed,
            "foot_force_peak": float(self._forces[robots].max() / (9.81 * self._env.mass)),
        }

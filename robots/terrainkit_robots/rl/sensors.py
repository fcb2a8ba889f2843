"""The sensors: what is measured of robots after a step, from the physics and the ground."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.rl.ground import Ground
from terrainkit_robots.rl.physics import Physics
from terrainkit_robots.rl.rotation import gravity_in_body, to_body, yaw_of
from terrainkit_robots.rl.state import Measured
from terrainkit_robots.rl.task import Task
from terrainkit_robots.rl.terminations import outside, tilted, touched

FloatArray = NDArray[np.float32]

_CONTACT = 1.0
"""Force from which a foot is on the ground [N]: legged_gym's."""


class Sensors:
    """Measure n robots, and remember what the next measurement is compared with."""

    def __init__(self, physics: Physics, ground: Ground, task: Task, *, scan: bool) -> None:
        n, feet = len(physics.qpos), len(physics.scene.sole_depth)
        self.air_time = np.zeros((n, feet), np.float32)
        """Time since each foot left the ground, 0 while it is down [s], shape (n, f)."""

        self.last_dof_vel = np.zeros((n, len(physics.scene.joint_qvel)), np.float32)
        """Speed of the joints a step before [rad/s], shape (n, j)."""

        self._physics, self._ground, self._scene = physics, ground, physics.scene
        self._termination, self._dt = task.termination, np.float32(task.dt)
        self._scan = _scan_points(task) if scan else np.zeros((2, 0), np.float32)

    def forget(self, ids: Any) -> None:
        """Compare with rest: robots `ids` begin anew."""
        self.last_dof_vel[ids] = 0
        self.air_time[ids] = 0

    def measure(self, rows: Any, *, fresh: bool) -> Measured:
        """Return what is measured of robots `rows`; what has just begun has no contacts yet."""
        physics, scene = self._physics, self._scene
        qpos, qvel = physics.qpos[rows].astype(np.float32), physics.qvel[rows].astype(np.float32)
        quat, pos = qpos[:, 3:7], qpos[:, :3]
        gravity = gravity_in_body(quat)
        dof_vel = qvel[:, scene.joint_qvel]
        feet = physics.block("foot_position", rows)
        under = self._ground.height(feet[..., 0], feet[..., 1])
        force = -physics.block("foot_force", rows)
        penalized = physics.block("penalized_force", rows)
        ending = physics.block("termination_force", rows)
        if fresh:
            force[:] = penalized[:] = ending[:] = 0
        first, air_time = self._steps_taken(rows, force, np.float32(0) if fresh else self._dt)
        dof_acc = (dof_vel - self.last_dof_vel[rows]) / self._dt
        self.last_dof_vel[rows] = dof_vel
        return Measured(
            base_pos=pos,
            base_quat=quat,
            base_lin_vel=to_body(quat, qvel[:, :3]),
            base_ang_vel=qvel[:, 3:6],
            projected_gravity=gravity,
            base_height=pos[:, 2] - self._ground.height(pos[:, 0], pos[:, 1]),
            dof_pos=qpos[:, scene.joint_qpos],
            dof_vel=dof_vel,
            dof_acc=dof_acc,
            torques=physics.torque[rows].astype(np.float32) * np.float32(not fresh),
            foot_height=feet[..., 2] - under - scene.sole_depth,
            foot_vel=physics.block("foot_velocity", rows),
            foot_force=force,
            first_contact=first,
            air_time=air_time,
            penalized_force=np.sqrt(np.einsum("npi,npi->np", penalized, penalized)),
            height_scan=self._scanned(pos, quat),
            fallen=touched(ending, self._termination)
            | tilted(gravity, self._termination)
            | outside(pos, self._ground),
        )

    def _steps_taken(
        self, rows: Any, force: FloatArray, dt: np.float32
    ) -> tuple[NDArray[np.bool_], FloatArray]:
        """Return which feet came down, and how long each was in the air; count on by `dt`."""
        down = force[..., 2] > _CONTACT
        air_time = self.air_time[rows] + dt
        first = down & (self.air_time[rows] > 0)
        self.air_time[rows] = np.where(down, 0, air_time)
        return first, air_time

    def _scanned(self, pos: FloatArray, quat: FloatArray) -> FloatArray:
        """Return the height of the base above the points of the scan [m], shape (n, k)."""
        if not self._scan.size:
            return np.zeros((len(pos), 0), np.float32)
        yaw = yaw_of(quat)
        c, s = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
        x, y = self._scan
        height = self._ground.height(pos[:, :1] + c * x - s * y, pos[:, 1:2] + s * x + c * y)
        return pos[:, 2:3] - height


def _scan_points(task: Task) -> FloatArray:
    """Return where the height scan looks, x and y in the base's frame [m], shape (2, k)."""
    x, y = np.meshgrid(
        task.terrain.measured_points_x, task.terrain.measured_points_y, indexing="ij"
    )
    return np.stack([x.ravel(), y.ravel()]).astype(np.float32)

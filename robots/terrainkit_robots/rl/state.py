"""The state of the robots after a step, and the sensors that measure it."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots import transforms
from terrainkit_robots.rl import terminations
from terrainkit_robots.rl.config import Task
from terrainkit_robots.rl.simulation import Simulation
from terrainkit_robots.rl.terrain import Ground
from terrainkit_robots.transforms import FloatArray

CONTACT_FORCE = 1.0
"""Vertical force from which a foot is in contact [N], as in legged_gym."""


@dataclass(frozen=True, kw_only=True, eq=False)
class State:
    """The state of n robots: j joints, a actions, f feet, p penalized bodies, k scan points.

    The arrays are copies: they may change within a step, but not in later steps.
    """

    base_pos: FloatArray  # position of the base, world frame [m], shape (n, 3)
    base_quat: FloatArray  # orientation of the base (w, x, y, z), shape (n, 4)
    base_lin_vel: FloatArray  # linear velocity of the base, base frame [m/s], shape (n, 3)
    base_ang_vel: FloatArray  # angular velocity of the base, base frame [rad/s], shape (n, 3)
    mean_vel: FloatArray  # forward, left [m/s], yaw rate [rad/s]; moving averages, shape (n, 3)
    projected_gravity: FloatArray  # direction of gravity, base frame, shape (n, 3)
    base_height: FloatArray  # height of the base above the ground under it [m], shape (n,)
    dof_pos: FloatArray  # joint positions [rad], shape (n, j)
    dof_vel: FloatArray  # joint velocities [rad/s], shape (n, j)
    dof_acc: FloatArray  # joint accelerations, from the last two velocities [rad/s2], shape (n, j)
    torques: FloatArray  # motor torques [N m], shape (n, j)
    foot_height: FloatArray  # height of the feet above the ground under them [m], shape (n, f)
    foot_vel: FloatArray  # velocity of the feet, world frame [m/s], shape (n, f, 3)
    foot_force: FloatArray  # contact force on the feet, world frame [N], shape (n, f, 3)
    penalized_force: FloatArray  # magnitude of the force on each penalized body [N], shape (n, p)
    height_scan: FloatArray  # height of the base above each scan point [m], shape (n, k)
    fallen: NDArray[np.bool_]  # robots whose episode ends with a fall, shape (n,)
    actions: FloatArray  # actions of this step, shape (n, a)
    last_actions: FloatArray  # actions of the previous step, shape (n, a)
    commands: FloatArray  # forward and left velocity [m/s], yaw rate [rad/s], shape (n, 3)
    gait_phase: FloatArray  # sine and cosine, shape (n, 2); 0 when commanded to stand
    swing_phase: FloatArray  # completed fraction of each foot's swing, shape (n, f); 0 in stance
    push_vel: FloatArray  # velocity that a push added in this step, world frame [m/s], shape (n, 3)
    friction: FloatArray  # contact friction, shape (n, 1)
    added_mass: FloatArray  # mass added to the base [kg], shape (n, 1)
    com_shift: FloatArray  # shift of the base's center of mass, base frame [m], shape (n, 3)
    joint_offset: FloatArray  # measured minus true joint position [rad], shape (n, j)
    history: FloatArray  # previous observations of the policy, newest first; see `history_width`

    @property
    def foot_contact(self) -> NDArray[np.bool_]:
        """Which feet are in contact, shape (n, f)."""
        return self.foot_force[..., 2] > CONTACT_FORCE

    def update(self, env_ids: NDArray[np.int64], other: "State") -> None:
        """Replace the rows of some robots.

        Args:
            env_ids: Rows, shape (k,).
            other: State of these k robots.
        """
        for field in fields(self):
            getattr(self, field.name)[env_ids] = getattr(other, field.name)


class Sensors:
    """Measure n robots; keep the values that the next measurement is compared with."""

    def __init__(
        self, sim: Simulation, terrain: Ground, task: Task, averaging_time: float, *, scan: bool
    ) -> None:
        n, joints = len(sim.qpos), len(sim.scene.joint_qvel)
        self.last_dof_vel = np.zeros((n, joints), np.float32)  # of the previous step [rad/s]
        self.mean_vel = np.zeros((n, 3), np.float32)
        self._sim, self._terrain, self._cfg = sim, terrain, task.termination
        self._dt = np.float32(task.dt)
        self._mean_weight = np.float32(task.dt / max(averaging_time, task.dt))
        x, y = task.terrain.measured_points_x, task.terrain.measured_points_y
        points = np.stack([each.ravel() for each in np.meshgrid(x, y, indexing="ij")])
        self._scan_points = points[:, : None if scan else 0].astype(np.float32)

    def reset(self, env_ids: Any) -> None:
        """Start new episodes, with joints at rest."""
        self.last_dof_vel[env_ids] = self.mean_vel[env_ids] = 0

    def read(self, rows: Any, *, after_reset: bool) -> dict[str, Any]:
        """Return the measured fields of `State`; after a reset there are no contacts yet."""
        sim, scene = self._sim, self._sim.scene
        qpos, qvel = sim.qpos[rows].astype(np.float32), sim.qvel[rows].astype(np.float32)
        quat, pos = qpos[:, 3:7], qpos[:, :3]
        gravity = transforms.projected_gravity(quat)
        dof_vel = qvel[:, scene.joint_qvel]
        foot_pos = sim.sensor("foot_position", rows)
        foot_force = -sim.sensor("foot_force", rows)
        penalized = sim.sensor("penalized_force", rows)
        terminating = sim.sensor("termination_force", rows)
        if after_reset:
            foot_force[:] = penalized[:] = terminating[:] = 0
        dof_acc = (dof_vel - self.last_dof_vel[rows]) / self._dt
        self.last_dof_vel[rows] = dof_vel
        lin_vel, ang_vel = transforms.quat_rotate_inverse(quat, qvel[:, :3]), qvel[:, 3:6]
        vel = np.concatenate([lin_vel[:, :2], ang_vel[:, 2:]], axis=1)
        self.mean_vel[rows] += self._mean_weight * (vel - self.mean_vel[rows])
        # The scan points turn with the yaw.
        (x, y), yaw = self._scan_points, transforms.quat_to_yaw(quat)[:, None]
        c, s = np.cos(yaw), np.sin(yaw)
        x, y = pos[:, :1] + c * x - s * y, pos[:, 1:2] + s * x + c * y
        scan = self._terrain.height(x, y, pos[:, 2:], scan=True)
        ground_height = self._terrain.height(*np.moveaxis(foot_pos, -1, 0))
        return {
            "base_pos": pos,
            "base_quat": quat,
            "base_lin_vel": lin_vel,
            "base_ang_vel": ang_vel,
            "mean_vel": self.mean_vel[rows].copy(),
            "projected_gravity": gravity,
            "base_height": pos[:, 2] - self._terrain.height(*pos.T),
            "dof_pos": qpos[:, scene.joint_qpos],
            "dof_vel": dof_vel,
            "dof_acc": dof_acc,
            "torques": sim.torque[rows].astype(np.float32) * np.float32(not after_reset),
            "foot_height": foot_pos[..., 2] - ground_height - scene.sole_depth,
            "foot_vel": sim.sensor("foot_velocity", rows),
            "foot_force": foot_force,
            "penalized_force": np.sqrt(np.einsum("npi,npi->np", penalized, penalized)),
            "height_scan": pos[:, 2:3] - scan,
            "fallen": terminations.illegal_contact(terminating, self._cfg)
            | terminations.bad_orientation(gravity, self._cfg)
            | terminations.terrain_out_of_bounds(pos, self._terrain),
        }

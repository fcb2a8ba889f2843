"""The state of the robots after a step, and the sensors that measure it."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.perception.height_scan import HeightScan
from terrainkit.perception.orientation import projected_gravity, quat_to_yaw
from terrainkit_robots.rl.commands import Gait
from terrainkit_robots.rl.config import Terrain
from terrainkit_robots.rl.simulation import Simulation
from terrainkit_robots.rl.terrain import Ground
from terrainkit_robots.transforms import FloatArray, quat_rotate_inverse

CONTACT_FORCE = 1.0
"""Vertical force from which a foot is in contact [N], as in legged_gym."""

NEAR_FOOT = 0.22
"""Distance of an edge that a foot has to clear, as a fraction of the leg length: 10 of 45 cm."""

# The diagonals find the gaps between stones, also where two of them cross.
_NEAR_POINTS = np.array(
    [[0, 0], [-1, 0], [1, 0], [0, -1], [0, 1], [-2, 0], [2, 0], [2, 2], [2, -2], [-2, -2], [-2, 2]],
    np.float32,
)
"""Points around a foot at which the ground is measured, ahead and left, in steps of `NEAR_FOOT`."""


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
    foot_height_over_edges: FloatArray  # the same above edges ahead, with gaps filled [m]
    foot_ground_depth: FloatArray  # of the ground near feet below these edges [m], shape (n, f, 5)
    foot_vel: FloatArray  # velocity of the feet, world frame [m/s], shape (n, f, 3)
    foot_force: FloatArray  # contact force on the feet, world frame [N], shape (n, f, 3)
    foot_air_time: FloatArray  # time since each foot was last in contact [s], shape (n, f); the
    # whole swing when the foot lands, then 0
    penalized_force: FloatArray  # magnitude of the force on each penalized body [N], shape (n, p)
    height_scan: FloatArray  # height of the base above each scan point [m], shape (n, k)
    fallen: NDArray[np.bool_]  # robots whose episode ends with a fall, shape (n,)
    actions: FloatArray  # actions of this step, shape (n, a)
    last_actions: FloatArray  # actions of the previous step, shape (n, a)
    last_last_actions: FloatArray  # actions of the step before that, shape (n, a)
    commands: FloatArray  # forward and left velocity [m/s], yaw rate [rad/s], shape (n, 3)
    gait_phase: FloatArray  # sine and cosine, shape (n, 2); 0 when commanded to stand
    swing_phase: FloatArray  # completed fraction of each foot's swing, shape (n, f); 0 in stance

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


def scan_points(cfg: Terrain, foot_pos: FloatArray) -> FloatArray:
    """Return the points of the height scan: those of the grid by x, then those around each foot.

    Args:
        cfg: The coordinates.
        foot_pos: Default positions of the feet in the frame of the base [m], shape (f, 3).

    Returns:
        Points ahead and to the left of the robot [m], shape (k, 2).
    """
    grid = np.array([(x, y) for x in cfg.measured_points_x for y in cfg.measured_points_y])
    near = np.array([(x, y) for x in cfg.foot_points_x for y in cfg.foot_points_y]).reshape(-1, 2)
    around = foot_pos[:, None, :2] + near
    return np.concatenate([grid, around.reshape(-1, 2)])


def next_air_time(last: State, in_air: NDArray[np.bool_], dt: np.float32) -> FloatArray:
    """Return the `foot_air_time` of the step after a state.

    Args:
        last: State before the step.
        in_air: Whether each foot is in the air after it, shape (n, f).
        dt: Time of the step [s].
    """
    before = np.where(last.foot_contact, 0, last.foot_air_time)
    return (before + dt) * (in_air | (before > 0))  # also when the foot lands


class Sensors:
    """Measure n robots."""

    def __init__(
        self, sim: Simulation, terrain: Ground, dt: float, gait: Gait, points: FloatArray
    ) -> None:
        """Prepare the sensors.

        Args:
            sim: The simulations.
            terrain: The terrain under the robots.
            dt: Time of a step [s].
            gait: The gait, over whose period `mean_vel` is averaged on two legs.
            points: Points of the height scan [m], shape (k, 2); none for no height scan.
        """
        self._sim, self._terrain = sim, terrain
        self._dt = np.float32(dt)
        self._mean_weight = np.float32(dt / max(gait.averaging_time, dt))
        self._scan = HeightScan(terrain, points=points)
        self._near_foot = np.float32(NEAR_FOOT * gait.leg_length) * _NEAR_POINTS

    def scan_points(self, pos: FloatArray, quat: FloatArray) -> tuple[FloatArray, ...]:
        """Return x, y and z of the points of the height scan [m], shape (n, k) each.

        Args:
            pos: Positions of the base [m], shape (n, 3).
            quat: Orientations of the base (w, x, y, z), shape (n, 4).
        """
        return self._scan.points(pos, quat_to_yaw(quat))

    def read(self, rows: Any, last: State | None, commands: FloatArray) -> dict[str, Any]:
        """Return the measured fields of `State`.

        Args:
            rows: Index of the robots.
            last: State before the step; None after a reset, when nothing is in contact yet.
            commands: Forward and left velocity [m/s] and yaw rate [rad/s], shape (n, 3).
        """
        sim, scene, dt = self._sim, self._sim.scene, self._dt
        qpos, qvel = sim.qpos[rows].astype(np.float32), sim.qvel[rows].astype(np.float32)
        quat, ang_vel, center = qpos[:, 3:7], qvel[:, 3:6], scene.center
        conjugate = quat * np.array([1, -1, -1, -1], np.float32)
        pos = qpos[:, :3] + quat_rotate_inverse(conjugate, center)
        lin_vel = quat_rotate_inverse(quat, qvel[:, :3]) + np.cross(ang_vel, center)
        dof_vel, foot_pos = qvel.take(scene.joint_qvel, 1), sim.sensor("foot_position", rows)
        foot_force = -sim.sensor("foot_force", rows)
        penalized = sim.sensor("penalized_force", rows)
        ground, edges = self._ground_of_feet(foot_pos, quat, commands)
        scan = np.zeros((len(pos), 0), np.float32)
        if self._scan.offsets.size:
            scan = self.scan_points(pos, quat)[2]
        torques = sim.torque[rows].astype(np.float32)
        vel = np.concatenate([lin_vel[:, :2], ang_vel[:, 2:]], axis=1)
        last_vel, dof_acc = np.zeros_like(vel), np.zeros_like(dof_vel)
        air_time = np.zeros_like(foot_pos[..., 0])
        if last is None:
            foot_force[:] = penalized[:] = torques[:] = 0
        else:
            last_vel, dof_acc = last.mean_vel, (dof_vel - last.dof_vel) / dt
            air_time = next_air_time(last, foot_force[..., 2] <= CONTACT_FORCE, dt)
        return {
            "base_pos": pos,
            "base_quat": quat,
            "base_lin_vel": lin_vel,
            "base_ang_vel": ang_vel,
            "mean_vel": last_vel + self._mean_weight * (vel - last_vel),
            "projected_gravity": projected_gravity(quat),
            "base_height": pos[:, 2] - self._terrain.height(*pos.T),
            "dof_pos": qpos[:, scene.joint_qpos],
            "dof_vel": dof_vel,
            "dof_acc": dof_acc,
            "torques": torques,
            "foot_height": foot_pos[..., 2] - ground[..., 0] - scene.sole_depth,
            "foot_height_over_edges": foot_pos[..., 2] - edges - scene.sole_depth,
            "foot_ground_depth": edges[..., None] - ground,
            "foot_vel": sim.sensor("foot_velocity", rows),
            "foot_force": foot_force,
            "foot_air_time": air_time,
            "penalized_force": np.sqrt(np.einsum("npi,npi->np", penalized, penalized)),
            "height_scan": pos[:, 2:3] - scan,
            "fallen": np.zeros(len(pos), bool),
        }

    def _ground_of_feet(
        self, foot_pos: FloatArray, quat: FloatArray, commands: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the heights of the ground near the feet and of the edges that they have to clear.

        In the commanded direction, a foot has to clear an edge one step of `NEAR_FOOT` ahead of it,
        and a gap with ground at most two steps behind and two steps ahead. It also has to clear a
        gap with ground on both sides along a diagonal.

        Returns:
            Height of the ground under each foot and one step behind, ahead, right and left of it
            [m], shape (n, f, 5), and of the edges [m], shape (n, f).
        """
        if self._terrain.is_plane:
            flat = np.zeros((*foot_pos.shape[:2], 5), np.float32)
            return flat, flat[..., 0]
        yaw = quat_to_yaw(quat)
        cos, sin, (forward, left) = np.cos(yaw), np.sin(yaw), commands[:, :2].T
        ahead = np.stack([cos * forward - sin * left, sin * forward + cos * left], axis=1)
        ahead /= np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-6)
        to_the_left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
        axes = np.stack([ahead, to_the_left], axis=1)
        points = foot_pos[:, :, None, :2] + (self._near_foot @ axes)[:, None]
        ground = self._terrain.height(points[..., 0], points[..., 1], foot_pos[..., 2:])
        near = np.moveaxis(ground, 2, 0)
        here, back, front, _, _, far_back, far_front = near[:7]
        gap = np.minimum(np.maximum(back, far_back), np.maximum(front, far_front))
        diagonal_gaps = np.minimum(near[7:9], near[9:])
        edges = np.max([here, front, gap, *diagonal_gaps], axis=0)
        return ground[..., :5], edges

"""The start of an episode: where robots stand, how they are bent, how they move."""

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.rl.ground import Ground
from terrainkit_robots.rl.robot import Robot
from terrainkit_robots.rl.scene import Scene
from terrainkit_robots.rl.task import InitState

FloatArray = NDArray[np.float32]

_RELIEF = 0.06
"""Most that the ground may rise and fall under a robot that starts beside its origin [m]."""


def draw_start(
    rng: np.random.Generator,
    origins: FloatArray,
    scene: Scene,
    robot: Robot,
    ground: Ground,
    settings: InitState,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the positions and velocities that episodes start with, shape (k, nq) and (k, nv).

    Args:
        rng: Where they are drawn from.
        origins: Spawn origins [m], shape (k, 3).
        scene: The scene.
        robot: The robot.
        ground: What it stands on.
        settings: How much starts differ.
    """
    count = len(origins)
    qpos = np.tile(scene.home, (count, 1))
    xy, height = _places(rng, origins, robot, ground, settings.position)
    qpos[:, :2] = xy
    qpos[:, 2] = height + float(robot.spec.spawn_height or 0.0)
    yaw = rng.uniform(-settings.yaw, settings.yaw, count)
    qpos[:, 3], qpos[:, 6] = np.cos(yaw / 2), np.sin(yaw / 2)
    joints = (count, len(robot.default_pose))
    factors = rng.uniform(*(settings.reset_range or robot.spec.reset_range), joints)
    qpos[:, scene.joint_qpos] = np.clip(robot.default_pose * factors, robot.lower, robot.upper)
    qvel = np.zeros((count, scene.model.nv))
    qvel[:, :3] = rng.uniform(-settings.lin_vel, settings.lin_vel, (count, 3))
    qvel[:, 3:6] = rng.uniform(-settings.ang_vel, settings.ang_vel, (count, 3))
    return qpos, qvel


def _places(
    rng: np.random.Generator, origins: FloatArray, robot: Robot, ground: Ground, reach: float
) -> tuple[FloatArray, FloatArray]:
    """Return where robots start, and the highest ground under them.

    They start beside the origin where that is as good as level, else half as far, else on it.
    """
    offset = rng.uniform(-reach, reach, (len(origins), 2)).astype(np.float32)
    ring_x, ring_y = _ring(robot)
    for nearer in (0.5, 0.0, 1.0):  # on the origin itself it is as it is
        x, y = (origins[:, :2] + offset).T
        under = ground.height(x[:, None] + ring_x, y[:, None] + ring_y)
        highest = under.max(axis=1)
        uneven = highest - under.min(axis=1) > _RELIEF
        if not uneven.any():
            break
        offset[uneven] *= nearer
    return origins[:, :2] + offset, highest


def _ring(robot: Robot) -> FloatArray:
    """Return points all over where feet may stand, whatever the heading [m], shape (2, p)."""
    reach = 0.5 * max(float(robot.spec.leg_length or 0.4), float(robot.spec.stance_width or 0.2))
    turn = np.arange(8) * (np.pi / 4)
    circle = np.stack([np.cos(turn), np.sin(turn)])
    middle = np.zeros((2, 1))
    return np.concatenate([middle, reach / 2 * circle, reach * circle], axis=1).astype(np.float32)

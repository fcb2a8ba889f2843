"""The moving picture of the documentation: the quadruped crosses stairs, gaps and a slope."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import cv2
import mujoco
import numpy as np
from gallery import MIN_HEIGHT, add_meshes, block
from numpy.typing import NDArray

from terrainkit import MapConfig, Patch, generate, make_patch
from terrainkit_robots.policy.evaluate import EvaluationConfig, build_eval_env
from terrainkit_robots.policy.load_policy import load_policy, single_torch_thread
from terrainkit_robots.policy.policy_rollout import rollout
from terrainkit_robots.rendering import appearance
from terrainkit_robots.rendering.child_process import Frame, stream_frames
from terrainkit_robots.rendering.video import smooth_path
from terrainkit_robots.rl.run import open_run
from terrainkit_robots.rl.terrain import MapGround

POLICY = "quadruped_hard"
SPEED = 1.0
"""Forward velocity of the command [m/s]."""

START = 1.2
SECONDS = 10.0
"""Times of the first and the last frame [s]."""

COURSE = Path(__file__).with_name("walk.toml")
"""Configuration of the map."""

SIZE = (640, 360)
"""Width and height of the picture [pixels]."""

STRIDE = 2
"""Control steps from one frame to the next."""

QUALITY = 60
"""Quality of WebP, 1 to 100."""

DISTANCE = 2.1
"""Distance of the camera from the robot [m]."""

AZIMUTHS = (122.0, 62.0)
"""Azimuth of the camera at the first and the last frame [deg]."""

ELEVATION = -14.0
"""Elevation of the camera [deg]."""

SKY = (0.7, 0.82, 0.93)
PLAIN = (0.5, 0.58, 0.44, 1)
TRUNK = (0.13, 0.36, 0.66, 1)
"""Colors of the sky, of the plain below the course, and of the trunk of the robot."""


def write_walk(path: Path) -> None:
    """Simulate the walk, and write it as an animated WebP that repeats."""
    config = MapConfig.load(COURSE)
    poses, period = record_poses(config)
    animation = cv2.Animation()
    frames = stream_frames(partial(walk_frames, make_patch(config, 0, 0), poses))
    animation.frames = [cv2.cvtColor(frame, cv2.COLOR_RGB2BGR) for frame in frames]
    animation.durations = [round(1000 * period)] * len(poses)
    cv2.imwriteanimation(str(path), animation, [cv2.IMWRITE_WEBP_QUALITY, QUALITY])


@single_torch_thread()
def record_poses(config: MapConfig) -> tuple[NDArray[np.float64], float]:
    """Return the poses of the robot, shape (frames, nq), and the time between two of them [s]."""
    run = open_run(POLICY)
    settings = EvaluationConfig(seconds=SECONDS)
    env = build_eval_env(run, MapGround(generate(config), "boxes"), 1, settings)
    env.reset()
    middle = env.terrain.env_origins[0, 0, 1]

    def commands() -> Iterator[NDArray[np.float32]]:
        for _ in range(round(SECONDS / env.cfg.dt)):
            yaw = 2 * np.arctan2(env.sim.qpos[:, 6], env.sim.qpos[:, 3])
            turn = -yaw - 0.6 * (env.sim.qpos[:, 1] - middle)  # along the middle of the course
            yield np.array([[SPEED, 0.0, turn[0]]], np.float32)

    poses = []
    for _, fell in rollout(env, load_policy(run, env), commands()):
        assert not fell.any(), "the robot fell"
        poses.append(env.sim.qpos[0].copy())
    return np.array(poses[round(START / env.cfg.dt) :: STRIDE]), STRIDE * env.cfg.dt


def walk_frames(patch: Patch, poses: NDArray[np.float64]) -> Iterator[Frame]:
    """Yield a frame of each pose on a patch."""
    spec = mujoco.MjSpec.from_file(str(open_run(POLICY).robot.mjcf))
    appearance.set_appearance(spec)
    sky = spec.texture("terrainkit_sky")
    sky.rgb1 = sky.rgb2 = SKY
    spec.visual.rgba.fog = [*SKY, 1]
    spec.body("base").geoms[0].rgba = TRUNK
    plain = mujoco.mjtGeom.mjGEOM_PLANE
    spec.worldbody.add_geom(type=plain, size=[0, 0, 1], pos=[0, 0, MIN_HEIGHT], rgba=PLAIN)
    add_meshes(spec, [block(patch)], checkered=True)
    model = spec.compile()
    data = mujoco.MjData(model)
    targets = smooth_path(poses[:, :3], 0.5 * len(poses) / (SECONDS - START))
    with appearance.make_renderer(model, SIZE, DISTANCE) as renderer:
        for pose, target, azimuth in zip(
            poses, targets, np.linspace(*AZIMUTHS, len(poses)), strict=True
        ):
            data.qpos[:] = pose
            mujoco.mj_kinematics(model, data)
            mujoco.mj_camlight(model, data)
            appearance.update_scene(renderer, data, target, DISTANCE, azimuth, ELEVATION)
            yield renderer.render()

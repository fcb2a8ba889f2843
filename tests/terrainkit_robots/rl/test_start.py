import mujoco
import numpy as np
import pytest
import torch

from terrainkit import MapConfig, generate
from terrainkit_robots.rl.config import InitState
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.events import sample_reset_state
from terrainkit_robots.rl.scene import build_scene
from terrainkit_robots.rl.terrain import MapTerrain, Plane
from terrainkit_robots.transforms import quat_to_yaw


@pytest.fixture(scope="module")
def default_ground():
    """Return a map of every default terrain at its easiest, a middling and its hardest."""
    return MapTerrain(generate(MapConfig(rows=3, seed=5)))


@pytest.fixture(scope="module")
def plane_scene(quadruped, calm):
    return build_scene(quadruped, Plane(), calm())


def drawn(robot, scene, ground, settings, origins, seed=0):
    rng = np.random.default_rng(seed)
    return sample_reset_state(rng, origins, scene, robot, ground, settings)


def deepest(env, qpos, down=0.0):
    """Return how deep a robot is in the ground, below 0 [m], once it is lowered by `down`."""
    data = mujoco.MjData(env.scene.model)
    data.qpos[:] = qpos
    data.qpos[2] -= down
    mujoco.mj_forward(env.scene.model, data)
    return min([contact.dist for contact in data.contact], default=0.0)


def everywhere(env):
    """Start on every patch of the map, each its own robot."""
    rows, cols = env.terrain.env_origins.shape[:2]
    env.curriculum.levels[:] = np.repeat(np.arange(rows), cols)
    env.curriculum.columns[:] = np.tile(np.arange(cols), rows)
    env.reset()


class TestDrawn:
    def test_shapes(self, quadruped, plane_scene):
        qpos, qvel = drawn(
            quadruped, plane_scene, Plane(), InitState(), np.zeros((7, 3), np.float32)
        )
        assert qpos.shape == (7, plane_scene.model.nq)
        assert qvel.shape == (7, plane_scene.model.nv)
        np.testing.assert_allclose(np.linalg.norm(qpos[:, 3:7], axis=1), 1)

    def test_everything_keeps_within_its_range_and_fills_it(self, quadruped, plane_scene):
        settings = InitState(
            position=0.4, yaw=1.0, lin_vel=0.3, ang_vel=0.6, reset_range=(0.8, 1.2)
        )
        origins = np.tile(np.float32([3, -2, 0]), (400, 1))
        qpos, qvel = drawn(quadruped, plane_scene, Plane(), settings, origins)
        offset = qpos[:, :2] - [3, -2]
        for values, most in (
            (offset, 0.4),
            (quat_to_yaw(qpos[:, 3:7].astype(np.float32)), 1.0),
            (qvel[:, :3], 0.3),
            (qvel[:, 3:6], 0.6),
        ):
            assert np.abs(values).max() <= most + 1e-6
            assert values.min() < -0.9 * most
            assert values.max() > 0.9 * most
        factors = qpos[:, plane_scene.joint_qpos] / np.where(
            quadruped.default_pose == 0, np.nan, quadruped.default_pose
        )
        assert np.nanmin(factors) >= 0.8 - 1e-6
        assert np.nanmax(factors) <= 1.2 + 1e-6
        assert (qvel[:, plane_scene.joint_qvel] == 0).all()

    def test_joints_keep_within_their_limits(self, quadruped, plane_scene):
        settings = InitState(reset_range=(0.0, 9.0))
        qpos, _ = drawn(quadruped, plane_scene, Plane(), settings, np.zeros((50, 3), np.float32))
        joints = qpos[:, plane_scene.joint_qpos]
        assert (joints >= quadruped.lower - 1e-6).all()
        assert (joints <= quadruped.upper + 1e-6).all()

    def test_the_same_seed_draws_the_same(self, quadruped, plane_scene):
        origins = np.zeros((5, 3), np.float32)
        first, second, other = (
            drawn(quadruped, plane_scene, Plane(), InitState(), origins, seed) for seed in (1, 1, 2)
        )
        np.testing.assert_array_equal(first[0], second[0])
        np.testing.assert_array_equal(first[1], second[1])
        assert not np.array_equal(first[0], other[0])

    def test_one_robot_gets_what_it_would_get_alone_in_place(self, quadruped, plane_scene):
        origins = np.float32([[1, 1, 0], [50, 1, 0]])
        settings = InitState(position=0.0, yaw=0.0, reset_range=(1.0, 1.0))
        qpos, _ = drawn(quadruped, plane_scene, Plane(), settings, origins)
        np.testing.assert_allclose(qpos[:, :2], origins[:, :2])
        np.testing.assert_allclose(qpos[0, 7:], qpos[1, 7:])


class TestOnTheGround:
    @pytest.mark.parametrize("name", ["quadruped", "biped"])
    def test_at_the_origin_in_the_default_pose_feet_are_at_the_ground(
        self, name, calm, default_ground, request
    ):
        rows, cols = default_ground.env_origins.shape[:2]
        env = LeggedEnv(calm(rows * cols), request.getfixturevalue(name), default_ground)
        everywhere(env)
        np.testing.assert_allclose(
            env.sim.qpos[:, :2], env.curriculum.env_origins[:, :2], atol=1e-6
        )
        for down, touching in ((0.0, False), (0.02, True)):
            found = [deepest(env, qpos, down) < 0 for qpos in env.sim.qpos]
            assert found == [touching] * len(found)

    @pytest.mark.parametrize("name", ["quadruped", "biped"])
    def test_nothing_of_the_robot_is_in_the_ground(self, name, lively, default_ground, request):
        rows, cols = default_ground.env_origins.shape[:2]
        env = LeggedEnv(lively(rows * cols), request.getfixturevalue(name), default_ground)
        for _ in range(3):
            everywhere(env)
            depths = np.array([deepest(env, qpos) for qpos in env.sim.qpos])
            assert depths.min() > -0.02, f"{np.mean(depths < -0.02):.0%} are deeper"

    def test_robots_start_beside_the_origin_where_the_ground_allows(
        self, quadruped, lively, default_ground
    ):
        rows, cols = default_ground.env_origins.shape[:2]
        env = LeggedEnv(lively(rows * cols), quadruped, default_ground)
        everywhere(env)
        offset = np.abs(env.sim.qpos[:, :2] - env.curriculum.env_origins[:, :2])
        assert (offset <= 0.5 + 1e-6).all()
        assert (offset.max(axis=1) > 0.1).mean() > 0.3

    def test_nobody_falls_at_once(self, quadruped, lively, default_ground):
        rows, cols = default_ground.env_origins.shape[:2]
        env = LeggedEnv(lively(rows * cols), quadruped, default_ground)
        everywhere(env)
        fallen = np.zeros(rows * cols, bool)
        for _ in range(10):
            _, _, dones, _ = env.step(torch.zeros(rows * cols, 12))
            fallen |= dones.numpy()
        assert fallen.mean() < 0.02

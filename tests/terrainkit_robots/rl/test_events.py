from dataclasses import replace
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
import torch

from terrainkit import MapConfig, generate
from terrainkit.errors import PluginError
from terrainkit.perception.orientation import quat_to_yaw
from terrainkit_robots.rl.config import Control, DomainRand, InitState, Task
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.events import EventTerm, apply_params, reset_push, sample_params
from terrainkit_robots.rl.scene import Scene
from terrainkit_robots.rl.simulation import Simulation
from terrainkit_robots.rl.terrain import MapGround, Plane


@pytest.fixture(scope="module")
def physics_of(quadruped):
    """Return a function that makes the simulations of some robots."""

    def make(kind="P", robot=quadruped):
        task = Task(control=Control(control_type=kind))
        return Simulation(Scene(robot, Plane(), task), 5, 1)

    return make


def draw(sim, settings, n=5, seed=0):
    cfg, rng = Task(domain_rand=settings), np.random.default_rng(seed)
    return sample_params(SimpleNamespace(cfg=cfg, scene=sim.scene, num_envs=n, rng=rng))


class TestSampleParams:
    def test_values_fill_their_ranges(self, physics_of):
        ranges = {"friction": (0.2, 0.4), "added_mass": (-0.2, 0.3), "gains": (0.7, 1.1)}
        settings = DomainRand(**ranges, com_shift=0.05, motor_strength=(0.8, 0.9))
        sim = physics_of()
        mass = float(sim.scene.model.body_subtreemass[sim.scene.base])
        drawn = draw(sim, settings, n=4000)
        for name, (low, high), width in [
            ("friction", (0.2, 0.4), 1),
            ("added_mass", (-0.2 * mass, 0.3 * mass), 1),
            ("com_shift", (-0.05, 0.05), 3),
            ("stiffness", (0.7, 1.1), 12),
            ("damping", (0.7, 1.1), 12),
            ("strength", (0.8, 0.9), 1),
        ]:
            values = (getattr(drawn, name) - np.float32(low)) / (high - low)
            assert values.shape == (4000, width), name
            assert values.min() >= 0, name
            assert values.max() <= 1 + 1e-6, name
            quarters = np.quantile(values, [0, 0.25, 0.5, 0.75, 1], axis=0).T
            expected = [[0, 0.25, 0.5, 0.75, 1]] * width
            np.testing.assert_allclose(quarters, expected, atol=0.04, err_msg=name)

    def test_kilograms_and_axes_replace_shares(self, physics_of):
        ranges = {"added_mass_range": (1.0, 2.0), "com_pos_y_range": (0.1, 0.2)}
        drawn = draw(physics_of(), DomainRand(**ranges, com_shift=0.05), n=400)
        found = np.column_stack([drawn.added_mass, drawn.com_shift])
        np.testing.assert_allclose(found.min(axis=0), [1, -0.05, 0.1, -0.05], atol=0.02)
        np.testing.assert_allclose(found.max(axis=0), [2, 0.05, 0.2, 0.05], atol=0.02)


class TestApplyParams:
    @pytest.mark.parametrize("kind", ["P", "V", "T"])
    @pytest.mark.parametrize("name", ["quadruped", "cart"])  # the cart's hull is smoother
    def test_nominal_params_keep_the_model(self, request, physics_of, no_randomization, name, kind):
        sim = physics_of(kind, request.getfixturevalue(name))
        apply_params(sim, draw(sim, no_randomization))
        fields = "body_mass body_inertia body_ipos geom_friction actuator_gainprm actuator_biasprm"
        for field in fields.split():
            found = sim.batch.expand(field)
            expected = np.broadcast_to(getattr(sim.scene.model, field), found.shape)
            np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9, err_msg=field)

    def test_torque_control_has_no_gains(self, physics_of):
        sim = physics_of("T")
        drawn = draw(sim, DomainRand())
        apply_params(sim, drawn)
        gain = sim.batch.expand("actuator_gainprm")[:, :, 0]
        np.testing.assert_allclose(gain, np.tile(drawn.strength, 12), rtol=1e-6)
        assert (sim.batch.expand("actuator_biasprm") == 0).all()


class TestInEnvironment:
    def test_joint_offsets_are_resampled_at_reset(self, nominal_env, no_randomization):
        env = nominal_env(6, domain_rand=replace(no_randomization, joint_offset=0.05))
        before = env.joint_offset.copy()
        assert 0.04 < np.abs(before).max() <= 0.05
        env.sim.qpos[1, 3:7] = (0, 1, 0, 0)
        env.step(torch.zeros(6, 12))
        changed = (env.joint_offset != before).any(axis=1)
        assert changed.tolist() == [False, True, False, False, False, False]

    def test_first_push_time_is_uniform(self):
        env = pushed(2000, DomainRand(push_interval_s=0.1))
        reset_push(env, np.arange(2000))
        times, counts = np.unique(env.steps_until_push, return_counts=True)
        assert times.tolist() == [1, 2, 3, 4, 5]
        np.testing.assert_allclose(counts, 400, rtol=0.15)

    def test_reset_samples_a_new_push_time(self):
        env = pushed(6, DomainRand(push_interval_s=15))
        reset_push(env, np.arange(6))
        before = env.steps_until_push.copy()
        env.push_vel[:] = 1
        reset_push(env, np.array([1, 4]))
        assert np.flatnonzero(env.steps_until_push != before).tolist() == [1, 4]
        assert env.push_vel[:, 0].tolist() == [1, 0, 1, 1, 0, 1]


def pushed(n, settings):
    """Return what pushes read of an environment of n robots."""
    return SimpleNamespace(
        cfg=Task(domain_rand=settings),
        rng=np.random.default_rng(0),
        push_vel=np.zeros((n, 3), np.float32),
        steps_until_push=np.zeros(n, np.int64),
    )


@pytest.fixture(scope="module")
def default_ground():
    """Return a map with every default terrain at three difficulties."""
    return MapGround(generate(MapConfig(rows=3, seed=5)))


def deepest(env, qpos, down=0.0):
    """Return the clearance of a robot that is lowered by `down`, negative in the ground [m]."""
    data = mujoco.MjData(env.scene.model)
    data.qpos[:] = qpos
    data.qpos[2] -= down
    mujoco.mj_forward(env.scene.model, data)
    return min([contact.dist for contact in data.contact], default=0.0)


def on_every_patch(make_env, ground, **options):
    """Return an environment with one robot on every patch of the map."""
    rows, cols = ground.env_origins.shape[:2]
    env = make_env(rows * cols, ground, **options)
    env.curriculum.levels[:] = np.repeat(np.arange(rows), cols)
    env.curriculum.columns[:] = np.tile(np.arange(cols), rows)
    env.reset()
    return env


@pytest.mark.parametrize("when", ["startup", "reset", "step"])
def test_failing_event_of_another_package_is_named(quadruped, nominal_task, when):
    def gust(env, *env_ids):
        raise ValueError(f"{env.num_envs} robots, {len(env_ids)} more arguments")

    class Windy(LeggedEnv):
        def event_terms(self):
            return super().event_terms() | {"gust": EventTerm(**{when: gust})}

    told = rf"^event gust \(.*test_events\): ValueError: 4 robots, {int(when == 'reset')} more"
    with pytest.raises(PluginError, match=told):
        Windy(nominal_task(), quadruped, Plane()).step(torch.zeros(4, 12))


class TestResetState:
    def test_reset_values_fill_their_ranges(self, nominal_env, quadruped):
        ranges = {"position": 0.4, "yaw": 1.0, "lin_vel": 0.3, "ang_vel": 0.6}
        ground = Plane()
        ground.env_origins = np.float32([[[3, -2, 0]]])
        ground.spawns = np.float32([[[[3, -2, 0, 0]]]])
        env = nominal_env(400, ground, init_state=InitState(**ranges, reset_range=(0.8, 1.2)))
        qpos, qvel, joints = env.sim.qpos, env.sim.qvel, env.scene.joint_qpos
        yaw = quat_to_yaw(qpos[:, 3:7].astype(np.float32))
        found = (qpos[:, :2] - [3, -2], yaw, qvel[:, :3], qvel[:, 3:6])
        for values, most in zip(found, ranges.values(), strict=True):
            assert np.abs(values).max() <= most + 1e-6
            assert np.quantile(values / most, [0, 0.5, 1]) == pytest.approx([-1, 0, 1], abs=0.15)
        pose = np.where(quadruped.default_pose == 0, np.nan, quadruped.default_pose)
        factors = qpos[:, joints] / pose
        ends = np.nanmin(factors), np.nanmax(factors)
        assert ends == pytest.approx((0.8, 1.2), abs=0.01)
        assert (qvel[:, env.scene.joint_qvel] == 0).all()

    def test_joints_respect_soft_limits(self, nominal_env, quadruped):
        env = nominal_env(50, init_state=InitState(reset_range=(0.0, 9.0)))
        joints = env.sim.qpos[:, env.scene.joint_qpos]
        assert (joints >= quadruped.lower - 1e-6).all()
        assert (joints <= quadruped.upper + 1e-6).all()


class TestResetOnTerrain:
    @pytest.mark.parametrize("name", ["quadruped", "biped"])
    def test_feet_are_on_the_ground_at_origin(self, nominal_env, name, default_ground, request):
        env = on_every_patch(nominal_env, default_ground, robot=request.getfixturevalue(name))
        origins = env.curriculum.env_origins[:, :2]
        np.testing.assert_allclose(env.sim.qpos[:, :2], origins, atol=1e-6)
        np.testing.assert_allclose(env.state.base_pos, env.sim.qpos[:, :3], atol=1e-6)
        for down, touching in ((0.0, False), (0.02, True)):
            found = [deepest(env, qpos, down) < 0 for qpos in env.sim.qpos]
            assert found == [touching] * len(found)

    @pytest.mark.parametrize("name", ["quadruped", "biped"])
    def test_no_geom_is_below_the_ground(self, random_env, name, default_ground, request):
        env = on_every_patch(random_env, default_ground, robot=request.getfixturevalue(name))
        for _ in range(3):
            env.reset()
            depths = np.array([deepest(env, qpos) for qpos in env.sim.qpos])
            assert depths.min() > -0.02, f"{np.mean(depths < -0.02):.0%} are deeper"

    def test_robots_start_beside_the_origin(self, random_env, default_ground):
        env = on_every_patch(random_env, default_ground)
        offset = np.abs(env.sim.qpos[:, :2] - env.curriculum.env_origins[:, :2])
        assert (offset <= 0.5 + 1e-6).all()
        assert (offset.max(axis=1) > 0.1).mean() > 0.3

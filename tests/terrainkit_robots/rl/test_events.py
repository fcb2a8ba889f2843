"""Events: domain randomization, pushes and reset states."""

from dataclasses import fields, replace

import mujoco
import numpy as np
import pytest
import torch

from terrainkit import MapConfig, generate
from terrainkit_robots.rl.config import Control, DomainRand, InitState, Task
from terrainkit_robots.rl.events import (
    Pushes,
    RandomizedParams,
    apply_params,
    sample_params,
    sample_reset_state,
)
from terrainkit_robots.rl.scene import build_scene
from terrainkit_robots.rl.simulation import Simulation
from terrainkit_robots.rl.terrain import MapGround, Plane
from terrainkit_robots.transforms import quat_to_yaw


@pytest.fixture(scope="module")
def physics_of(quadruped):
    """Return a function that makes the simulations of some robots."""

    def make(kind="P", robot=quadruped):
        task = Task(control=Control(control_type=kind))
        return Simulation(build_scene(robot, Plane(), task), 5, 1)

    return make


def draw(sim, settings, n=5, seed=0):
    return sample_params(np.random.default_rng(seed), n, sim, settings)


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
            values, near = getattr(drawn, name), 0.01 * (high - low)
            assert values.shape == (4000, width), name
            assert (values >= np.float32(low)).all(), name
            assert (values <= np.float32(high)).all(), name
            assert (values.min(axis=0) < low + near).all(), name
            assert (values.max(axis=0) > high - near).all(), name
            middle = np.full(width, (low + high) / 2)
            np.testing.assert_allclose(values.mean(axis=0), middle, atol=3 * near, err_msg=name)

    def test_joints_are_independent(self, physics_of):
        drawn = draw(physics_of(), DomainRand(), n=500)
        assert abs(np.corrcoef(drawn.stiffness[:, 0], drawn.stiffness[:, 1])[0, 1]) < 0.2
        assert abs(np.corrcoef(drawn.stiffness[:, 0], drawn.damping[:, 0])[0, 1]) < 0.2

    def test_none_gives_nominal_values(self, physics_of, no_randomization):
        drawn = draw(physics_of(), no_randomization)
        assert (drawn.added_mass == 0).all()
        assert (drawn.com_shift == 0).all()
        for factor in (drawn.stiffness, drawn.damping, drawn.strength):
            assert (factor == 1).all()

    def test_same_seed_gives_same_values(self, physics_of):
        sim = physics_of()
        one, other, third = (draw(sim, DomainRand(), seed=seed) for seed in (1, 1, 2))
        for each in fields(RandomizedParams):
            np.testing.assert_array_equal(getattr(one, each.name), getattr(other, each.name))
            assert (getattr(one, each.name) != getattr(third, each.name)).any()


_CHANGED = (
    *("body_mass", "body_inertia", "body_ipos"),
    *("geom_friction", "actuator_gainprm", "actuator_biasprm"),
)


class TestApplyParams:
    @pytest.mark.parametrize("kind", ["P", "V", "T"])
    @pytest.mark.parametrize("name", ["quadruped", "cart"])  # the cart's hull is smoother
    def test_nominal_params_keep_the_model(self, request, physics_of, no_randomization, name, kind):
        sim = physics_of(kind, request.getfixturevalue(name))
        apply_params(sim, draw(sim, no_randomization))
        for field in _CHANGED:
            found = sim.batch.expand(field)
            expected = np.broadcast_to(getattr(sim.scene.model, field), found.shape)
            np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9, err_msg=field)

    def test_gains_of_velocity_control(self, physics_of):
        sim, model = physics_of("V"), physics_of("V").scene.model
        drawn = draw(sim, DomainRand())
        apply_params(sim, drawn)
        kv = model.actuator_gainprm[:, 0] * drawn.damping * drawn.strength
        assert (kv > 0).all()
        np.testing.assert_allclose(sim.batch.expand("actuator_gainprm")[:, :, 0], kv, rtol=1e-6)
        bias = sim.batch.expand("actuator_biasprm")
        np.testing.assert_allclose(bias[:, :, 2], -kv, rtol=1e-6)
        assert (bias[:, :, :2] == 0).all()

    def test_torque_control_has_no_gains(self, physics_of):
        """Torque control has no gains, so only the motor strength is applied."""
        sim = physics_of("T")
        apply_params(sim, draw(sim, replace(DomainRand(), motor_strength=None)))
        model = sim.scene.model
        for field in ("actuator_gainprm", "actuator_biasprm"):
            found = sim.batch.expand(field)
            expected = np.broadcast_to(getattr(model, field), found.shape)
            np.testing.assert_array_equal(found, expected)
        drawn = draw(sim, DomainRand())
        apply_params(sim, drawn)
        gain = sim.batch.expand("actuator_gainprm")[:, :, 0]
        np.testing.assert_allclose(gain, np.tile(drawn.strength, 12), rtol=1e-6)
        assert (sim.batch.expand("actuator_biasprm") == 0).all()

    def test_apply_is_idempotent(self, physics_of):
        """Loading a checkpoint applies its parameters over the initial ones."""
        sim = physics_of()
        first, second = draw(sim, DomainRand(), seed=1), draw(sim, DomainRand(), seed=2)
        apply_params(sim, second)
        once = {field: sim.batch.expand(field).copy() for field in _CHANGED}
        apply_params(sim, first)
        apply_params(sim, second)
        for field in _CHANGED:
            np.testing.assert_array_equal(sim.batch.expand(field), once[field], err_msg=field)


class TestInEnvironment:
    def test_robots_are_identical_without_randomization(self, nominal_env, no_randomization):
        env = nominal_env(6, domain_rand=no_randomization)
        for _ in range(5):
            env.step(torch.full((6, 12), 0.1))
        assert np.ptp(env.sim.qpos, axis=0).max() == 0

    @pytest.mark.parametrize(
        "change",
        [
            {"added_mass": (-0.1, 0.1)},
            {"com_shift": 0.05},
            {"gains": (0.8, 1.2)},
            {"motor_strength": (0.8, 1.2)},
            {"joint_offset": 0.05},
        ],
        ids=lambda change: next(iter(change)),
    )
    def test_each_setting_makes_robots_differ(self, nominal_env, no_randomization, change):
        env = nominal_env(6, domain_rand=replace(no_randomization, **change))
        for _ in range(5):
            env.step(torch.full((6, 12), 0.1))
        assert np.ptp(env.sim.qpos, axis=0).max() > 1e-5

    def test_friction_holds_or_slips(self, nominal_env, no_randomization):
        speeds = []
        for friction in (0.05, 1.0):
            env = nominal_env(
                1, domain_rand=replace(no_randomization, friction=(friction, friction))
            )
            for _ in range(15):
                env.step(torch.zeros(1, 12))
            env.sim.qvel[:, 0] = 1.0
            for _ in range(10):
                env.step(torch.zeros(1, 12))
            feet = env.state.foot_vel[0, :, 0]
            speeds.append(float(np.abs(feet).mean()))
        assert speeds[0] > 5 * speeds[1]

    def test_strength_respects_effort_limits(self, nominal_env):
        env = nominal_env(6, domain_rand=DomainRand(motor_strength=(2, 2), push_interval_s=0))
        env.step(torch.full((6, 12), 50.0))
        torque = np.abs(env.state.torques)
        assert (torque <= env.robot.effort * 1.0001).all()
        assert (torque.max(axis=0) > 0.99 * env.robot.effort).any()

    def test_privileged_observations_have_the_params(self, nominal_env):
        env = nominal_env(6, domain_rand=DomainRand())
        seen = env.get_observations()["privileged"].numpy()
        here, start = {}, 0
        for each in env.obs_terms["privileged"]:
            stop = start + each.function(env.state).shape[1]
            here[each.name], start = seen[:, start:stop], stop
        np.testing.assert_array_equal(here["friction"], env.params.friction)
        np.testing.assert_array_equal(here["added_mass"], env.params.added_mass)
        np.testing.assert_allclose(here["com_shift"], 10 * env.params.com_shift)
        np.testing.assert_array_equal(here["joint_offset"], env.joint_offset)

    def test_joint_offsets_are_resampled_at_reset(self, nominal_env, no_randomization):
        env = nominal_env(6, domain_rand=replace(no_randomization, joint_offset=0.05))
        before = env.joint_offset.copy()
        assert 0.04 < np.abs(before).max() <= 0.05
        env.sim.qpos[1, 3:7] = (0, 1, 0, 0)
        env.step(torch.zeros(6, 12))
        changed = (env.joint_offset != before).any(axis=1)
        assert changed.tolist() == [False, True, False, False, False, False]

    def test_joint_offset_shifts_the_position(self, nominal_env, no_randomization):
        """With action 0, the measured joint positions converge to the default pose."""
        env = nominal_env(6, domain_rand=replace(no_randomization, joint_offset=0.05))
        env.scene.model.opt.gravity[:] = 0
        for _ in range(40):
            env.sim.qpos[:, :7] = (0, 0, 1, 1, 0, 0, 0)
            env.sim.qvel[:, :6] = 0
            env.step(torch.zeros(6, 12))
        off = env.state.dof_pos - env.robot.default_pose
        np.testing.assert_allclose(off, -env.state.joint_offset, atol=1e-3)
        assert np.abs(off).max() > 0.02

    def test_first_push_time_is_uniform(self):
        pushes = Pushes(DomainRand(push_interval_s=0.1), 2000, 0.02)
        pushes.reset(np.random.default_rng(0), np.arange(2000))
        times, counts = np.unique(pushes.steps_until_push, return_counts=True)
        assert times.tolist() == [1, 2, 3, 4, 5]
        np.testing.assert_allclose(counts, 400, rtol=0.15)

    def test_reset_samples_a_new_push_time(self):
        pushes = Pushes(DomainRand(push_interval_s=15), 6, 0.02)
        rng = np.random.default_rng(0)
        pushes.reset(rng, np.arange(6))
        before = pushes.steps_until_push.copy()
        pushes.velocity[:] = 1
        pushes.reset(rng, np.array([1, 4]))
        assert np.flatnonzero(pushes.steps_until_push != before).tolist() == [1, 4]
        assert pushes.velocity[:, 0].tolist() == [1, 0, 1, 1, 0, 1]


@pytest.fixture(scope="module")
def default_ground():
    """Return a map with every default terrain at three difficulties."""
    return MapGround(generate(MapConfig(rows=3, seed=5)))


@pytest.fixture(scope="module")
def plane_scene(quadruped, nominal_task):
    return build_scene(quadruped, Plane(), nominal_task())


@pytest.fixture
def drawn(quadruped, plane_scene):
    """Return a function that samples states at reset on a plane."""

    def draw(origins, seed=0, **settings):
        rng, cfg = np.random.default_rng(seed), InitState(**settings)
        return sample_reset_state(rng, np.float32(origins), plane_scene, quadruped, Plane(), cfg)

    return draw


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


class TestSampleResetState:
    def test_shapes(self, drawn, plane_scene):
        qpos, qvel = drawn(np.zeros((7, 3)))
        assert qpos.shape == (7, plane_scene.model.nq)
        assert qvel.shape == (7, plane_scene.model.nv)
        np.testing.assert_allclose(np.linalg.norm(qpos[:, 3:7], axis=1), 1)

    def test_reset_values_fill_their_ranges(self, drawn, quadruped, plane_scene):
        ranges = {"position": 0.4, "yaw": 1.0, "lin_vel": 0.3, "ang_vel": 0.6}
        qpos, qvel = drawn(np.tile([3, -2, 0], (400, 1)), **ranges, reset_range=(0.8, 1.2))
        yaw = quat_to_yaw(qpos[:, 3:7].astype(np.float32))
        found = (qpos[:, :2] - [3, -2], yaw, qvel[:, :3], qvel[:, 3:6])
        for values, most in zip(found, ranges.values(), strict=True):
            assert np.abs(values).max() <= most + 1e-6
            assert values.min() < -0.9 * most
            assert values.max() > 0.9 * most
        pose = np.where(quadruped.default_pose == 0, np.nan, quadruped.default_pose)
        factors = qpos[:, plane_scene.joint_qpos] / pose
        assert np.nanmin(factors) >= 0.8 - 1e-6
        assert np.nanmax(factors) <= 1.2 + 1e-6
        assert (qvel[:, plane_scene.joint_qvel] == 0).all()

    def test_joints_respect_soft_limits(self, drawn, quadruped, plane_scene):
        joints = drawn(np.zeros((50, 3)), reset_range=(0.0, 9.0))[0][:, plane_scene.joint_qpos]
        assert (joints >= quadruped.lower - 1e-6).all()
        assert (joints <= quadruped.upper + 1e-6).all()

    def test_same_seed_gives_same_state(self, drawn):
        first, second, other = (drawn(np.zeros((5, 3)), seed) for seed in (1, 1, 2))
        np.testing.assert_array_equal(first[0], second[0])
        np.testing.assert_array_equal(first[1], second[1])
        assert not np.array_equal(first[0], other[0])

    def test_origins_only_shift_the_position(self, drawn):
        origins = [[1, 1, 0], [50, 1, 0]]
        qpos, _ = drawn(origins, position=0.0, yaw=0.0, reset_range=(1.0, 1.0))
        np.testing.assert_allclose(qpos[:, :2], np.float32(origins)[:, :2])
        np.testing.assert_allclose(qpos[0, 7:], qpos[1, 7:])


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

    def test_no_robot_falls_at_once(self, random_env, default_ground):
        env = on_every_patch(random_env, default_ground)
        rest = torch.zeros(env.num_envs, env.num_actions)
        dones = torch.stack([env.step(rest)[2] for _ in range(10)])
        assert dones.any(dim=0).float().mean() < 0.02

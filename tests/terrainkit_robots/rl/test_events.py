"""Events: domain randomization, pushes and reset states."""

from dataclasses import fields, replace
from pathlib import Path
from typing import Any, Literal

import mujoco
import numpy as np
import pytest
import torch

from terrainkit import MapConfig, generate
from terrainkit_robots.description import bundled
from terrainkit_robots.rl.config import Control, DomainRand, Env, InitState, Task
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.events import (
    Pushes,
    RandomizedParams,
    apply_params,
    sample_params,
    sample_reset_state,
)
from terrainkit_robots.rl.scene import build_scene
from terrainkit_robots.rl.simulation import Simulation
from terrainkit_robots.rl.terrain import MapTerrain, Plane
from terrainkit_robots.spec.robot import Robot
from terrainkit_robots.transforms import quat_to_yaw

_NONE = DomainRand(
    friction=None,
    added_mass=None,
    com_shift=0.0,
    gains=None,
    motor_strength=None,
    joint_offset=0.0,
    push_interval_s=0.0,
)


def robot_named(name: str) -> Robot:
    return Robot.load(Path(str(bundled.urdf_path(name))).parent)


def physics_of(kind: Literal["P", "V", "T"] = "P", n: int = 5) -> Simulation:
    task = Task(control=Control(control_type=kind))
    return Simulation(build_scene(robot_named("quadruped"), Plane(), task), n, 1)


def draw(sim: Simulation, settings: DomainRand, n: int = 5, seed: int = 0) -> RandomizedParams:
    return sample_params(np.random.default_rng(seed), n, sim, settings)


class TestSampleParams:
    def test_values_fill_their_ranges(self) -> None:
        settings = DomainRand(
            friction=(0.2, 0.4),
            added_mass=(-0.2, 0.3),
            com_shift=0.05,
            gains=(0.7, 1.1),
            motor_strength=(0.8, 0.9),
        )
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

    def test_joints_are_independent(self) -> None:
        drawn = draw(physics_of(), DomainRand(), n=500)
        assert abs(np.corrcoef(drawn.stiffness[:, 0], drawn.stiffness[:, 1])[0, 1]) < 0.2
        assert abs(np.corrcoef(drawn.stiffness[:, 0], drawn.damping[:, 0])[0, 1]) < 0.2

    def test_none_gives_nominal_values(self) -> None:
        drawn = draw(physics_of(), _NONE)
        assert (drawn.added_mass == 0).all()
        assert (drawn.com_shift == 0).all()
        for factor in (drawn.stiffness, drawn.damping, drawn.strength):
            assert (factor == 1).all()

    def test_same_seed_gives_same_values(self) -> None:
        sim = physics_of()
        one, other, third = (draw(sim, DomainRand(), seed=seed) for seed in (1, 1, 2))
        for each in fields(RandomizedParams):
            np.testing.assert_array_equal(getattr(one, each.name), getattr(other, each.name))
            assert (getattr(one, each.name) != getattr(third, each.name)).any()


_CHANGED = (
    "body_mass",
    "body_inertia",
    "body_ipos",
    "geom_friction",
    "actuator_gainprm",
    "actuator_biasprm",
)


class TestApplyParams:
    @pytest.mark.parametrize("kind", ["P", "V", "T"])
    def test_nominal_params_keep_the_model(self, kind: Literal["P", "V", "T"]) -> None:
        sim = physics_of(kind)
        apply_params(sim, draw(sim, _NONE))
        for field in _CHANGED:
            found = sim.batch.expand(field)
            expected = np.broadcast_to(getattr(sim.scene.model, field), found.shape)
            np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9, err_msg=field)

    def test_added_mass_scales_inertia(self) -> None:
        sim = physics_of()
        base, model = sim.scene.base, sim.scene.model
        drawn = draw(sim, replace(_NONE, added_mass=(0.1, 0.1)))
        added = 0.1 * model.body_subtreemass[base]
        apply_params(sim, drawn)
        mass = sim.batch.expand("body_mass")
        np.testing.assert_allclose(mass[:, base], model.body_mass[base] + added, rtol=1e-6)
        others = np.delete(mass, base, axis=1)
        np.testing.assert_array_equal(others[0], np.delete(model.body_mass, base))
        heavier = 1 + added / model.body_mass[base]
        inertia = sim.batch.expand("body_inertia")[:, base]
        expected = np.tile(heavier * model.body_inertia[base], (5, 1))
        np.testing.assert_allclose(inertia, expected, rtol=1e-6)

    def test_friction_of_colliding_geoms(self) -> None:
        sim = physics_of()
        apply_params(sim, draw(sim, replace(_NONE, friction=(0.3, 0.3))))
        friction, own = sim.batch.expand("geom_friction"), sim.scene.geoms
        np.testing.assert_allclose(friction[:, own, 0], 0.3, rtol=1e-6)
        model = sim.scene.model
        expected = np.delete(model.geom_friction[:, 0], own)
        np.testing.assert_array_equal(np.delete(friction[0, :, 0], own), expected)
        np.testing.assert_array_equal(friction[0, :, 1:], model.geom_friction[:, 1:])

    def test_gains_of_velocity_control(self) -> None:
        sim, model = physics_of("V"), physics_of("V").scene.model
        drawn = draw(sim, DomainRand())
        apply_params(sim, drawn)
        kv = model.actuator_gainprm[:, 0] * drawn.damping * drawn.strength
        assert (kv > 0).all()
        np.testing.assert_allclose(sim.batch.expand("actuator_gainprm")[:, :, 0], kv, rtol=1e-6)
        bias = sim.batch.expand("actuator_biasprm")
        np.testing.assert_allclose(bias[:, :, 2], -kv, rtol=1e-6)
        assert (bias[:, :, :2] == 0).all()

    def test_torque_control_has_no_gains(self) -> None:
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

    def test_apply_is_idempotent(self) -> None:
        """Loading a checkpoint applies its parameters over the initial ones."""
        sim = physics_of()
        first, second = draw(sim, DomainRand(), seed=1), draw(sim, DomainRand(), seed=2)
        apply_params(sim, second)
        once = {field: sim.batch.expand(field).copy() for field in _CHANGED}
        apply_params(sim, first)
        apply_params(sim, second)
        for field in _CHANGED:
            np.testing.assert_array_equal(sim.batch.expand(field), once[field], err_msg=field)


def make_env(settings: DomainRand, n: int = 6, **changes: Any) -> LeggedEnv:
    task = Task(
        env=Env(num_envs=n, num_threads=1),
        init_state=InitState(lin_vel=0, ang_vel=0, yaw=0, reset_range=(1, 1), position=0),
        domain_rand=settings,
        **changes,
    )
    return LeggedEnv(task, robot_named("quadruped"), Plane())


class TestInEnvironment:
    def test_robots_are_identical_without_randomization(self) -> None:
        env = make_env(_NONE)
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
    def test_each_setting_makes_robots_differ(self, change: dict[str, Any]) -> None:
        env = make_env(replace(_NONE, **change))
        for _ in range(5):
            env.step(torch.full((6, 12), 0.1))
        assert np.ptp(env.sim.qpos, axis=0).max() > 1e-5

    def test_friction_holds_or_slips(self) -> None:
        speeds = []
        for friction in (0.05, 1.0):
            env = make_env(replace(_NONE, friction=(friction, friction)), n=1)
            for _ in range(15):
                env.step(torch.zeros(1, 12))
            env.sim.qvel[:, 0] = 1.0
            for _ in range(10):
                env.step(torch.zeros(1, 12))
            feet = env.state.foot_vel[0, :, 0]
            speeds.append(float(np.abs(feet).mean()))
        assert speeds[0] > 5 * speeds[1]

    def test_strength_respects_effort_limits(self) -> None:
        env = make_env(DomainRand(motor_strength=(2, 2), push_interval_s=0))
        env.step(torch.full((6, 12), 50.0))
        torque = np.abs(env.state.torques)
        assert (torque <= env.robot.effort * 1.0001).all()
        assert (torque.max(axis=0) > 0.99 * env.robot.effort).any()

    def test_privileged_observations_have_the_params(self) -> None:
        env = make_env(DomainRand())
        seen = env.get_observations()["privileged"].numpy()
        here, start = {}, 0
        for each in env.obs_groups["privileged"]:
            stop = start + each.function(env.state).shape[1]
            here[each.name], start = seen[:, start:stop], stop
        np.testing.assert_array_equal(here["friction"], env.params.friction)
        np.testing.assert_array_equal(here["added_mass"], env.params.added_mass)
        np.testing.assert_allclose(here["com_shift"], 10 * env.params.com_shift)
        np.testing.assert_array_equal(here["joint_offset"], env.joint_offset)

    def test_joint_offsets_are_resampled_at_reset(self) -> None:
        env = make_env(replace(_NONE, joint_offset=0.05))
        before = env.joint_offset.copy()
        assert 0.04 < np.abs(before).max() <= 0.05
        env.sim.qpos[1, 3:7] = (0, 1, 0, 0)
        env.step(torch.zeros(6, 12))
        changed = (env.joint_offset != before).any(axis=1)
        assert changed.tolist() == [False, True, False, False, False, False]

    def test_joint_offset_shifts_the_position(self) -> None:
        """With action 0, the measured joint positions converge to the default pose."""
        env = make_env(replace(_NONE, joint_offset=0.05))
        env.scene.model.opt.gravity[:] = 0
        for _ in range(40):
            env.sim.qpos[:, :7] = (0, 0, 1, 1, 0, 0, 0)
            env.sim.qvel[:, :6] = 0
            env.step(torch.zeros(6, 12))
        off = env.state.dof_pos - env.robot.default_pose
        np.testing.assert_allclose(off, -env.state.joint_offset, atol=1e-3)
        assert np.abs(off).max() > 0.02

    def test_first_push_time_is_uniform(self) -> None:
        pushes = Pushes(DomainRand(push_interval_s=0.1), 2000, 0.02)
        pushes.reset(np.random.default_rng(0), np.arange(2000))
        times, counts = np.unique(pushes.steps_until_push, return_counts=True)
        assert times.tolist() == [1, 2, 3, 4, 5]
        np.testing.assert_allclose(counts, 400, rtol=0.15)

    def test_reset_samples_a_new_push_time(self) -> None:
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
    return MapTerrain(generate(MapConfig(rows=3, seed=5)))


@pytest.fixture(scope="module")
def plane_scene(quadruped, nominal_task):
    return build_scene(quadruped, Plane(), nominal_task())


def drawn(robot, scene, ground, settings, origins, seed=0):
    rng = np.random.default_rng(seed)
    return sample_reset_state(rng, origins, scene, robot, ground, settings)


def deepest(env, qpos, down=0.0):
    """Return the clearance of a robot that is lowered by `down`, negative in the ground [m]."""
    data = mujoco.MjData(env.scene.model)
    data.qpos[:] = qpos
    data.qpos[2] -= down
    mujoco.mj_forward(env.scene.model, data)
    return min([contact.dist for contact in data.contact], default=0.0)


def everywhere(env):
    """Reset with one robot on every patch of the map."""
    rows, cols = env.terrain.env_origins.shape[:2]
    env.curriculum.levels[:] = np.repeat(np.arange(rows), cols)
    env.curriculum.columns[:] = np.tile(np.arange(cols), rows)
    env.reset()


class TestSampleResetState:
    def test_shapes(self, quadruped, plane_scene):
        qpos, qvel = drawn(
            quadruped, plane_scene, Plane(), InitState(), np.zeros((7, 3), np.float32)
        )
        assert qpos.shape == (7, plane_scene.model.nq)
        assert qvel.shape == (7, plane_scene.model.nv)
        np.testing.assert_allclose(np.linalg.norm(qpos[:, 3:7], axis=1), 1)

    def test_reset_values_fill_their_ranges(self, quadruped, plane_scene):
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

    def test_joints_respect_soft_limits(self, quadruped, plane_scene):
        settings = InitState(reset_range=(0.0, 9.0))
        qpos, _ = drawn(quadruped, plane_scene, Plane(), settings, np.zeros((50, 3), np.float32))
        joints = qpos[:, plane_scene.joint_qpos]
        assert (joints >= quadruped.lower - 1e-6).all()
        assert (joints <= quadruped.upper + 1e-6).all()

    def test_same_seed_gives_same_state(self, quadruped, plane_scene):
        origins = np.zeros((5, 3), np.float32)
        first, second, other = (
            drawn(quadruped, plane_scene, Plane(), InitState(), origins, seed) for seed in (1, 1, 2)
        )
        np.testing.assert_array_equal(first[0], second[0])
        np.testing.assert_array_equal(first[1], second[1])
        assert not np.array_equal(first[0], other[0])

    def test_origins_only_shift_the_position(self, quadruped, plane_scene):
        origins = np.float32([[1, 1, 0], [50, 1, 0]])
        settings = InitState(position=0.0, yaw=0.0, reset_range=(1.0, 1.0))
        qpos, _ = drawn(quadruped, plane_scene, Plane(), settings, origins)
        np.testing.assert_allclose(qpos[:, :2], origins[:, :2])
        np.testing.assert_allclose(qpos[0, 7:], qpos[1, 7:])


class TestResetOnTerrain:
    @pytest.mark.parametrize("name", ["quadruped", "biped"])
    def test_feet_are_on_the_ground_at_origin(self, name, nominal_task, default_ground, request):
        rows, cols = default_ground.env_origins.shape[:2]
        env = LeggedEnv(nominal_task(rows * cols), request.getfixturevalue(name), default_ground)
        everywhere(env)
        np.testing.assert_allclose(
            env.sim.qpos[:, :2], env.curriculum.env_origins[:, :2], atol=1e-6
        )
        for down, touching in ((0.0, False), (0.02, True)):
            found = [deepest(env, qpos, down) < 0 for qpos in env.sim.qpos]
            assert found == [touching] * len(found)

    @pytest.mark.parametrize("name", ["quadruped", "biped"])
    def test_no_geom_is_below_the_ground(self, name, random_task, default_ground, request):
        rows, cols = default_ground.env_origins.shape[:2]
        env = LeggedEnv(random_task(rows * cols), request.getfixturevalue(name), default_ground)
        for _ in range(3):
            everywhere(env)
            depths = np.array([deepest(env, qpos) for qpos in env.sim.qpos])
            assert depths.min() > -0.02, f"{np.mean(depths < -0.02):.0%} are deeper"

    def test_robots_start_beside_the_origin(self, quadruped, random_task, default_ground):
        rows, cols = default_ground.env_origins.shape[:2]
        env = LeggedEnv(random_task(rows * cols), quadruped, default_ground)
        everywhere(env)
        offset = np.abs(env.sim.qpos[:, :2] - env.curriculum.env_origins[:, :2])
        assert (offset <= 0.5 + 1e-6).all()
        assert (offset.max(axis=1) > 0.1).mean() > 0.3

    def test_no_robot_falls_at_once(self, quadruped, random_task, default_ground):
        rows, cols = default_ground.env_origins.shape[:2]
        env = LeggedEnv(random_task(rows * cols), quadruped, default_ground)
        everywhere(env)
        fallen = np.zeros(rows * cols, bool)
        for _ in range(10):
            _, _, dones, _ = env.step(torch.zeros(rows * cols, 12))
            fallen |= dones.numpy()
        assert fallen.mean() < 0.02

import re
import subprocess
import sys
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from terrainkit.errors import ConfigError, MemoryLimitError
from terrainkit_robots.rl.config import Algorithm, DomainRand, Env, Runner, Task
from terrainkit_robots.rl.scene import Scene
from terrainkit_robots.rl.simulation import Simulation, check_env_memory
from terrainkit_robots.rl.terrain import Plane


@pytest.fixture
def sim(cart, nominal_task):
    scene = Scene(cart, Plane(), nominal_task())
    sim = Simulation(scene, 3, 1)
    start = np.tile(scene.default_qpos, (3, 1))
    start[:, 2] = [0.3, 0.5, 0.7]
    sim.reset(np.arange(3), start, np.zeros((3, scene.model.nv)))
    return sim


class TestSimulation:
    def test_step_matches_mj_step(self, sim):
        model = sim.scene.model
        data = mujoco.MjData(model)
        data.qpos[:] = sim.qpos[1]
        for _ in range(5):
            sim.ctrl[:] = 0.1
            sim.step(4)
            data.ctrl[:] = 0.1
            for _ in range(4):
                mujoco.mj_step(model, data)
        np.testing.assert_array_equal(sim.qpos[1], data.qpos)
        np.testing.assert_array_equal(sim.qvel[1], data.qvel)

    def test_reset_of_some_simulations(self, sim):
        sim.step(10)
        untouched = sim.qpos[[0, 2]].copy()
        start = sim.scene.default_qpos.copy()
        start[:3] = (1, 2, 3)
        sim.ctrl[:] = 0.3
        sim.reset(np.array([1]), start[None], np.full((1, sim.scene.model.nv), 0.1))
        np.testing.assert_array_equal(sim.qpos[1], start)
        np.testing.assert_array_equal(sim.qvel[1], 0.1)
        np.testing.assert_array_equal(sim.ctrl[1], 0)
        np.testing.assert_array_equal(sim.qpos[[0, 2]], untouched)


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize(
    ("speed", "share"), [(0, 1), (0.8, 1), (0.95, 0.5), (1.0, 0), (1.5, 0), (-1.5, 1)]
)
def test_torque_falls_to_zero_at_the_speed_limit(quadruped, nominal_task, direction, speed, share):
    scene = Scene(quadruped, Plane(), nominal_task())
    sim = Simulation(scene, 1, 1, quadruped.velocity)
    qpos, qvel = scene.default_qpos[None].copy(), np.zeros((1, scene.model.nv))
    qpos[:, 2] = 5
    qvel[:, scene.joint_qvel] = direction * speed * quadruped.velocity
    sim.reset(np.arange(1), qpos, qvel)
    sim.ctrl[:] = direction * 1000  # the motors give all they can
    sim.step(1)
    np.testing.assert_allclose(sim.torque[0], direction * share * quadruped.effort, rtol=1e-4)


class TestUnstable:
    @pytest.mark.parametrize(
        ("array", "value"), [("ctrl", np.nan), ("qpos", np.inf), ("qvel", 1e12), ("qvel", -1e12)]
    )
    def test_bad_values_are_reported(self, sim, tmp_path, monkeypatch, array, value):
        monkeypatch.chdir(tmp_path)
        getattr(sim, array)[1, -1] = value
        assert sim.step(4).tolist() == [False, True, False]
        assert np.isfinite(sim.qpos).all()
        assert list(tmp_path.iterdir()) == []  # no log of MuJoCo


class TestApplyParamsToEnv:
    @pytest.fixture
    def varied(self, nominal_env, cart):
        wide = {"friction": (0.2, 1.5), "added_mass": (-0.07, 0.14), "motor_strength": (0.7, 1.3)}
        varied = DomainRand(**wide, com_shift=0.05, gains=(0.5, 1.5))
        return nominal_env(5, robot=cart, domain_rand=varied)

    def test_params_reach_every_simulation(self, varied):
        scene, found = varied.scene, varied.params
        nominal, base, hinge, wheel = scene.model, scene.base, 1, 0
        for k in range(5):
            model = varied.sim.batch.get_model(k)
            mass = nominal.body_mass[base] + found.added_mass[k, 0]
            assert model.body_mass[base] == pytest.approx(mass)
            subtree = nominal.body_subtreemass[base] + found.added_mass[k, 0]
            assert model.body_subtreemass[base] == pytest.approx(subtree)  # a derived constant
            inertia = nominal.body_inertia[base] * mass / nominal.body_mass[base]
            np.testing.assert_allclose(model.body_inertia[base], inertia)
            center = nominal.body_ipos[base] + found.com_shift[k]
            np.testing.assert_allclose(model.body_ipos[base], center)
            np.testing.assert_allclose(model.geom_friction[scene.geoms, 0], found.friction[k, 0])
            for name, own in (("body_mass", base), ("geom_friction", scene.geoms)):
                others = [np.delete(getattr(each, name), own, axis=0) for each in (model, nominal)]
                np.testing.assert_array_equal(*others)
            np.testing.assert_array_equal(model.geom_friction[:, 1:], nominal.geom_friction[:, 1:])
            kp = 20 * found.stiffness[k, hinge] * found.strength[k, 0]
            kd = 1.5 * found.damping[k, hinge] * found.strength[k, 0]
            np.testing.assert_allclose(model.actuator_gainprm[hinge, 0], kp, rtol=1e-6)
            np.testing.assert_allclose(model.actuator_biasprm[hinge, :3], [0, -kp, -kd], rtol=1e-6)
            kd = 0.4 * found.damping[k, wheel] * found.strength[k, 0]
            np.testing.assert_allclose(model.actuator_gainprm[wheel, 0], kd, rtol=1e-6)
            np.testing.assert_allclose(model.actuator_biasprm[wheel, :3], [0, 0, -kd], rtol=1e-6)

    def test_negative_base_mass_is_rejected(self, nominal_env, cart, tmp_path, monkeypatch):
        # The base weighs 4 of 5.3 kg; it would have a positive mass in some environments.
        monkeypatch.chdir(tmp_path)
        with pytest.raises(ConfigError, match="added_mass") as caught:
            nominal_env(9, robot=cart, domain_rand=DomainRand(added_mass=(-1.5, 1.0)))
        assert "\n" not in str(caught.value)
        assert list(tmp_path.iterdir()) == []


MEASURED = """
import re
from pathlib import Path
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.spec.robot_arrays import Robot
from terrainkit_robots.rl.runner import LeggedRunner
from terrainkit_robots.rl.config import Algorithm, Env, Runner, Task, Terrain

def peak():
    status = Path("/proc/self/status").read_text()  # ru_maxrss includes the parent process
    return 1024 * int(re.search(r"VmHWM:\\s*(\\d+) kB", status)[1])

robot, peaks = Robot.load(get_task("quadruped").folder), []
once = {"algorithm": Algorithm(num_learning_epochs=1), "runner": Runner(num_steps_per_env=12)}
for count in (32, 256):
    env = Env(num_envs=count, num_threads=1)
    task = Task(env=env, terrain=Terrain(measure_heights=True), **once)
    LeggedRunner(LeggedEnv(task, robot, Plane())).learn(1)
    peaks.append(peak())
print((peaks[1] - peaks[0]) / (256 - 32))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="reads the peak memory from /proc")
def test_memory_estimate_matches_measurement(quadruped, monkeypatch):
    run = subprocess.run(
        [sys.executable, "-c", MEASURED],
        env={"PYTHONPATH": ":".join(filter(None, sys.path)), "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    needed = []
    monkeypatch.setattr(
        "terrainkit_robots.rl.simulation.check_memory", lambda each, *_: needed.append(each)
    )
    task = Task(env=Env(num_envs=1000), runner=Runner(num_steps_per_env=12))
    check_env_memory(task, quadruped, points=187, history=0, ngeom=50)
    assert 0.7 < needed[0] / 1000 / float(run.stdout) < 2.0


def test_check_env_memory_names_the_setting(quadruped, monkeypatch):
    monkeypatch.setattr("terrainkit.files.memory.free_memory", lambda: 1 << 30)
    task = Task(env=Env(num_envs=40_000), algorithm=Algorithm(symmetry=False))
    message = r"training with env\.num_envs 40000, 0\.\d+ MB each, needs .* GB of memory"
    with pytest.raises(MemoryLimitError, match=message) as caught:
        check_env_memory(task, quadruped, points=0, history=0, ngeom=50)
    (hint,) = re.findall(r"env\.num_envs (\d+) would fit$", str(caught.value))
    assert int(hint) > 5000
    check_env_memory(
        replace(task, env=Env(num_envs=int(hint))), quadruped, points=0, history=0, ngeom=50
    )

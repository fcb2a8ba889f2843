import mujoco
import numpy as np
import pytest

from terrainkit_robots.simulation.gain import Gain
from terrainkit_robots.simulation.pd_gains import suggest_gains
from terrainkit_robots.simulation.sim_model import make_sim_model
from terrainkit_robots.simulation.time_step import (
    joint_inertia,
    max_stable_stiffness,
    max_stable_time_step,
    min_stable_inertia,
)
from tests.robots import PENDULUM

INERTIA = 0.01 + 2 * 0.5**2


@pytest.fixture
def pendulum(robot):
    return make_sim_model(robot(PENDULUM))


@pytest.fixture
def quadruped(bundled):
    facts = bundled("quadruped.urdf")
    return make_sim_model(facts), suggest_gains(facts)


def gain(stiffness, damping, armature=0.0):
    return Gain(stiffness=stiffness, damping=damping, armature=armature, reason="")


def test_joint_inertia_of_pendulum(pendulum):
    assert vars(joint_inertia(pendulum)["j"]) == pytest.approx({"free": INERTIA, "locked": INERTIA})


def test_joint_inertia_matches_impulse_response(quadruped):
    sim, _ = quadruped
    data = mujoco.MjData(sim.model)
    model = sim.model.__copy__()
    model.opt.gravity[:] = 0
    model.dof_damping[:] = model.dof_frictionloss[:] = 0
    model.geom_contype[:] = model.geom_conaffinity[:] = 0
    for name in ("FL_hip_joint", "RR_calf_joint"):
        dof = model.joint(name).dofadr[0]
        data.qpos[:] = sim.standing_qpos
        data.qfrc_applied[:] = 0
        data.qfrc_applied[dof] = 1.0
        mujoco.mj_forward(model, data)
        assert 1 / data.qacc[dof] == pytest.approx(joint_inertia(sim)[name].free, rel=1e-6)


def test_min_stable_inertia_inverts_max_stable_stiffness():
    assert min_stable_inertia(max_stable_stiffness(0.02)) == pytest.approx(0.02)


@pytest.mark.parametrize(("stiffness", "damping"), [(100.0, 3.0), (0.0, 5.0), (1000.0, 0.0)])
def test_max_stable_time_step_of_one_joint(pendulum, stiffness, damping):
    step = max_stable_time_step(pendulum, {"j": gain(stiffness, damping)})
    # 4 m - 2 h d - h^2 k = 0
    roots = np.roots([stiffness, 2 * damping, -4 * INERTIA])
    expected = min(root for root in roots if root > 0)
    assert (step.seconds, step.joint) == (pytest.approx(expected, rel=1e-6), "j")


def test_max_stable_time_step_includes_armature(pendulum):
    bare = max_stable_time_step(pendulum, {"j": gain(0.0, 5.0)}).seconds
    more = max_stable_time_step(pendulum, {"j": gain(0.0, 5.0, armature=INERTIA)}).seconds
    assert more == pytest.approx(2 * bare)


def test_max_stable_time_step_without_gains(pendulum):
    assert max_stable_time_step(pendulum, {}).seconds == np.inf
    assert max_stable_time_step(pendulum, {"j": gain(0.0, 0.0)}).joint == ""


@pytest.mark.parametrize(("factor", "grows"), [(0.98, False), (1.02, True)])
def test_max_stable_time_step_separates_stable_from_unstable(quadruped, factor, grows):
    sim, gains = quadruped
    step = factor * max_stable_time_step(sim, gains).seconds
    model = sim.model.__copy__()
    for name, each in gains.items():
        model.dof_armature[model.joint(name).dofadr[0]] = each.armature
    data = mujoco.MjData(model)
    data.qpos[:] = sim.standing_qpos
    mujoco.mj_forward(model, data)
    inverse = np.zeros((model.nv, model.nv))
    mujoco.mj_solveM(model, data, inverse, np.eye(model.nv))
    stiffness = np.array([0.0] * 6 + [gains[name].stiffness for name in sim.joints])
    damping = np.array([0.0] * 6 + [gains[name].damping for name in sim.joints])
    speed, place = np.zeros(model.nv), np.zeros(model.nv)
    place[6:] = 1e-3 * np.cos(np.arange(12))
    for _ in range(3000):
        speed = speed - step * inverse @ (stiffness * place + damping * speed)
        place = place + step * speed
    assert (np.abs(place[6:]).max() > 1) == grows

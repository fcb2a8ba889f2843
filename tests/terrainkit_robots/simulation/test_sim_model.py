import re

import mujoco
import numpy as np
import pytest

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.simulation.sim_model import TIME_STEP, SimModel, make_sim_model
from tests import small_robots
from tests.robots import BUNDLED, PENDULUM
from tests.small_robots import link

BASES = {"quadruped": "base", "biped": "pelvis"}


@pytest.fixture(params=BUNDLED)
def facts(request, bundled):
    return bundled(request.param)


def test_sim_model_has_names_of_robot(facts):
    sim = make_sim_model(facts)
    assert make_sim_model(facts) is sim
    again = SimModel.from_mujoco(sim.model, base=sim.base)
    assert (again.joints, again.actuated, again.floating) == (sim.joints, sim.actuated, True)
    assert sim.base == BASES[facts.model.name]
    assert sim.actuated == tuple(joint.name for joint in facts.actuated)
    assert set(sim.joints) == {joint.name for joint in facts.joints if joint.moves}
    assert sim.model.nq == 7 + len(sim.joints)
    for joint in facts.actuated:
        assert sim.model.joint(joint.name).range == pytest.approx(joint.range)


def test_sim_model_has_mass_of_robot(facts):
    model = make_sim_model(facts).model
    assert model.body_subtreemass[0] == pytest.approx(facts.total_mass)
    assert model.opt.timestep == TIME_STEP
    assert ((model.geom_contype != 0) | (model.geom_conaffinity != 0)).all()  # of collisions only


def test_sim_model_stands_on_the_floor(facts):
    sim = make_sim_model(facts)
    model, data = sim.model, mujoco.MjData(sim.model)
    data.qpos[:] = sim.standing_qpos
    with quiet_mujoco():
        mujoco.mj_forward(model, data)
    (floor,) = (k for k in range(model.ngeom) if model.geom_type[k] == mujoco.mjtGeom.mjGEOM_PLANE)
    heights = [
        mujoco.mj_geomDistance(model, data, floor, geom, 10.0, None)
        for geom in range(model.ngeom)
        if geom != floor
    ]
    assert min(heights) == pytest.approx(0, abs=1e-3)
    assert sim.standing_qpos[2] == pytest.approx(facts.stance.height)
    placed = dict(zip(sim.joints, sim.standing_qpos[7:], strict=True))
    assert placed == pytest.approx({name: facts.default_pose[name] for name in sim.joints})


def test_sim_model_has_effort_limits(facts):
    sim = make_sim_model(facts)
    assert not sim.model.actuator_gainprm[:, 0].any()
    for joint in facts.actuated:
        actuator = sim.model.actuator(joint.name)
        assert actuator.forcerange[1] == pytest.approx(joint.limit.effort)


def test_qpos_at_keeps_other_positions(facts):
    sim = make_sim_model(facts)
    expected = sim.standing_qpos.copy()
    expected[7] = 0.123
    moved = sim.qpos_at({sim.joints[0]: 0.123, "no such joint": 9.0})
    np.testing.assert_array_equal(moved, expected)


def test_sim_model_with_fixed_base_has_no_floor(robot):
    sim = make_sim_model(robot(PENDULUM))
    assert not sim.floating
    assert (sim.model.ngeom, len(sim.standing_qpos)) == (0, 1)


@pytest.mark.parametrize("name", ["bob", "it's, id 7, line 3", "n" * 5000])
def test_sim_model_error_is_one_line(robot, name):
    text = PENDULUM.replace('ixx="0.01"', 'ixx="1.0"').replace('"bob"', f'"{name}"')
    with pytest.raises(CannotCheckError) as caught:
        make_sim_model(robot(text))
    error = str(caught.value)
    assert error.startswith(f"MuJoCo cannot simulate it: {name[:50]}")
    assert error.endswith(": inertia must satisfy A + B >= C; use 'balanceinertia' to fix")
    assert not re.search(r"\n|Element", error)
    assert len(error) < 300


def test_sim_model_rejects_many_bodies():
    parts = [small_robots.joint(f"l{k}", f"l{k + 1}", limits=(-1, 1)) for k in range(300)]
    links = [link(f"l{k}", mass=None) for k in range(301)]
    with pytest.raises(CannotCheckError, match="mass and inertia of moving bodies"):
        make_sim_model(small_robots.facts(*links[:-1], *parts[:-1]))
    with pytest.raises(CannotCheckError, match="bodies: got 301; expected at most 300"):
        make_sim_model(small_robots.facts(*links, *parts))

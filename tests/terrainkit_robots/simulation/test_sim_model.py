import mujoco
import numpy as np
import pytest

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.simulation.sim_model import TIME_STEP, SimModel, make_sim_model

ROBOTS = [(name, suffix) for name in bundled.robot_names() for suffix in (".urdf", ".xml")]
BASES = {"quadruped": "base", "biped": "pelvis"}

ARM = """
<robot name="arm">
  <link name="pole"/>
  <link name="{name}">
    <inertial><origin xyz="0.1 0 0"/><mass value="1"/>
      <inertia ixx="{ixx}" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="shoulder" type="revolute">
    <parent link="pole"/><child link="{name}"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="{effort}" velocity="10"/>
  </joint>
</robot>
"""


@pytest.fixture(params=ROBOTS, ids=lambda robot: "".join(robot))
def facts(request):
    name, suffix = request.param
    return Facts(load_robot(bundled.urdf_path(name).with_suffix(suffix)))


@pytest.fixture
def arm(tmp_path):
    def write(name="arm", ixx="0.01", effort="5"):
        path = tmp_path / "robot.urdf"
        path.write_text(ARM.format(name=name, ixx=ixx, effort=effort))
        return Facts(load_robot(path))

    return write


def test_sim_model_has_names_of_robot(facts):
    sim = make_sim_model(facts)
    assert sim.floating
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


def test_sim_model_has_only_collision_shapes(facts):
    model = make_sim_model(facts).model
    assert ((model.geom_contype != 0) | (model.geom_conaffinity != 0)).all()


def test_sim_model_is_cached(facts):
    assert make_sim_model(facts) is make_sim_model(facts)
    again = SimModel.from_mujoco(make_sim_model(facts).model, base=make_sim_model(facts).base)
    assert (again.joints, again.actuated) == (
        make_sim_model(facts).joints,
        make_sim_model(facts).actuated,
    )


def test_qpos_at_keeps_other_positions(facts):
    sim = make_sim_model(facts)
    first, *others = sim.joints
    moved = sim.qpos_at({first: 0.123, "no such joint": 9.0})
    assert moved[7] == 0.123
    np.testing.assert_array_equal(moved[8:], sim.standing_qpos[8:])
    np.testing.assert_array_equal(moved[:7], sim.standing_qpos[:7])
    assert len(others) == len(moved) - 8


def test_sim_model_with_fixed_base_has_no_floor(arm):
    sim = make_sim_model(arm())
    assert not sim.floating
    assert sim.model.ngeom == 0
    assert len(sim.standing_qpos) == 1


@pytest.mark.parametrize("name", ["arm", "it's, id 7, line 3", "n" * 5000])
def test_sim_model_error_is_one_line(arm, name):
    with pytest.raises(CannotCheckError) as caught:
        make_sim_model(arm(name=name, ixx="1.0"))
    error = str(caught.value)
    assert error.startswith(f"MuJoCo cannot simulate it: {name[:50]}")
    assert error.endswith(": inertia must satisfy A + B >= C; use 'balanceinertia' to fix")
    assert "\n" not in error
    assert "Element" not in error
    assert len(error) < 300


def test_sim_model_rejects_many_bodies(tmp_path):
    parts = [
        f'<link name="l{k}"/><joint name="j{k}" type="revolute"><parent link="l{k - 1}"/>'
        f'<child link="l{k}"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        for k in range(1, 400)
    ]
    path = tmp_path / "robot.urdf"
    path.write_text(f'<robot name="r"><link name="l0"/>{"".join(parts)}</robot>')
    with pytest.raises(CannotCheckError, match="bodies: got 400; expected at most 300"):
        make_sim_model(Facts(load_robot(path)))

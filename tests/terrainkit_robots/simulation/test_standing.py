import math
from functools import cache

import pytest

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.fixes.apply import fix_robot
from terrainkit_robots.lint.selection import lint_selected
from terrainkit_robots.lint.settings import Settings
from terrainkit_robots.mesh.mesh_cache import Meshes
from terrainkit_robots.simulation.pd_gains import suggest_gains
from terrainkit_robots.simulation.sim_model import make_sim_model
from terrainkit_robots.simulation.standing import contact_areas, stand_test

QUADRUPEDS = ["a1/urdf/a1.urdf", "go2/urdf/go2.urdf", "go2_mjcf/go2.xml"]
BIPEDS = ["h1/h1.xml", "g1/g1_29dof.urdf"]


@cache
def read(path):
    return Facts(load_robot(path))


def facts_of(name, robot_file):
    return read(robot_file(name))


def stand(facts, **keys):
    keys = {"positions": facts.default_pose, "areas": contact_areas(facts)} | keys
    return stand_test(make_sim_model(facts), suggest_gains(facts), **keys)


def check(standing):
    assert not standing.diverged
    assert standing.seconds == pytest.approx(5)
    assert standing.tilt <= standing.max_tilt < math.radians(3)
    assert standing.other_contacts == ()


@pytest.mark.parametrize("name", [*QUADRUPEDS, "quadruped.urdf", "quadruped.xml"])
def test_stand_test_of_quadrupeds(name, robot_file):
    facts = facts_of(name, robot_file)
    standing = stand(facts, seconds=5)
    check(standing)
    assert 0 < standing.height_loss < 0.1 * facts.stance.height
    assert standing.drift < 0.05
    assert 0 < standing.saturation < 0.5
    assert standing.height + standing.height_loss == pytest.approx(facts.stance.height, abs=1e-3)


def test_stand_test_of_repaired_anymal_c(robot_file):
    path = robot_file("anymal_c/urdf/anymal_c.urdf")

    def look(contents):
        facts = Facts(load_robot(path, contents=contents), Meshes(contents))
        return lint_selected(facts, Settings(simulate=False), contents)

    check(stand(fix_robot(path, look, unsafe=True).report.facts, seconds=5))


@pytest.mark.parametrize("name", [*BIPEDS, "biped.urdf", "biped.xml"])
def test_stand_test_of_bipeds_with_locked_joints(name, robot_file):
    standing = stand(facts_of(name, robot_file), seconds=5, joints_locked=True)
    check(standing)
    assert standing.joint_error < 1e-4
    assert standing.saturation == 0


def test_stand_test_of_biped_falls():
    standing = stand(read(bundled.urdf_path("biped")))
    assert standing.tilt > 0.5
    assert "pelvis" in standing.other_contacts


def test_stand_test_is_reproducible():
    facts = read(bundled.urdf_path("quadruped"))
    model = make_sim_model(facts).model
    before = model.actuator_gainprm.copy(), model.dof_armature.copy()
    first = stand(facts)
    assert first == stand(facts)
    assert first.seconds == pytest.approx(2)
    assert (model.actuator_gainprm == before[0]).all()
    assert (model.dof_armature == before[1]).all()


def test_stand_test_with_stiffer_gains_sinks_less():
    facts = read(bundled.urdf_path("quadruped"))
    stiff = {
        name: type(gain)(
            stiffness=3 * gain.stiffness, damping=2 * gain.damping, armature=0.02, reason=""
        )
        for name, gain in suggest_gains(facts).items()
    }
    standing = stand_test(
        make_sim_model(facts), stiff, positions=facts.default_pose, areas=contact_areas(facts)
    )
    assert standing.height_loss < 0.5 * stand(facts).height_loss
    largest = max(abs(torque) for torque in facts.stance.torques.values())
    assert standing.joint_error == pytest.approx(
        largest / stiff["FL_calf_joint"].stiffness, rel=0.3
    )


def test_stand_test_reports_knee_contacts():
    facts = read(bundled.urdf_path("quadruped").with_suffix(".xml"))
    limp = {
        name: type(gain)(stiffness=1.0, damping=1.0, armature=gain.armature, reason="")
        for name, gain in suggest_gains(facts).items()
    }
    standing = stand_test(
        make_sim_model(facts), limp, positions=facts.default_pose, areas=contact_areas(facts)
    )
    assert standing.height_loss > 0.15
    assert {"FL_calf", "RR_calf"} & set(standing.other_contacts)
    assert not {"FL_foot", "RR_foot"} & set(standing.other_contacts)


def test_stand_test_without_areas_reports_feet():
    facts = read(bundled.urdf_path("quadruped"))
    assert "FL_foot" in stand(facts, areas=()).other_contacts


def test_contact_areas_of_foot_and_shank():
    facts = read(bundled.urdf_path("quadruped"))
    holds = {hold.body: hold for hold in contact_areas(facts)}
    assert math.isinf(holds["FL_foot"].radius)
    assert 0.05 < holds["FL_calf"].radius < 0.213
    assert holds["FL_calf"].center == pytest.approx((0, 0, -0.22), abs=0.03)


def test_stand_test_rejects_fixed_base(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(
        """<robot name="arm"><link name="pole"/><link name="arm"><inertial><mass value="1"/>
        <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="j" type="revolute"><parent link="pole"/><child link="arm"/>
        <limit lower="-1" upper="1" effort="10" velocity="10"/></joint></robot>"""
    )
    with pytest.raises(CannotCheckError, match="does not stand"):
        stand(Facts(load_robot(path)))

import math
from dataclasses import replace

import numpy as np
import pytest

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.simulation.pd_gains import suggest_gains
from terrainkit_robots.simulation.sim_model import make_sim_model
from terrainkit_robots.simulation.standing import contact_areas, ground_normal, stand_test
from tests.robots import PENDULUM
from tests.tables import read_table


def stand(facts, gains=None, **keys):
    keys = {"positions": facts.default_pose, "areas": contact_areas(facts)} | keys
    return stand_test(make_sim_model(facts), gains or suggest_gains(facts), **keys)


def check(standing):
    assert not standing.diverged
    assert standing.seconds == pytest.approx(5)
    assert standing.tilt <= standing.max_tilt < math.radians(3)
    assert standing.other_contacts == ()


@pytest.mark.parametrize("name", ["quadruped.urdf", "quadruped.xml"])
def test_stand_test_of_quadrupeds(bundled, name):
    facts = bundled(name)
    standing = stand(facts, seconds=5)
    check(standing)
    assert 0 < standing.height_loss < 0.1 * facts.stance.height
    assert standing.drift < 0.05
    assert 0 < standing.saturation < 0.5
    assert standing.height + standing.height_loss == pytest.approx(facts.stance.height, abs=1e-3)


@pytest.mark.parametrize("name", ["biped.urdf", "biped.xml"])
def test_stand_test_of_bipeds_with_locked_joints(bundled, name):
    standing = stand(bundled(name), seconds=5, joints_locked=True)
    check(standing)
    assert standing.joint_error < 1e-4
    assert standing.saturation == 0


def test_stand_test_of_biped_falls(bundled):
    standing = stand(bundled("biped.urdf"))
    assert standing.tilt > 0.5
    assert "pelvis" in standing.other_contacts


def test_stand_test_is_reproducible(bundled):
    facts = bundled("quadruped.urdf")
    model = make_sim_model(facts).model
    before = model.actuator_gainprm.copy(), model.dof_armature.copy()
    first = stand(facts)
    assert first == stand(facts)
    assert first.seconds == pytest.approx(2)
    assert (model.actuator_gainprm == before[0]).all()
    assert (model.dof_armature == before[1]).all()


def test_stand_test_reports_knee_contacts(bundled):
    facts = bundled("quadruped.xml")
    gains = suggest_gains(facts).items()
    standing = stand(facts, {k: replace(each, stiffness=1.0, damping=1.0) for k, each in gains})
    assert standing.height_loss > 0.15
    assert {"FL_thigh", "RR_thigh"} <= set(standing.other_contacts)
    assert not {"FL_foot", "RR_foot"} & set(standing.other_contacts)


def test_stand_test_without_areas_reports_feet(bundled):
    facts = bundled("quadruped.urdf")
    assert "FL_foot" in stand(facts, areas=()).other_contacts


def test_contact_areas_of_foot_and_shank(bundled):
    facts = bundled("quadruped.urdf")
    holds = {hold.body: hold for hold in contact_areas(facts)}
    assert math.isinf(holds["FL_foot"].radius)
    assert 0.05 < holds["FL_calf"].radius < 0.213
    assert holds["FL_calf"].center == pytest.approx((0, 0, -0.22), abs=0.03)


def test_stand_test_rejects_fixed_base(robot):
    with pytest.raises(CannotCheckError, match="does not stand"):
        stand(robot(PENDULUM))


@pytest.mark.parametrize("name", ["biped.urdf", "quadruped.urdf"])
def test_soles_of_bundled_robots_are_level(bundled, name):
    assert ground_normal(bundled(name)) == pytest.approx([0, 0, 1], abs=1e-6)


def test_locked_robot_settles_on_its_soles(bundled):
    # With the ground 1 degree off its soles, the robot tilts by this degree.
    tilt = math.radians(1)
    normal = np.array([math.sin(tilt), 0, math.cos(tilt)])
    standing = stand(bundled("biped.urdf"), joints_locked=True, ground_normal=normal)
    assert standing.tilt == pytest.approx(tilt, abs=math.radians(0.2))
    assert standing.other_contacts == standing.lifted_feet == ()


def test_ground_normal_of_inclined_soles(robot):
    # Two boxes that are turned by 0.05 rad about y, without joints to level them.
    leg = read_table(__file__, "leg")
    legs = leg.format(s="left", y=0.1) + leg.format(s="right", y=-0.1)
    base = """<link name="base"><inertial><mass value="5"/>
      <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
    facts = robot(f'<robot name="r">{base}{legs}</robot>')
    assert len(facts.legs) == 2
    assert ground_normal(facts) == pytest.approx([math.sin(0.05), 0, math.cos(0.05)], abs=1e-3)

import numpy as np
import pytest

from terrainkit_robots.onboarding.derive_spec.derive import derive_spec
from terrainkit_robots.spec.robot_spec import RobotSpec

SLIDE = """
<robot name="r">
  <link name="base"/><link name="one"/><link name="two"/>
  <joint name="a" type="revolute"><parent link="base"/><child link="one"/><axis xyz="0 0 1"/>
    <limit lower="0.5" upper="2.5" effort="1" velocity="1"/></joint>
  <joint name="b" type="revolute"><parent link="one"/><child link="two"/><axis xyz="0 0 1"/>
    <limit lower="-9" upper="9" effort="1" velocity="1"/><mimic joint="a" multiplier="-2"/></joint>
</robot>"""


def changed(spec, **values):
    fields = {name: getattr(spec, name) for name in RobotSpec.__dataclass_fields__}
    return RobotSpec(**(fields | values))


def test_positions_of_spec_define_stance(bundled, gains):
    plain = bundled("quadruped.urdf")
    spec = derive_spec(plain, gains=gains(plain), floating=True)
    low = {".*_hip_joint": 0.1, ".*_thigh_joint": 1.2, ".*_calf_joint": -2.4}
    facts = bundled("quadruped.urdf", spec=changed(spec, default_pose=low))
    assert facts.default_pose["FL_thigh_joint"] == facts.stance.positions["FL_thigh_joint"] == 1.2
    assert facts.stance.height < plain.stance.height - 0.1


def test_positions_missing_in_spec_are_solved(bundled, gains):
    plain = bundled("quadruped.urdf")
    spec = derive_spec(plain, gains=gains(plain), floating=True)
    facts = bundled("quadruped.urdf", spec=changed(spec, default_pose={"FL_hip_joint": 0.2}))
    expected = dict(plain.default_pose) | {"FL_hip_joint": 0.2}
    assert facts.default_pose == expected
    nothing = bundled("quadruped.urdf", spec=changed(spec, default_pose={"(": 1.0, "x": 2.0}))
    assert nothing.default_pose == plain.default_pose


def test_positions_of_mimic_joints_follow_spec(robot, spec):
    facts = robot(SLIDE, spec=spec(joint_order=("a",), default_pose={"a": 1.0}))
    assert facts.default_pose == {"a": 1.0, "b": -2.0}


def test_positions_of_spec_may_exceed_limits(robot, spec):
    facts = robot(SLIDE, spec=spec(joint_order=("a",), default_pose={"a": 3.0}))
    assert facts.default_pose["a"] == 3.0


@pytest.mark.parametrize("name", ["quadruped.urdf", "biped.xml"])
def test_positions_of_derived_spec_equal_solved_pose(bundled, gains, name):
    plain = bundled(name)
    facts = bundled(name, spec=derive_spec(plain, gains=gains(plain), floating=True))
    np.testing.assert_allclose(
        [facts.default_pose[name] for name in plain.default_pose],
        list(plain.default_pose.values()),
        atol=1e-5,
    )


CHAIN = """
<robot name="r">
  <link name="l0"/><link name="l1"/><link name="l2"/><link name="l3"/>
  <joint name="jC" type="prismatic"><parent link="l0"/><child link="l1"/>
    <limit lower="-9" upper="9" effort="1" velocity="1"/><mimic joint="jB" multiplier="-2"/></joint>
  <joint name="jB" type="prismatic"><parent link="l1"/><child link="l2"/>
    <limit lower="-9" upper="9" effort="1" velocity="1"/><mimic joint="jA" offset="0.5"/></joint>
  <joint name="jA" type="prismatic"><parent link="l2"/><child link="l3"/>
    <limit lower="1" upper="2" effort="1" velocity="1"/></joint>
</robot>"""


def test_positions_of_chained_mimic_joints(robot, spec):
    assert robot(CHAIN).default_pose == {"jA": 1.0, "jB": 1.5, "jC": -3.0}
    specified = robot(CHAIN, spec=spec(joint_order=("jA",), default_pose={"jA": 2.0}))
    assert specified.default_pose == {"jA": 2.0, "jB": 2.5, "jC": -5.0}

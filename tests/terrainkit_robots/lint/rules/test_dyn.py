import math
import re
from dataclasses import replace

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.rule import get_rule
from terrainkit_robots.lint.rules.dyn import stability

GRIPPER = """
<robot name="gripper">
  <link name="pole">
    <inertial><mass value="5"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  {fingers}
</robot>
"""

FINGER = """
  <link name="{side}">
    <inertial><mass value="1e-4"/>
      <inertia ixx="1e-8" iyy="1e-8" izz="1e-8" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size="20 20 20"/></geometry></collision>
  </link>
  <joint name="{side}_joint" type="prismatic">
    <parent link="pole"/><child link="{side}"/><origin xyz="0.1 {y} 0"/>
    <axis xyz="0 1 0"/><limit lower="-300" upper="300" effort="1" velocity="10"/>
  </joint>
"""

LIFT = """
<robot name="lift">
  <link name="pole"/>
  <link name="tray"><inertial><mass value="1"/>
    <inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="lift" type="prismatic">
    <parent link="pole"/><child link="tray"/><axis xyz="0 0 1"/>
    <limit lower="-0.1" upper="0.1" effort="5" velocity="10"/>
  </joint>
</robot>
"""


def check(code, path):
    return list(get_rule(code).findings(Facts(load_robot(path))))


@pytest.fixture
def robot(tmp_path):
    def write(text):
        path = tmp_path / "robot.urdf"
        path.write_text(text)
        return path

    return write


def test_unstable_drop_units_of_sliding_joint(robot):
    fingers = "".join(FINGER.format(side=side, y=y) for side, y in (("left", 0.1), ("right", -0.1)))
    (violation,) = check("DYN001", robot(GRIPPER.format(fingers=fingers)))
    assert " m/s at " in violation.message
    assert "expected at most 100 m/s; without self-collision" in violation.message
    assert "rad" not in violation.message


@pytest.mark.parametrize(
    ("tilt", "lifted", "severity"),
    [(2, (), None), (5, (), "note"), (12, (), "warning"), (5, ("toe",), "warning")],
)
def test_does_not_stand_severity(monkeypatch, stood, tilt, lifted, severity):
    standing_with = replace(stood, tilt=math.radians(tilt), lifted_feet=lifted)
    monkeypatch.setattr(stability, "stand_test", lambda *_, **__: standing_with)
    violations = check("DYN002", bundled.urdf_path("quadruped"))
    assert [violation.severity for violation in violations] == ([severity] if severity else [])
    assert all("tilts by" in violation.message for violation in violations)


def test_unreachable_limits_counts_blocked_joints():
    (violation,) = check("DYN003", bundled.urdf_path("quadruped"))
    assert violation.message.startswith(
        "6 of 12 joints collide before reaching a limit when moved alone from the default pose; "
        "worst: "
    )
    assert " rad, where " in violation.message


def test_unreachable_limits_units_of_sliding_joint(robot):
    (violation,) = check("DYN003", robot(LIFT))
    assert violation.message == (
        "1 of 1 joint too weak to lift the limb over the whole range; worst: lift, which needs "
        "9.81 N with an effort limit of 5 N"
    )


def test_low_joint_inertia_units_of_sliding_joint(sliding_shanks):
    (violation,) = check("DYN004", sliding_shanks)
    assert re.search(r"_calf_joint \(kp .*, mass 0\.[0-9]+ kg\): got ", violation.message)
    assert re.search(r"an armature of [0-9.]+ kg; the same applies to ", violation.message)


def test_low_joint_inertia_counts_other_joints():
    (violation,) = check("DYN004", bundled.urdf_path("quadruped"))
    others = violation.measured["joints"] - 1
    assert others > 1
    assert violation.message.endswith(f" kg m2; the same applies to {others} other joints")

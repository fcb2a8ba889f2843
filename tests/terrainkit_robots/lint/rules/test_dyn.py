import math
from dataclasses import replace

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.rule import get_rule
from terrainkit_robots.simulation import standing

TWEEZERS = """
<robot name="tweezers">
  <link name="pole">
    <inertial><mass value="5"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  {jaws}
</robot>
"""

JAW = """
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

SLIDER = """
<robot name="gantry">
  <link name="pole"/>
  <link name="tray"><inertial><mass value="1"/>
    <inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="lift" type="prismatic">
    <parent link="pole"/><child link="tray"/><axis xyz="0 0 1"/>
    <limit lower="-0.1" upper="0.1" effort="5" velocity="10"/>
  </joint>
</robot>
"""


def found(code, path):
    return list(get_rule(code).check(Facts(load_robot(path))))


@pytest.fixture
def robot(tmp_path):
    def write(text):
        path = tmp_path / "robot.urdf"
        path.write_text(text)
        return path

    return write


def test_a_slide_is_thrown_at_metres_per_second(robot):
    jaws = "".join(JAW.format(side=side, y=y) for side, y in (("left", 0.1), ("right", -0.1)))
    (defect,) = found("DYN001", robot(TWEEZERS.format(jaws=jaws)))
    assert "_joint reached " in defect.message
    assert "wanted at most 100 m/s; without self-collision" in defect.message
    assert "rad" not in defect.message


@pytest.mark.parametrize(
    ("tilt", "lifted", "severity"),
    [(2, (), None), (5, (), "info"), (12, (), "warning"), (5, ("toe",), "warning")],
)
def test_leaning_a_little_is_a_note(monkeypatch, stood, tilt, lifted, severity):
    leant = replace(stood, tilt=math.radians(tilt), lifted=lifted)
    monkeypatch.setattr(standing, "stand_still", lambda *_, **__: leant)
    defects = found("DYN002", bundled.find("quadruped"))
    assert [defect.severity for defect in defects] == ([severity] if severity else [])
    assert all("tilts by" in defect.message for defect in defects)


def test_how_many_joints_meet_others_is_told_of_each_alone():
    (defect,) = found("DYN003", bundled.find("quadruped"))
    assert defect.message.startswith(
        "6 of 12 joints meet another body before their limits, moved one at a time from the "
        "default pose; worst "
    )
    assert " rad: " in defect.message


def test_one_joint_is_one_and_a_slide_needs_newtons(robot):
    (defect,) = found("DYN003", robot(SLIDER))
    assert defect.message == (
        "1 of 1 joint cannot lift what hangs from it all the way; worst lift, which needs 9.81 of "
        "5 N"
    )


def test_a_light_slide_is_told_kilograms(sliding_shanks):
    (defect,) = found("DYN004", sliding_shanks)
    assert "_calf_joint moves 0." in defect.message
    assert " kg, so that explicit PD" in defect.message
    assert " kg is suggested, and one for " in defect.message


def test_other_light_joints_are_counted():
    (defect,) = found("DYN004", bundled.find("quadruped"))
    others = defect.measured["joints"] - 1
    assert others > 1
    assert defect.message.endswith(f" kg m2 is suggested, and one for {others} other joints")

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.check import check_robot
from terrainkit_robots.onboarding.pipeline import OnboardOptions, onboard
from terrainkit_robots.spec.robot import Robot

FILE = Path("/robots/robot.urdf")
CYLINDER = '<cylinder radius="0.1" length="0.05"/>'
"""A shape whose axis is along z. The joints of the legs turn about y."""


def link(name, shape, *, mass=1.0, center="0 0 0", rpy="0 0 0"):
    return f"""<link name="{name}">
      <inertial><origin xyz="{center}"/><mass value="{mass}"/>
        <inertia ixx="0.004" iyy="0.006" izz="0.004" ixy="0" ixz="0" iyz="0"/></inertial>
      <collision><origin xyz="{center}" rpy="{rpy}"/><geometry>{shape}</geometry></collision>
    </link>"""


def joint(parent, child, xyz, kind="revolute", limits="-2 2"):
    lower, upper = limits.split()
    limit = f'<limit lower="{lower}" upper="{upper}" effort="20" velocity="30"/>'
    return f"""<joint name="{child}_joint" type="{kind}">
      <parent link="{parent}"/><child link="{child}"/><origin xyz="{xyz}"/><axis xyz="0 1 0"/>
      {limit}</joint>"""


def wheel_legs(places, *, shape=CYLINDER, rpy="1.5708 0 0", kind="continuous", **wheel):
    """Return the URDF of a robot with a wheel of 0.1 m at the end of each leg."""
    limits = wheel.pop("limits", "0 0")
    text = link("trunk", '<box size="0.5 0.3 0.1"/>', mass=8)
    for number, place in enumerate(places):
        thigh, shank, end = (f"{name}{number}" for name in ("thigh", "shank", "end"))
        for name in (thigh, shank):
            text += link(name, '<box size="0.04 0.04 0.2"/>', center="0 0 -0.1", mass=0.5)
        text += link(end, shape, rpy=rpy, **wheel) + joint("trunk", thigh, place)
        text += joint(thigh, shank, "0 0 -0.2") + joint(shank, end, "0 0 -0.2", kind, limits)
    return f'<robot name="wheels">{text}</robot>'


FOUR = [f"{x} {y} 0" for x in (0.2, -0.2) for y in (0.2, -0.2)]
TWO = ["0 0.2 0", "0 -0.2 0"]


def facts(text):
    return Facts(load_robot(FILE, contents={FILE: text.encode()}))


def last_role(**wheel):
    (role,) = {leg.roles[-1] for leg in facts(wheel_legs(FOUR, **wheel)).legs}
    return role


def test_wheel_is_round_and_turns_without_limits():
    assert last_role() == "wheel"
    assert last_role(shape='<sphere radius="0.1"/>') == "wheel"
    assert last_role(kind="revolute", limits="-1e16 1e16") == "wheel"
    assert last_role(kind="revolute", limits="-6.29 6.29") == "wheel"  # beyond two turns


@pytest.mark.parametrize(
    "end",
    [
        {"kind": "revolute", "limits": "-6.28 6.28"},
        {"center": "0 0 -0.05"},  # the center of a foot below its ankle
        {"shape": '<box size="0.2 0.1 0.04"/>', "rpy": "0 0 0"},
        {"shape": '<box size="0.1 0.05 0.1"/>', "rpy": "0 0 0"},  # square: radii of 1 to 1.41
        {"rpy": "0 0 0"},  # a cylinder across the axis
    ],
)
def test_ankle_is_not_a_wheel(end):
    assert last_role(**end) == "ankle"


def test_foot_without_shapes_is_not_a_wheel():
    text = re.sub(r"<collision>.*?</collision>", "", wheel_legs(TWO), flags=re.S)
    assert [leg.roles[-1] for leg in facts(text).legs] == ["ankle"] * 2


def test_pose_of_legs_with_wheels_about_x():
    text = wheel_legs(FOUR, rpy="0 1.5708 0")
    robot = facts(re.sub(r'(name="end\d_joint.*?xyz=)"0 1 0"', r'\1"1 0 0"', text, flags=re.S))
    assert {leg.roles[-1] for leg in robot.legs} == {"wheel"}
    assert abs(robot.default_pose["shank0_joint"]) > 0.1


def test_leg_ends_at_the_rim_of_the_wheel():
    robot = facts(wheel_legs(FOUR))
    assert [leg.roles for leg in robot.legs] == [("hip", "knee", "wheel")] * 4
    assert [leg.length for leg in robot.legs] == pytest.approx([0.5] * 4, abs=0.01)
    assert {robot.default_pose[f"end{k}_joint"] for k in range(4)} == {0.0}
    assert robot.stance is not None
    # The axis is 0.75 of the length below the hip, less the radius that the wheel adds.
    assert robot.stance.height == pytest.approx(0.375, abs=0.005)


def test_four_wheels_drive_at_the_commanded_speed(tmp_path):
    source = tmp_path / "robot.urdf"
    source.write_text(wheel_legs(FOUR))
    onboard(source, tmp_path / "out", OnboardOptions(render_images=False))
    robot = Robot.load(tmp_path / "out")
    assert robot.wheels.tolist() == [False, False, True] * 4
    assert robot.spec.foot_radius == pytest.approx(0.1, abs=1e-3)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "out/scene.xml"))
    data = mujoco.MjData(model)
    data.qpos[2], data.qpos[7:] = robot.spawn_height, robot.default_pose
    data.ctrl = np.where(robot.wheels, 1.0 / 0.1, robot.default_pose)  # 1 m/s
    mujoco.mj_step(model, data, nstep=1500)
    assert data.qvel[0] == pytest.approx(1.0, abs=0.05)


def test_robot_on_two_wheels_is_not_expected_to_stand():
    report = check_robot(FILE, contents={FILE: wheel_legs(TWO).encode()})
    assert not {"LEG006", "DYN002"} & {finding.code for finding in report.findings}
    skipped = {each.code: each.reason for each in report.skipped}
    assert skipped["DYN002"] == "it balances on its wheels"

import math
from dataclasses import replace

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.onboarding.joint_table import format_number, joint_table
from terrainkit_robots.spec.robot_spec import RobotSpec


def make_spec(order, **changes):
    tables = {
        "default_pose": {".*": 0.5},
        "stiffness": {".*": 20.0},
        "damping": {".*": 0.5},
        "effort": {".*": 30.0},
        "velocity": {".*": 12.25},
        "armature": {".*": 0.01},
        "action_scale": {".*": 0.25},
        "soft_limits": {},
    }
    return RobotSpec(
        name="r",
        urdf="robot.urdf",
        mjcf="robot.xml",
        floating=True,
        joint_order=tuple(order),
        base="base",
        **tables | changes,
    )


@pytest.fixture(scope="module")
def quadruped():
    return Facts(load_robot(bundled.urdf_path("quadruped")))


def arm(kind, limits):
    text = f"""<robot name="arm"><link name="base"/><link name="tip"/>
    <joint name="j" type="{kind}"><parent link="base"/><child link="tip"/><axis xyz="0 0 1"/>
    {limits}</joint></robot>"""
    path = bundled.urdf_path("quadruped")
    return Facts(load_robot(path, contents={path: text.encode()}))


def test_joint_table_of_leg_joint(quadruped):
    order = [joint.name for joint in quadruped.actuated]
    header, *rows = joint_table(quadruped, make_spec(order))
    row = dict(zip(header, rows[2], strict=True))
    torque = abs(quadruped.stance.torques["FL_calf_joint"])
    assert row == {
        "#": "2",
        "joint": "FL_calf_joint",
        "role": "knee",
        "limits [rad]": "-2.72 to -0.838",
        "default [rad]": "0.5",
        "kp [N m/rad]": "20",
        "kd [N m s/rad]": "0.5",
        "armature [kg m2]": "0.01",
        "effort [N m]": "30",
        "velocity [rad/s]": "12.2",
        "holding torque [N m]": f"{torque:.1f} ({torque / 30:.0%})",
    }
    assert [each[1] for each in rows] == order


def test_joint_table_follows_joint_order(quadruped):
    order = [joint.name for joint in quadruped.actuated][::-1]
    assert [row[1] for row in joint_table(quadruped, make_spec(order))[1:]] == order


def test_joint_table_without_legs_has_no_leg_columns():
    header, row = joint_table(arm("prismatic", '<limit lower="0" upper="2"/>'), make_spec(["j"]))
    assert header[:4] == ("#", "joint", "limits [m]", "default [m]")
    assert "holding" not in " ".join(header)
    assert row[2] == "0 to 2"


def test_joint_table_of_joint_without_limits():
    _, row = joint_table(arm("continuous", ""), make_spec(["j"]))
    assert row[2] == "none"


def test_joint_table_lists_units_of_both_kinds():
    path = bundled.urdf_path("quadruped")
    text = """<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
    <joint name="h" type="continuous"><parent link="a"/><child link="b"/></joint>
    <joint name="s" type="prismatic"><parent link="b"/><child link="c"/></joint></robot>"""
    facts = Facts(load_robot(path, contents={path: text.encode()}))
    assert joint_table(facts, make_spec(["h", "s"]))[0][3] == "default [rad or m]"


def test_joint_table_leaves_unknown_values_empty(quadruped):
    spec = replace(make_spec(["FL_calf_joint", "other"]), stiffness={"FL_.*": 20.0, "x(": 1.0})
    header, first, other = joint_table(quadruped, spec)
    place = header.index("kp [N m/rad]")
    assert (first[place], other[place]) == ("20", "")
    assert other[2:4] == ("", "")


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (-0.0, "0"),
        (20.0, "20"),
        (0.3101, "0.31"),
        (-2.7227, "-2.72"),
        (1234.5, "1234"),
        (123456.0, "1.23e+05"),
        (1e-6, "1e-06"),
        (9.9999, "10"),
        (math.inf, "unlimited"),
        (math.nan, ""),
        (None, ""),
        (1e300, "1e+300"),
    ],
)
def test_format_number(value, text):
    assert format_number(value) == text

import math
from dataclasses import replace

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.onboarding.joint_table import format_number, joint_table
from terrainkit_robots.spec.robot_spec import RobotSpec
from tests.robots import QUADRUPED

UNITS = {
    "default_pose": 0.5,
    "stiffness": 20.0,
    "damping": 0.5,
    "effort": 30.0,
    "velocity": 12.25,
    "armature": 0.01,
    "action_scale": 0.25,
}


def make_spec(order):
    tables = {name: {".*": value} for name, value in UNITS.items()}
    files = {"urdf": "robot.urdf", "mjcf": "robot.xml", "floating": True, "base": "base"}
    return RobotSpec(name="r", joint_order=tuple(order), soft_limits={}, **files, **tables)


@pytest.fixture(scope="module")
def quadruped():
    return Facts(load_robot(QUADRUPED))


def robot_of(*kinds):
    """Return a chain of links with joints j0, j1, ... of these kinds."""
    parts = "".join(
        f'<link name="l{k + 1}"/><joint name="j{k}" type="{kind}"><parent link="l{k}"/>'
        f'<child link="l{k + 1}"/><axis xyz="0 0 1"/><limit lower="0" upper="2"/></joint>'
        for k, kind in enumerate(kinds)
    )
    text = f'<robot name="arm"><link name="l0"/>{parts}</robot>'
    return Facts(load_robot(QUADRUPED, contents={QUADRUPED: text.encode()}))


def test_joint_table_follows_the_order_of_the_spec(quadruped):
    """The whole table is in quadruped_report.txt."""
    order = [joint.name for joint in quadruped.actuated][::-1]
    assert [row[1] for row in joint_table(quadruped, make_spec(order))[1:]] == order


@pytest.mark.parametrize(
    ("kinds", "unit", "limits"),
    [
        (["prismatic"], "m", ["0 to 2"]),
        (["continuous"], "rad", ["none"]),
        (["revolute", "prismatic"], "rad or m", ["0 to 2", "0 to 2"]),
    ],
)
def test_joint_table_without_legs(kinds, unit, limits):
    spec = make_spec(f"j{k}" for k in range(len(kinds)))
    header, *rows = joint_table(robot_of(*kinds), spec)
    assert header[:4] == ("#", "joint", f"limits [{unit}]", f"default [{unit}]")
    assert "holding" not in " ".join(header)
    assert [row[2] for row in rows] == limits


def test_joint_table_leaves_unknown_values_empty(quadruped):
    spec = replace(make_spec(["FL_calf_joint", "other"]), stiffness={"FL_.*": 20.0, "x(": 1.0})
    header, first, other = joint_table(quadruped, spec)
    place = header.index("kp [N m/rad]")
    assert (first[place], other[place], *other[2:4]) == ("20", "", "", "")


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (-0.0, "0"),
        (0.3101, "0.31"),
        (-2.7227, "-2.72"),
        (1234.5, "1234"),
        (9999.0, "9999"),
        (10000.0, "1e+04"),
        (123456.0, "1.23e+05"),
        (1e-4, "0.0001"),
        (9.9e-5, "9.9e-05"),
        (9.9999, "10"),
        (math.inf, "unlimited"),
        (math.nan, ""),
        (None, ""),
    ],
)
def test_format_number(value, text):
    assert format_number(value) == text

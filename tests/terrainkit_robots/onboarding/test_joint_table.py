from dataclasses import replace

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.onboarding.joint_table import format_number, joint_table
from terrainkit_robots.spec.robot_spec import JOINT_TABLES
from tests.robots import QUADRUPED
from tests.small_robots import facts, joint, link
from tests.tables import read_table


@pytest.fixture
def make_spec(spec):
    """Return a function that makes a spec of joints, whose values are all 20."""
    tables = {name: {".*": 20.0} for name in JOINT_TABLES}
    return lambda order: spec(joint_order=tuple(order), soft_limits={}, **tables)


@pytest.fixture(scope="module")
def quadruped():
    return Facts(load_robot(QUADRUPED))


def robot_of(*kinds):
    """Return a chain of links with joints l1_joint, l2_joint, ... of these kinds."""
    return facts(
        link("l0", mass=None),
        *(
            link(f"l{k}", mass=None) + joint(f"l{k - 1}", f"l{k}", kind=kind, limits=(0, 2))
            for k, kind in enumerate(kinds, 1)
        ),
    )


def test_joint_table_follows_the_order_of_the_spec(quadruped, make_spec):
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
def test_joint_table_without_legs(make_spec, kinds, unit, limits):
    spec = make_spec(f"l{k}_joint" for k, _ in enumerate(kinds, 1))
    header, *rows = joint_table(robot_of(*kinds), spec)
    assert header[:4] == ("#", "joint", f"limits [{unit}]", f"default [{unit}]")
    assert "holding" not in " ".join(header)
    assert [row[2] for row in rows] == limits


def test_joint_table_leaves_unknown_values_empty(quadruped, make_spec):
    spec = replace(make_spec(["FL_calf_joint", "other"]), stiffness={"FL_.*": 20.0, "x(": 1.0})
    header, first, other = joint_table(quadruped, spec)
    place = header.index("kp [N m/rad]")
    assert (first[place], other[place], *other[2:4]) == ("20", "", "", "")


@pytest.mark.parametrize(
    ("value", "text"),
    [
        *read_table(__file__, "format_number"),
        (None, ""),
    ],
)
def test_format_number(value, text):
    assert format_number(value) == text

import pytest

from tests.small_robots import ball, chain, facts, joint, link, mjcf

ROUND = ".01 .01 .01 0 0 0"


def pair(name, x, parent):
    sides = ((f"{name}l", 0.1), (f"{name}r", -0.1))
    return "".join(chain(n, f"{x} {y} 0", (0.3, 0.3), parent) for n, y in sides)


def test_leg_joints_belong_to_one_leg():
    waist = link("waist") + joint("trunk", "waist", "0 0 -0.1", axis="0 0 1")
    robot = facts(link("trunk"), waist, pair("a", 0, "waist"))
    assert [each.name for each in robot.leg_joints] == [
        f"{name}_joint" for name in ("al0", "al1", "ar0", "ar1")
    ]


# The radius of gyration is sqrt(0.03 / 2) = 0.1225 m; a wheel is balanced within a tenth of it.
@pytest.mark.parametrize(
    ("part", "is_wheel"),
    [
        ({"center": "0.0122 0 0"}, True),
        ({"center": "0.0123 0 0"}, False),
        ({"center": "0 0.5 0"}, True),  # along the axis
        ({"mass": None}, False),
        ({"inertia": "0 0 0 0 0 0"}, False),
        ({"mass": -1}, False),
    ],
)
def test_wheel_is_balanced_on_its_axis(part, is_wheel):
    wheel = link("b", ball(0.1), **({"inertia": ROUND} | part))
    robot = facts(link("a"), wheel, joint("a", "b", kind="continuous"))
    assert [robot.is_wheel(body) for body in robot.bodies] == [False, is_wheel]


def test_wheel_has_no_children():
    robot = facts(*(link(n, inertia=ROUND) for n in "abc"), joint("a", "b"), joint("b", "c"))
    assert [robot.is_wheel(body) for body in robot.bodies] == [False, False, True]


def test_joints_of_a_planar_base_are_no_robot_joints():
    base = '<joint name="x" type="slide"/><joint name="y" type="slide"/><joint name="yaw"/>'
    leg = '<body name="leg"><joint name="hip"/><geom size="0.1"/></body>'
    robot = mjcf(f'<body name="a">{base}<geom size="0.1"/>{leg}</body>')
    assert [each.name for each in robot.robot_joints] == ["hip"]
    moving = facts(link("a"), link("b"), joint("a", "b"))
    assert [each.name for each in moving.robot_joints] == ["b_joint"]

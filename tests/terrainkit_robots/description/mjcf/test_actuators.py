from math import pi

import mujoco
import pytest

from tests.tables import read_table
from tests.terrainkit_robots.description.made_robots import body, joint, mjcf, read

HAS_ARMATURE = "armature" in mujoco.mj_printSchema(False, False).partition("actuator (*)")[2]


def driven(joint_has, drives):
    robot = read(body(f'<joint name="j" {joint_has}/>', f"<actuator>{drives}</actuator>"))
    assert robot.problems == ()
    return robot


@pytest.mark.parametrize(("joint_has", "drives", "effort"), read_table(__file__, "actuator_effort"))
def test_actuator_effort(joint_has, drives, effort):
    assert joint(driven(joint_has, drives)).effort == (effort or None)


def test_actuators_have_joint():
    robot = read(
        body(
            '<joint name="j"/><site name="s"/>',
            '<actuator><motor name="m" joint="j" ctrlrange="-1 2" gear="-3"/><general site="s"/>'
            '<plugin plugin="some.plugin" joint="j" ctrlrange="-1 1"/></actuator>',
        )
    )
    found = [(a.name, a.joint, a.effort, a.gear, a.commands) for a in robot.actuators]
    assert found == [
        ("m", "j", 6, -3, (-1, 2)),
        ("general", "", None, 1, None),
        ("j_actuator", "j", None, 1, None),
    ]


@pytest.mark.parametrize(("drive", "stiffness"), read_table(__file__, "stiffness_of_position"))
def test_stiffness_of_position_actuators(drive, stiffness):
    assert [each.stiffness for each in driven("", drive).actuators] == [stiffness or None]


def test_joint_limits_effort_of_its_actuators():
    """The limit of a joint is the smaller one of its own and the sum of its actuators'."""
    drives = '<motor joint="j" ctrlrange="-4 4"/><motor joint="j" ctrlrange="-{0} {0}"/>'
    efforts = [
        [each.effort for each in driven('actuatorfrcrange="-5 5"', drives.format(each)).actuators]
        for each in (0.5, 6)
    ]
    assert efforts == [[4, 0.5], [4, 5]]


@pytest.mark.skipif(not HAS_ARMATURE, reason="motors of older MuJoCo have no armature")
def test_actuator_armature_adds_to_joint():
    robot = driven('armature="0.5"', '<motor joint="j" armature="0.1" gear="3"/>')
    assert joint(robot).armature == pytest.approx(0.5 + 0.1 * 9)


BODIES = """<body name="a"><joint name="j" ref="{0}"/><body name="b"><joint name="k" ref="{1}"/>
  <body name="c"><joint name="s" type="slide" ref="0.3"/></body></body></body>"""


def mimic_of(equality, name="k", angle="radian", refs=(0.2, 0.1)):
    rest = f'<compiler angle="{angle}"/><equality>{equality}</equality>'
    found = joint(read(mjcf(BODIES.format(*refs), rest)), name).mimic
    return found and (found.joint, found.multiplier, found.offset)


def test_joint_equality_becomes_mimic():
    tied = '<joint joint1="k" joint2="j" polycoef="0.5 2"/>'
    assert mimic_of(tied) == ("j", 2, pytest.approx(0.5 + 0.1 - 2 * 0.2))
    degrees = mimic_of(tied, angle="degree", refs=(45, 180))
    assert degrees == ("j", 2, pytest.approx(0.5 + pi - 2 * pi / 4))
    slide = mimic_of(tied.replace('"k"', '"s"'), "s", angle="degree", refs=(0, 0))
    assert slide == ("j", 2, pytest.approx(0.5 + 0.3))


@pytest.mark.parametrize("equality", read_table(__file__, "other_equalities_are_no_mimics"))
def test_other_equalities_are_no_mimics(equality):
    assert mimic_of(equality) is None


def test_source_of_mimic_is_the_equality():
    rest = '\n<equality>\n<joint joint1="k" joint2="j"/></equality>'
    robot = read(mjcf(BODIES.format(0, 0), rest))
    assert joint(robot, "k").mimic.source.line == 3


@pytest.mark.parametrize(
    ("drives", "stiffness", "damping"),
    [
        ('<position joint="j" kp="9" kv="2"/>', 9, 2),
        ('<position joint="j" kp="9" kv="2" gear="-3"/>', 81, 18),
        ('<position joint="j" kp="9"/>', 9, None),
        ('<position joint="j" kp="9" dampratio="1"/>', 9, None),
        ('<position joint="j" kp="9"/><velocity joint="j" kv="2"/>', 9, 2),
        ('<general joint="j" gainprm="9" biastype="affine" biasprm="0 -9 -2"/>', 9, 2),
    ],
)
def test_position_gains(drives, stiffness, damping):
    gains = joint(driven("", drives)).position_gains
    assert (gains.stiffness, gains.damping) == (stiffness, damping)


@pytest.mark.parametrize("drives", ["", '<motor joint="j"/>', '<velocity joint="j" kv="2"/>'])
def test_joint_without_position_gains(drives):
    assert joint(driven("", f"{drives}")).position_gains is None

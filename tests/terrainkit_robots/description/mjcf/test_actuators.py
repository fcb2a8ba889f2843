from math import pi

import mujoco
import pytest

from tests.terrainkit_robots.description.made_robots import body, joint, mjcf, read

HAS_ARMATURE = "armature" in mujoco.mj_printSchema(False, False).partition("actuator (*)")[2]


def driven(joint_has, drives):
    robot = read(body(f'<joint name="j" {joint_has}/>', f"<actuator>{drives}</actuator>"))
    assert robot.problems == ()
    return robot


@pytest.mark.parametrize(
    ("joint_has", "drives", "effort"),
    [
        ('actuatorfrcrange="-5 7"', "", 7),
        ('actuatorfrcrange="-8 7"', "", 8),
        ('actuatorfrcrange="-5 7" actuatorfrclimited="false"', "", None),
        ("", '<motor joint="j" ctrlrange="-2 2" gear="3"/>', 6),
        ("", '<motor joint="j" ctrlrange="-2 2" gear="-3" forcerange="-1 1"/>', 3),
        ("", '<motor joint="j" ctrlrange="-1 2" gear="-3" forcerange="-9 1"/>', 6),
        ("", '<motor joint="j"/>', None),
        ("", '<motor joint="j" ctrlrange="-2 2" ctrllimited="false"/>', None),
        ("", '<motor joint="j" ctrlrange="-2 2"/><motor joint="j" ctrlrange="-3 3"/>', 5),
        ("", '<motor joint="j" ctrlrange="-2 2"/><motor joint="j"/>', None),
        ('actuatorfrcrange="-5 5"', '<motor joint="j" ctrlrange="-2 2"/>', 2),
        ('actuatorfrcrange="-5 5"', '<motor joint="j"/>', 5),
        ("", '<position joint="j" kp="9" ctrlrange="-2 2"/>', None),
        ("", '<position joint="j" kp="9" ctrlrange="-2 2" forcerange="-8 8"/>', 8),
        ("", '<general joint="j" gainprm="4" ctrlrange="-2 2"/>', 8),
        ("", '<general joint="j" gainprm="-4" ctrlrange="-2 2"/>', 8),
        ("", '<general joint="j" gainprm="4" ctrlrange="-2 2" dyntype="filter"/>', 8),
        ("", '<general joint="j" gainprm="4" ctrlrange="-2 2" dyntype="integrator"/>', None),
        ("", '<general joint="j" gaintype="affine" ctrlrange="-2 2"/>', None),
        ("", '<general joint="j" biastype="affine" ctrlrange="-2 2"/>', 2),
        ("", '<general joint="j" biastype="affine" biasprm="1" ctrlrange="-2 2"/>', None),
        ("", '<velocity joint="j" kv="9" ctrlrange="-2 2"/>', None),
        ("", '<motor joint="j" ctrlrange="-inf inf" forcerange="-4 4"/>', 4),
    ],
)
def test_actuator_effort(joint_has, drives, effort):
    assert joint(driven(joint_has, drives)).effort == effort


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


AFFINE = '<general joint="j" gaintype="affine" gainprm="9" biastype="affine" biasprm="0 -9"/>'


@pytest.mark.parametrize(
    ("drive", "stiffness"),
    [
        ('<position joint="j" kp="9" gear="2"/>', 36),
        ('<general joint="j" gainprm="9" biastype="affine" biasprm="0 -9 0"/>', 9),
        ('<general joint="j" gainprm="9" biastype="affine" biasprm="0 -8 0"/>', None),
        ('<general joint="j" gainprm="-9" biastype="affine" biasprm="0 9 0"/>', None),
        ('<general joint="j" gainprm="0" biastype="affine" biasprm="0 0 0"/>', None),
        (AFFINE, None),
        ('<motor joint="j"/>', None),
        ('<velocity joint="j" kv="9"/>', None),
    ],
)
def test_stiffness_of_position_actuators(drive, stiffness):
    assert [each.stiffness for each in driven("", drive).actuators] == [stiffness]


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


@pytest.mark.parametrize(
    "equality",
    [
        '<joint joint1="k" joint2="j" polycoef="0 1 1"/>',
        '<joint joint1="k" joint2="j" polycoef="0 1 0 0 1"/>',
        '<joint joint1="k" joint2="j" active="false"/>',
        '<joint joint1="k"/>',
        '<weld body1="b" body2="a"/>',
    ],
)
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

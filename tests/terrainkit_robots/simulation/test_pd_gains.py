import math
import re

import pytest

from terrainkit_robots.simulation.pd_gains import suggest_gains, suggest_training_gains
from terrainkit_robots.simulation.sim_model import TIME_STEP, make_sim_model
from terrainkit_robots.simulation.time_step import max_stable_time_step
from tests.robots import BUNDLED, PENDULUM
from tests.small_robots import chain, facts, joint, link, shape
from tests.tables import read_table

CAR = (
    link("body", mass=5)
    + link(
        "wheel",
        shape('cylinder radius="0.2" length="0.05"', rpy="1.5708 0 0"),
        inertia="0.01 0.02 0.01 0 0 0",
    )
    + joint("body", "wheel", kind="continuous", more="{limit}")
)
ARM = PENDULUM.replace('"revolute"', '"{kind}"').replace('effort="10"', 'effort="{effort}"')

SLIDER = (
    link("frame", mass=None)
    + link("slider", mass=2, inertia="0.01 0.01 0.01 0 0 0")
    + joint("frame", "slider", axis="1 0 0", kind="prismatic", limits=(-1, 1))
)
ARM_BESIDE = link("arm", mass=4, center="0.1 0 0", inertia="0.01 0.01 0.01 0 0 0") + joint(
    "frame", "arm", "0 1 0", limits=(-1, 1)
)
SIDES = {"left": 0.1, "right": -0.1}


@pytest.mark.parametrize(
    ("name", "joints", "stand", "train"), read_table(__file__, "gains_of_bundled_robots")
)
def test_gains_of_bundled_robots(bundled, name, joints, stand, train):
    robot = bundled(name)
    for gains, expected in ((suggest_gains(robot), stand), (suggest_training_gains(robot), train)):
        for name in joints.split():
            gain = gains[f"{name}_joint"]
            assert [gain.stiffness, gain.damping] == expected, name


@pytest.mark.parametrize("name", BUNDLED)
def test_gains_of_every_robot(bundled, name):
    robot = bundled(name)
    sim, stand, train = make_sim_model(robot), suggest_gains(robot), suggest_training_gains(robot)
    assert tuple(stand) == sim.actuated
    for pair in robot.mirror.pairs:
        left, right = (robot.bodies[index].joint for index in (pair.left, pair.right))
        assert stand[left.name] == stand[right.name]
    legs = {each.name for each in robot.leg_joints}
    for each in robot.actuated:
        gain, softer = stand[each.name], train[each.name]
        assert gain.armature >= each.armature
        assert gain.reason.startswith("kp ")
        assert "; kd " in gain.reason
        for value in (gain.stiffness, gain.damping):  # rounded
            digits = f"{value:.6e}".split("e")[0].rstrip("0").rstrip(".")
            assert digits in {"1", "1.5", "2", "2.5", "3", "4", "5", "6", "8"}, gain
        assert softer.stiffness <= gain.stiffness if each.name in legs else softer == gain
        assert softer.armature == gain.armature
    for gains in (stand, train):
        assert max_stable_time_step(sim, gains).seconds > 1.1 * TIME_STEP


@pytest.mark.parametrize(("name", "is_added"), [("quadruped.urdf", True), ("quadruped.xml", False)])
def test_gains_add_armature_to_light_calf(bundled, name, is_added):
    gain = suggest_gains(bundled(name))["FL_calf_joint"]
    assert gain.armature == pytest.approx(0.01)  # the MJCF declares it
    assert ("armature" in gain.reason) == is_added


def test_gains_hold_weight_of_arm(robot):
    gain = suggest_gains(robot(ARM.format(kind="revolute", effort="1000")))["j"]
    torque = 2 * 9.81 * 0.5
    assert gain.stiffness == pytest.approx(torque / 0.02, rel=0.12)  # 490, rounded to 500
    inertia = 0.01 + 2 * 0.5**2
    critical = 2 * math.sqrt(torque / 0.02 * inertia)
    assert gain.damping == pytest.approx(min(critical, torque / 0.02 / 20), rel=0.12)


def test_gains_respect_effort_limit(robot):
    gain = suggest_gains(robot(ARM.format(kind="revolute", effort="10")))["j"]
    assert gain.stiffness == pytest.approx(20)
    assert "effort limit of 10 N m at an error of 0.5 rad" in gain.reason


@pytest.mark.parametrize(("effort", "why"), [("1e5", "N within 0.002 m"), ("10", "10 N at an err")])
def test_gains_of_prismatic_joint_have_linear_units(robot, effort, why):
    gain = suggest_gains(robot(ARM.format(kind="prismatic", effort=effort)))["j"]
    assert gain.stiffness == pytest.approx(min(2 * 9.81 / 0.002, float(effort) / 0.05), rel=0.12)
    assert why in gain.reason
    assert not re.search(r"N m|rad|kg m2", gain.reason)


def test_gains_of_slides_and_hinges_are_damped_separately():
    """Both have the same stiffness, for 2 kg and for 0.05 kg m2."""
    found = suggest_gains(facts(SLIDER, ARM_BESIDE))
    slide, hinge = found["slider_joint"], found["arm_joint"]
    assert (slide.stiffness, hinge.stiffness) == (1000, 100)
    assert slide.damping == suggest_gains(facts(SLIDER))["slider_joint"].damping > hinge.damping


def test_gains_of_a_slide_below_the_knee_are_not_of_the_ankle():
    """The joints of each leg are hip, knee, slide and ankle."""
    legs = [chain(f"{side}_leg", f"0 {y} 0", (0.3, 0.2, 0.1, 0.05)) for side, y in SIDES.items()]
    text = "".join(legs).replace('leg2_joint" type="revolute', 'leg2_joint" type="prismatic')
    gains = suggest_gains(facts(link("trunk", mass=10), text))
    stiffness = [gains[f"left_leg{k}_joint"].stiffness for k in range(4)]
    # 88.7 = 1.5 x 18 kg x 9.81 m/s2 x 0.67 m / 2 legs; the slide sinks by 9 % of the length.
    assert stiffness == [80, 80, 1500, 80]


@pytest.mark.parametrize(
    ("limit", "damping"), [('<limit effort="5" velocity="10"/>', 0.5), ("", 0.02 / 0.05)]
)
def test_gains_of_wheel_control_velocity(limit, damping):
    gain = suggest_gains(facts(CAR.format(limit=limit)))["wheel_joint"]
    assert (gain.stiffness, gain.damping) == (0, pytest.approx(damping, rel=0.12))


def test_gains_of_wheel_respect_time_step():
    text = CAR.format(limit='<limit effort="500" velocity="1"/>')
    gain = suggest_gains(facts(text))["wheel_joint"]
    assert gain.damping == pytest.approx(0.5 * 0.02 / TIME_STEP, rel=0.12)


def test_gains_without_joints_are_empty(robot):
    assert suggest_gains(robot('<robot name="r"><link name="a"/></robot>')) == {}


def test_mirrored_arms_have_equal_gains(bundled, tmp_path):
    """The weaker motor of the right arm limits both."""
    arms = ""
    for (name, y), effort in zip(SIDES.items(), (5, 1), strict=True):
        limit = f'<limit lower="-1" upper="1" effort="{effort}" velocity="9"/>'
        arms += link(name, center="0.2 0 0", inertia="0.01 0.01 0.01 0 0 0")
        arms += joint("base", name, f"0 {2 * y} 0.1", more=limit)
    robot = bundled("quadruped.urdf", ("</robot>", arms + "</robot>"), tmp_path=tmp_path)
    gains = suggest_gains(robot)
    assert gains["left_joint"] == gains["right_joint"]
    assert gains["right_joint"].stiffness == pytest.approx(1 / 0.5)

import math
import re

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.simulation.pd_gains import suggest_gains, suggest_training_gains
from terrainkit_robots.simulation.sim_model import TIME_STEP, make_sim_model
from terrainkit_robots.simulation.time_step import max_stable_time_step
from tests.robots import BUNDLED, PENDULUM

# Published gains by joint, stiffness and damping: a1 of walk-these-ways, go2, h1 and g1 of
# unitree_rl_gym and Isaac Lab.
PUBLISHED = {
    "a1/urdf/a1.urdf": {".*": ((20, 40), (0.5, 1))},
    "go2/urdf/go2.urdf": {".*": ((20, 40), (0.5, 1))},
    "go2_mjcf/go2.xml": {".*": ((20, 40), (0.5, 1))},
    "h1/urdf/h1.urdf": {
        ".*hip.*": ((150, 200), (2, 5)),
        ".*knee.*": ((200, 300), (4, 6)),
        ".*ankle.*": ((20, 40), (2, 4)),
    },
    "g1/g1_29dof.urdf": {
        ".*hip.*": ((100, 100), (2, 2)),
        ".*knee.*": ((150, 150), (4, 4)),
        ".*(ankle|shoulder|elbow).*": ((40, 40), (1, 2)),
    },
}

WHEELED = """
<robot name="car">
  <link name="body">
    <inertial><mass value="5"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <link name="wheel">
    <inertial><mass value="1"/>
      <inertia ixx="0.01" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision>
      <origin rpy="1.5708 0 0"/><geometry><cylinder radius="0.2" length="0.05"/></geometry>
    </collision>
  </link>
  <joint name="axle" type="continuous">
    <parent link="body"/><child link="wheel"/><axis xyz="0 1 0"/>
    {limit}
  </joint>
</robot>
"""

ARM = PENDULUM.replace('"revolute"', '"{kind}"').replace('effort="10"', 'effort="{effort}"')

GANTRY = """
<robot name="gantry">
  <link name="frame"/>
  <link name="slider">
    <inertial><mass value="2"/>
      <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="rail" type="prismatic">
    <parent link="frame"/><child link="slider"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" effort="10" velocity="10"/>
  </joint>
  <!-- and -->
  <link name="arm">
    <inertial><origin xyz="0.1 0 0"/><mass value="4"/>
      <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="swing" type="revolute">
    <parent link="frame"/><child link="arm"/><origin xyz="0 1 0"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="100" velocity="10"/>
  </joint>
</robot>
"""


@pytest.mark.parametrize("name", PUBLISHED)
def test_gains_are_close_to_published_gains(name, robot_file):
    found = suggest_gains(Facts(load_robot(robot_file(name))))
    for pattern, ((softest, stiffest), (least, most)) in PUBLISHED[name].items():
        joints = [joint for joint in found if re.fullmatch(pattern, joint)]
        assert joints
        for joint in joints:
            gain = found[joint]
            assert softest / 2 <= gain.stiffness <= 2 * stiffest, (joint, gain)
            assert least / 2.1 <= gain.damping <= 2.1 * most, (joint, gain)


@pytest.mark.parametrize(
    ("name", "joints", "stand", "train"),
    [
        ("quadruped.urdf", "FL_hip FL_thigh FL_calf", (60, 2), (20, 0.5)),
        ("quadruped.xml", "FL_hip FL_thigh FL_calf", (60, 2), (25, 0.6)),
        ("biped.urdf", "left_hip_pitch left_hip_roll", (80, 4), (60, 1.5)),
        ("biped.urdf", "left_hip_yaw", (60, 1.5), (60, 1.5)),
        ("biped.urdf", "left_knee", (150, 4), (80, 2)),
        ("biped.urdf", "left_ankle_pitch left_ankle_roll", (50, 1.5), (50, 1.5)),
        ("biped.xml", "left_hip_pitch left_hip_yaw", (80, 2.5), (80, 2)),
        ("biped.xml", "left_knee", (150, 6), (80, 2)),
        ("biped.xml", "left_ankle_pitch left_ankle_roll", (50, 1), (50, 1)),
    ],
)
def test_gains_of_bundled_robots(bundled, name, joints, stand, train):
    facts = bundled(name)
    for gains, expected in ((suggest_gains(facts), stand), (suggest_training_gains(facts), train)):
        for joint in joints.split():
            gain = gains[f"{joint}_joint"]
            assert (gain.stiffness, gain.damping) == expected, joint


@pytest.mark.parametrize("name", BUNDLED)
def test_gains_of_every_robot(bundled, name):
    facts = bundled(name)
    sim, stand, train = make_sim_model(facts), suggest_gains(facts), suggest_training_gains(facts)
    assert tuple(stand) == sim.actuated
    for pair in facts.mirror.pairs:
        left, right = (facts.bodies[index].joint for index in (pair.left, pair.right))
        assert stand[left.name] == stand[right.name]
    legs = {joint.name for joint in facts.leg_joints}
    for joint in facts.actuated:
        gain, softer = stand[joint.name], train[joint.name]
        assert gain.armature >= joint.armature
        assert gain.reason.startswith("kp ")
        assert "; kd " in gain.reason
        for value in (gain.stiffness, gain.damping):  # rounded
            digits = f"{value:.6e}".split("e")[0].rstrip("0").rstrip(".")
            assert digits in {"1", "1.5", "2", "2.5", "3", "4", "5", "6", "8"}, gain
        assert softer.stiffness <= gain.stiffness if joint.name in legs else softer == gain
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


def test_gains_of_slides_and_hinges_are_damped_separately(robot):
    """Both have the same stiffness, for 2 kg and for 0.05 kg m2."""
    found = suggest_gains(robot(GANTRY))
    assert found["rail"].stiffness == found["swing"].stiffness == 200
    alone = robot(GANTRY.split("<!-- and -->")[0] + "</robot>")
    assert found["rail"].damping == suggest_gains(alone)["rail"].damping
    assert found["rail"].damping > found["swing"].damping


@pytest.mark.parametrize(
    ("limit", "damping"), [('<limit effort="5" velocity="10"/>', 0.5), ("", 0.02 / 0.05)]
)
def test_gains_of_wheel_control_velocity(limit, damping, robot):
    gain = suggest_gains(robot(WHEELED.format(limit=limit)))["axle"]
    assert (gain.stiffness, gain.damping) == (0, pytest.approx(damping, rel=0.12))


def test_gains_of_wheel_respect_time_step(robot):
    text = WHEELED.format(limit='<limit effort="500" velocity="1"/>')
    gain = suggest_gains(robot(text))["axle"]
    assert gain.damping == pytest.approx(0.5 * 0.02 / TIME_STEP, rel=0.12)


def test_gains_without_joints_are_empty(robot):
    assert suggest_gains(robot('<robot name="r"><link name="a"/></robot>')) == {}

import math
import re
from functools import cache

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.fixes.apply import fix_robot
from terrainkit_robots.lint.selection import lint_selected
from terrainkit_robots.lint.settings import Settings
from terrainkit_robots.mesh.mesh_cache import Meshes
from terrainkit_robots.simulation.pd_gains import suggest_gains, suggest_training_gains
from terrainkit_robots.simulation.sim_model import TIME_STEP, make_sim_model
from terrainkit_robots.simulation.time_step import max_stable_time_step
from tests.robots import BUNDLED

# Published gains by joint, stiffness and damping: a1 of walk-these-ways, anymal_c and cassie of
# legged_gym, go2, h1 and g1 of unitree_rl_gym and Isaac Lab.
PUBLISHED = {
    "a1/urdf/a1.urdf": {".*": ((20, 40), (0.5, 1))},
    "go2/urdf/go2.urdf": {".*": ((20, 40), (0.5, 1))},
    "go2_mjcf/go2.xml": {".*": ((20, 40), (0.5, 1))},
    "cassie/urdf/cassie.urdf": {
        "hip_(abduction|rotation).*": ((100, 100), (3, 3)),
        "hip_flexion.*|thigh.*|ankle.*": ((200, 200), (6, 6)),
        "toe.*": ((40, 40), (1, 1)),
    },
    "h1/urdf/h1.urdf": {
        ".*hip.*": ((150, 200), (2, 5)),
        ".*knee.*": ((200, 300), (4, 6)),
        ".*ankle.*": ((20, 40), (2, 4)),
    },
    "g1/g1_29dof.urdf": {
        ".*hip.*": ((100, 100), (2, 2)),
        ".*knee.*": ((150, 150), (4, 4)),
        ".*ankle.*": ((40, 40), (1, 2)),
        ".*(shoulder|elbow).*": ((40, 40), (1, 2)),
    },
}

INVALID = ["cassie/urdf/cassie.urdf"]  # MuJoCo rejects the inertias

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

ARM = """
<robot name="arm">
  <link name="pole"/>
  <link name="arm">
    <inertial><origin xyz="0.5 0 0"/><mass value="2"/>
      <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="shoulder" type="{kind}">
    <parent link="pole"/><child link="arm"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="{effort}" velocity="10"/>
  </joint>
</robot>
"""

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


@cache
def read(path):
    return Facts(load_robot(path))


def written(folder, text):
    path = folder / "robot.urdf"
    path.write_text(text)
    return read(path)


def facts_of(name, robot_file):
    path = robot_file(name)
    return repaired(path) if name in INVALID else read(path)


@cache
def repaired(path):
    def look(contents):
        facts = Facts(load_robot(path, contents=contents), Meshes(contents))
        return lint_selected(facts, Settings(simulate=False), contents)

    return fix_robot(path, look, unsafe=True).report.facts


every_robot = pytest.mark.parametrize(
    "name", [*BUNDLED, "a1/urdf/a1.urdf", "go2/urdf/go2.urdf", "g1/g1_29dof.urdf"]
)


@pytest.mark.parametrize("name", PUBLISHED)
def test_gains_are_close_to_published_gains(name, robot_file):
    found = suggest_gains(facts_of(name, robot_file))
    for pattern, ((softest, stiffest), (least, most)) in PUBLISHED[name].items():
        joints = [joint for joint in found if re.fullmatch(pattern, joint)]
        assert joints
        for joint in joints:
            gain = found[joint]
            assert softest / 2 <= gain.stiffness <= 2 * stiffest, (joint, gain)
            assert least / 2.1 <= gain.damping <= 2.1 * most, (joint, gain)


# Those that the robots are trained with, within a factor of about 1.3.
TRAINED = {
    "a1/urdf/a1.urdf": {".*": ((20, 35), (0.5, 1))},
    "go2/urdf/go2.urdf": {".*": ((20, 35), (0.5, 1))},
    "anymal_c/urdf/anymal_c.urdf": {".*": ((80, 80), (2, 2))},
    "h1/urdf/h1.urdf": {".*(hip|knee).*": ((100, 150), (2, 4))},
    "g1/g1_29dof.urdf": {".*(hip|knee).*": ((100, 150), (2, 4))},
}


@pytest.mark.parametrize("name", TRAINED)
def test_training_gains_are_close_to_published_gains(name, robot_file):
    path = robot_file(name)
    found = suggest_training_gains(repaired(path) if "anymal" in name else read(path))
    for pattern, ((softest, stiffest), (least, most)) in TRAINED[name].items():
        for joint in (joint for joint in found if re.fullmatch(pattern, joint)):
            gain = found[joint]
            assert softest / 1.3 <= gain.stiffness <= 1.3 * stiffest, (joint, gain)
            assert least / 1.3 <= gain.damping <= 1.3 * most, (joint, gain)


@every_robot
def test_training_gains_soften_legs_only(name, robot_file):
    facts = facts_of(name, robot_file)
    stand, train = suggest_gains(facts), suggest_training_gains(facts)
    legs = {joint.name for joint in facts.leg_joints}
    for joint in stand:
        if joint in legs:
            assert train[joint].stiffness <= stand[joint].stiffness
        else:
            assert train[joint] == stand[joint]
    assert max_stable_time_step(make_sim_model(facts), train).seconds > 1.1 * TIME_STEP


@every_robot
def test_gains_of_mirrored_joints_are_equal(name, robot_file):
    facts = facts_of(name, robot_file)
    found = suggest_gains(facts)
    assert tuple(found) == make_sim_model(facts).actuated
    for pair in facts.mirror.pairs:
        left, right = (facts.bodies[index].joint for index in (pair.left, pair.right))
        assert found[left.name] == found[right.name]


@every_robot
def test_gains_are_rounded_and_explained(name, robot_file):
    for gain in suggest_gains(facts_of(name, robot_file)).values():
        for value in (gain.stiffness, gain.damping):
            digits = f"{value:.6e}".split("e")[0].rstrip("0").rstrip(".")
            assert digits in {"1", "1.5", "2", "2.5", "3", "4", "5", "6", "8"}, gain
        assert gain.reason.startswith("kp ")
        assert "; kd " in gain.reason


@every_robot
def test_gains_are_stable_at_training_time_step(name, robot_file):
    facts = facts_of(name, robot_file)
    assert (
        max_stable_time_step(make_sim_model(facts), suggest_gains(facts)).seconds > 1.1 * TIME_STEP
    )


@every_robot
def test_gains_never_reduce_armature(name, robot_file):
    facts = facts_of(name, robot_file)
    found = suggest_gains(facts)
    for joint in facts.actuated:
        assert found[joint.name].armature >= joint.armature


def test_gains_add_armature_to_light_calf():
    light = suggest_gains(read(bundled.urdf_path("quadruped")))
    assert light["FL_calf_joint"].armature == pytest.approx(0.01)
    assert "armature" in light["FL_calf_joint"].reason
    declared = suggest_gains(read(bundled.urdf_path("quadruped").with_suffix(".xml")))
    assert declared["FL_calf_joint"].armature == pytest.approx(0.01)
    assert "armature" not in declared["FL_calf_joint"].reason


def test_gains_hold_weight_of_arm(tmp_path):
    gain = suggest_gains(written(tmp_path, ARM.format(kind="revolute", effort="1000")))["shoulder"]
    torque = 2 * 9.81 * 0.5
    assert gain.stiffness == pytest.approx(torque / 0.02, rel=0.12)  # 490, rounded to 500
    inertia = 0.01 + 2 * 0.5**2
    critical = 2 * math.sqrt(torque / 0.02 * inertia)
    assert gain.damping == pytest.approx(min(critical, torque / 0.02 / 20), rel=0.12)


def test_gains_respect_effort_limit(tmp_path):
    gain = suggest_gains(written(tmp_path, ARM.format(kind="revolute", effort="10")))["shoulder"]
    assert gain.stiffness == pytest.approx(20)
    assert "effort limit of 10 N m at an error of 0.5 rad" in gain.reason


@pytest.mark.parametrize(("effort", "why"), [("1e5", "N within 0.002 m"), ("10", "10 N at an err")])
def test_gains_of_prismatic_joint_have_linear_units(tmp_path, effort, why):
    gain = suggest_gains(written(tmp_path, ARM.format(kind="prismatic", effort=effort)))["shoulder"]
    assert gain.stiffness == pytest.approx(min(2 * 9.81 / 0.002, float(effort) / 0.05), rel=0.12)
    assert why in gain.reason
    assert not re.search(r"N m|rad|kg m2", gain.reason)


def test_gains_of_slides_and_hinges_are_damped_separately(tmp_path):
    """Both have the same stiffness, for 2 kg and for 0.05 kg m2."""
    found = suggest_gains(written(tmp_path, GANTRY))
    assert found["rail"].stiffness == found["swing"].stiffness == 200
    alone = written(tmp_path, GANTRY.split("<!-- and -->")[0] + "</robot>")
    assert found["rail"].damping == suggest_gains(alone)["rail"].damping
    assert found["rail"].damping > found["swing"].damping


@pytest.mark.parametrize(
    ("limit", "damping"),
    [('<limit effort="5" velocity="10"/>', 0.5), ("", 0.02 / 0.05)],
)
def test_gains_of_wheel_control_velocity(limit, damping, tmp_path):
    gain = suggest_gains(written(tmp_path, WHEELED.format(limit=limit)))["axle"]
    assert gain.stiffness == 0
    assert gain.damping == pytest.approx(damping, rel=0.12)


def test_gains_of_wheel_respect_time_step(tmp_path):
    text = WHEELED.format(limit='<limit effort="500" velocity="1"/>')
    gain = suggest_gains(written(tmp_path, text))["axle"]
    assert gain.damping == pytest.approx(0.5 * 0.02 / TIME_STEP, rel=0.12)


def test_gains_without_joints_are_empty(tmp_path):
    assert suggest_gains(written(tmp_path, '<robot name="r"><link name="a"/></robot>')) == {}

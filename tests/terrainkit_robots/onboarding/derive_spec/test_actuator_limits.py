import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.onboarding.derive_spec.actuator_limits import (
    action_scale_column,
    armature_column,
    effort_column,
    velocity_column,
)
from terrainkit_robots.spec.column import collect_provenance
from tests.robots import ARM

HIP = 'effort="23.7" velocity="30.1"'
FIRST = '<limit lower="-1.0472" upper="1.0472" effort="23.7" velocity="30.1"/>'


def with_first_limit(bundled, tmp_path, *, limit):
    """Return the quadruped with another limit element in its first joint."""
    plain = bundled("quadruped.urdf")
    text = plain.model.file.read_text(encoding="utf-8").replace(FIRST, limit, 1)
    path = tmp_path / "one.urdf"
    path.write_text(text, encoding="utf-8")
    return Facts(load_robot(path))


def values(column):
    return {joint: value for joint, (value, _) in column.items()}


def test_derive_effort_from_file(bundled, gains):
    facts = bundled("quadruped.urdf")
    column = effort_column(facts, gains(facts), facts.mirror_map)
    assert column["FR_calf_joint"][0] == 45.43
    assert collect_provenance({"effort": column})["effort"].reason == "in quadruped.urdf"


def test_derive_effort_from_mirror_joint(bundled, gains, tmp_path):
    facts = with_first_limit(bundled, tmp_path, limit='<limit lower="-1" upper="1"/>')
    twins = facts.mirror_map
    effort = effort_column(facts, gains(facts), twins)
    speed = velocity_column(facts, twins)
    assert effort["FL_hip_joint"][0] == 23.7
    assert speed["FL_hip_joint"][0] == 30.1
    origins = collect_provenance({"effort": effort})
    assert set(origins) == {"effort", "effort.FL_hip_joint"}
    assert origins["effort"].origin == "declared"
    assert origins["effort.FL_hip_joint"].origin == "suggested"
    assert origins["effort.FL_hip_joint"].reason == "not in the file; copied from FR_hip_joint"


def test_derive_effort_of_leg_from_mass_and_length(bundled, gains, tmp_path):
    facts = bundled("quadruped.urdf", (HIP, ""), tmp_path=tmp_path)
    twins = facts.mirror_map
    column = effort_column(facts, gains(facts), twins)
    # 0.5 * 15.0 kg * 9.81 m/s2 * 0.448 m
    assert column["FL_hip_joint"][0] == 33.0
    assert column["FL_hip_joint"][1].reason.endswith("0.5 x weight x leg length")
    speeds = velocity_column(facts, twins)
    assert speeds["FL_hip_joint"][0] == 20.0
    assert speeds["FL_hip_joint"][1].origin == "suggested"


def test_derive_armature_from_file_or_gains(bundled, gains):
    urdf, mjcf = bundled("quadruped.urdf"), bundled("quadruped.xml")
    assert set(values(armature_column(urdf, gains(urdf))).values()) == {0.0}
    needed = armature_column(urdf, gains(urdf, armature=0.01))
    assert set(values(needed).values()) == {0.01}
    assert "required by the gains" in needed["FL_hip_joint"][1].reason
    declared = {joint.name: joint.armature for joint in mjcf.actuated}
    kept = armature_column(mjcf, gains(mjcf))
    assert values(kept) == pytest.approx(declared)
    more = armature_column(mjcf, gains(mjcf, armature=1.0))
    assert set(values(more).values()) == {1.0}


def test_derive_effort_from_stiffness(gains, tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(ARM.replace('effort="30" ', ""))
    facts = Facts(load_robot(path))
    column = effort_column(facts, gains(facts, stiffness=40.0), {})
    assert column["shoulder"][0] == 40.0
    assert "the stiffness at an error of 1 rad" in column["shoulder"][1].reason


@pytest.mark.parametrize(
    ("stiffness", "scale", "reason"),
    [
        (100.0, 0.75 * 23.7 / 100, "0.75 * effort / stiffness"),
        (60.0, 0.25, "0.25 rad, the largest suggested scale"),
        (0.0, 0.25 * 30.1, "0.25 * velocity; the target is a speed without stiffness"),
    ],
)
def test_derive_action_scale_from_effort(bundled, gains, stiffness, scale, reason):
    facts = bundled("quadruped.urdf")
    gain, twins = gains(facts, stiffness=stiffness), facts.mirror_map
    effort, velocity = effort_column(facts, gain, twins), velocity_column(facts, twins)
    column = action_scale_column(facts, gain, effort, velocity)
    assert column["FL_hip_joint"][0] == pytest.approx(scale, rel=0.01)
    assert column["FL_hip_joint"][1].reason == reason


def test_derive_action_scale_of_short_range(bundled, gains, tmp_path):
    facts = with_first_limit(
        bundled, tmp_path, limit='<limit lower="-0.1" upper="0.1" effort="23.7" velocity="30.1"/>'
    )
    gain, twins = gains(facts, stiffness=10.0), facts.mirror_map
    effort, velocity = effort_column(facts, gain, twins), velocity_column(facts, twins)
    column = action_scale_column(facts, gain, effort, velocity)
    assert column["FL_hip_joint"][0] == pytest.approx(0.05)
    assert column["FL_hip_joint"][1].reason == "0.25 of the joint range"


def test_joints_off_the_legs_hold_the_default_pose(bundled, gains, tmp_path):
    arm = """<link name="arm"><inertial><mass value="0.5"/>
      <inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <joint name="arm_joint" type="revolute"><parent link="base"/><child link="arm"/>
      <origin xyz="0 0 0.1"/><axis xyz="0 1 0"/>
      <limit lower="-1" upper="1" effort="20" velocity="20"/></joint></robot>"""
    facts = bundled("quadruped.urdf", ("</robot>", arm), tmp_path=tmp_path)
    gain, twins = gains(facts, stiffness=40.0), facts.mirror_map
    effort, velocity = effort_column(facts, gain, twins), velocity_column(facts, twins)
    column = action_scale_column(facts, gain, effort, velocity)
    scale, origin = column.pop("arm_joint")
    assert scale == 0.0
    assert "holds the default pose" in origin.reason
    assert set(values(column).values()) == {0.25}


def test_only_joint_of_an_arm_moves(gains, tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(ARM)
    facts = Facts(load_robot(path))
    gain = gains(facts, stiffness=40.0)
    effort, velocity = effort_column(facts, gain, {}), velocity_column(facts, {})
    assert values(action_scale_column(facts, gain, effort, velocity)) == {"shoulder": 0.25}

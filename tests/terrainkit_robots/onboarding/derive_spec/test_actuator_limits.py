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
from tests.small_robots import joint, link

HIP = 'effort="23.7" velocity="30.1"'
FIRST = '<limit lower="-1.0472" upper="1.0472" effort="23.7" velocity="30.1"/>'


@pytest.fixture
def with_first_limit(bundled, tmp_path):
    """Return a function that makes the quadruped with another limit of its first joint."""

    def make(limit):
        text = bundled("quadruped.urdf").model.file.read_text(encoding="utf-8")
        (tmp_path / "one.urdf").write_text(text.replace(FIRST, limit, 1), encoding="utf-8")
        return Facts(load_robot(tmp_path / "one.urdf"))

    return make


def values(column):
    return {joint: value for joint, (value, _) in column.items()}


def action_scales(facts, gain):
    """Return the column of action scales of a robot with these gains."""
    twins = facts.mirror_map
    effort, velocity = effort_column(facts, gain, twins), velocity_column(facts, twins)
    return action_scale_column(facts, gain, effort, velocity)


def test_derive_effort_from_mirror_joint(with_first_limit, gains):
    facts = with_first_limit('<limit lower="-1" upper="1"/>')
    twins = facts.mirror_map
    effort = effort_column(facts, gains(facts), twins)
    assert effort["FL_hip_joint"][0] == 23.7
    assert velocity_column(facts, twins)["FL_hip_joint"][0] == 30.1
    origins = collect_provenance({"effort": effort})
    assert {name: (each.origin, each.reason) for name, each in origins.items()} == {
        "effort": ("declared", "in one.urdf"),
        "effort.FL_hip_joint": ("suggested", "not in the file; copied from FR_hip_joint"),
    }


def test_derive_effort_of_leg_from_mass_and_length(bundled, gains, tmp_path):
    facts = bundled("quadruped.urdf", (HIP, ""), tmp_path=tmp_path)
    twins = facts.mirror_map
    effort, origin = effort_column(facts, gains(facts), twins)["FL_hip_joint"]
    assert effort == 33.0  # 0.5 * 15.0 kg * 9.81 m/s2 * 0.448 m
    assert origin.reason.endswith("0.5 x weight x leg length")
    speed, origin = velocity_column(facts, twins)["FL_hip_joint"]
    assert (speed, origin.origin) == (20.0, "suggested")


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


def test_derive_limits_of_an_arm_from_its_stiffness(robot, gains):
    facts = robot(ARM.replace('effort="30" ', ""))
    gain = gains(facts, stiffness=40.0)
    effort, origin = effort_column(facts, gain, {})["shoulder"]
    assert effort == 40.0
    assert "the stiffness at an error of 1 rad" in origin.reason
    assert values(action_scales(facts, gain)) == {"shoulder": 0.25}  # its only joint moves


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
    found, origin = action_scales(facts, gains(facts, stiffness=stiffness))["FL_hip_joint"]
    assert (found, origin.reason) == (pytest.approx(scale, rel=0.01), reason)


def test_derive_action_scale_of_short_range(with_first_limit, gains):
    facts = with_first_limit('<limit lower="-0.1" upper="0.1" effort="23.7" velocity="30.1"/>')
    scale, origin = action_scales(facts, gains(facts, stiffness=10.0))["FL_hip_joint"]
    assert (scale, origin.reason) == (pytest.approx(0.05), "0.25 of the joint range")


def test_joints_off_the_legs_hold_the_default_pose(bundled, gains, tmp_path):
    arm = link("arm", inertia="0.1 0.1 0.1 0 0 0") + joint("base", "arm", limits=(-1, 1))
    facts = bundled("quadruped.urdf", ("</robot>", arm + "</robot>"), tmp_path=tmp_path)
    column = action_scales(facts, gains(facts, stiffness=40.0))
    scale, origin = column.pop("arm_joint")
    assert scale == 0.0
    assert "holds the default pose" in origin.reason
    assert set(values(column).values()) == {0.25}

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.onboarding.derive_spec.motors import (
    action_scales,
    armatures,
    efforts,
    velocities,
)

HIP = 'effort="23.7" velocity="30.1"'
FIRST = '<limit lower="-1.0472" upper="1.0472" effort="23.7" velocity="30.1"/>'


def without_one(bundled, tmp_path, *, limit):
    """Return the quadruped, with the limit of its first joint written otherwise."""
    plain = bundled("quadruped.urdf")
    text = plain.model.file.read_text(encoding="utf-8").replace(FIRST, limit, 1)
    path = tmp_path / "one.urdf"
    path.write_text(text, encoding="utf-8")
    return Facts(load_robot(path))


def test_what_is_declared_is_taken(bundled, gains):
    facts = bundled("quadruped.urdf")
    column = efforts(facts, gains(facts), facts.mirror_map)
    assert column.values["FR_calf_joint"] == 45.43
    assert dict(column.provenance("effort"))["effort"].reason == "in quadruped.urdf"


def test_what_is_missing_is_that_of_the_twin(bundled, gains, tmp_path):
    facts = without_one(bundled, tmp_path, limit='<limit lower="-1" upper="1"/>')
    twins = facts.mirror_map
    effort = efforts(facts, gains(facts), twins)
    speed = velocities(facts, twins)
    assert effort.values["FL_hip_joint"] == 23.7
    assert speed.values["FL_hip_joint"] == 30.1
    origins = dict(effort.provenance("effort"))
    assert set(origins) == {"effort", "effort.FL_hip_joint"}
    assert origins["effort"].origin == "declared"
    assert origins["effort.FL_hip_joint"].origin == "suggested"
    assert origins["effort.FL_hip_joint"].reason == "none is declared; that of FR_hip_joint"


def test_what_neither_side_declares_is_guessed(bundled, gains, tmp_path):
    facts = bundled("quadruped.urdf", (HIP, ""), tmp_path=tmp_path)
    twins = facts.mirror_map
    column = efforts(facts, gains(facts, stiffness=40.0), twins)
    assert column.values["FL_hip_joint"] == 40.0
    assert "the stiffness at an error of 1 rad" in column.origins["FL_hip_joint"].reason
    held = abs(facts.stance.torques["FL_thigh_joint"])
    weak = efforts(facts, gains(facts, stiffness=0.1), twins)
    assert weak.values["FL_thigh_joint"] == pytest.approx(2 * held, rel=0.01)
    assert "2 times what holds the robot" in weak.origins["FL_thigh_joint"].reason
    speeds = velocities(facts, twins)
    assert speeds.values["FL_hip_joint"] == 20.0
    assert speeds.origins["FL_hip_joint"].origin == "suggested"


def test_armature_is_declared_or_more_where_the_gains_need_it(bundled, gains):
    urdf, mjcf = bundled("quadruped.urdf"), bundled("quadruped.xml")
    assert set(armatures(urdf, gains(urdf)).values.values()) == {0.0}
    needed = armatures(urdf, gains(urdf, armature=0.01))
    assert set(needed.values.values()) == {0.01}
    assert "the joint is too light for its gains" in needed.origins["FL_hip_joint"].reason
    declared = {joint.name: joint.armature for joint in mjcf.actuated}
    kept = armatures(mjcf, gains(mjcf))
    assert kept.values == pytest.approx(declared)
    more = armatures(mjcf, gains(mjcf, armature=1.0))
    assert set(more.values.values()) == {1.0}


@pytest.mark.parametrize(
    ("stiffness", "scale", "reason"),
    [
        (40.0, 0.25 * 23.7 / 40, "0.25 * effort / stiffness"),
        (1.0, 0.5, "0.5 rad, the largest that is suggested"),
        (0.0, 0.25 * 30.1, "0.25 * velocity; without stiffness its target is a speed"),
    ],
)
def test_an_action_asks_for_a_share_of_the_torque(bundled, gains, stiffness, scale, reason):
    facts = bundled("quadruped.urdf")
    gain, twins = gains(facts, stiffness=stiffness), facts.mirror_map
    effort, velocity = efforts(facts, gain, twins), velocities(facts, twins)
    column = action_scales(facts, gain, effort, velocity)
    assert column.values["FL_hip_joint"] == pytest.approx(scale, rel=0.01)
    assert column.origins["FL_hip_joint"].reason == reason


def test_an_action_of_a_short_range_is_short(bundled, gains, tmp_path):
    facts = without_one(
        bundled, tmp_path, limit='<limit lower="-0.1" upper="0.1" effort="23.7" velocity="30.1"/>'
    )
    gain, twins = gains(facts, stiffness=10.0), facts.mirror_map
    effort, velocity = efforts(facts, gain, twins), velocities(facts, twins)
    column = action_scales(facts, gain, effort, velocity)
    assert column.values["FL_hip_joint"] == pytest.approx(0.05)
    assert column.origins["FL_hip_joint"].reason == "0.25 of the joint's range"

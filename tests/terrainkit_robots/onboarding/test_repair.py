from types import SimpleNamespace

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.onboarding.repair import without_placeholder_efforts
from tests.robots import QUADRUPED


def report_of(facts, *found):
    """Return a report with findings, each written as `onboarding joint quantity`."""
    findings = [
        SimpleNamespace(onboarding=onboarding, subject=joint, measured={quantity: 1000})
        for onboarding, joint, quantity in map(str.split, found)
    ]
    return SimpleNamespace(facts=facts, findings=findings)


def test_placeholder_efforts_of_leg_joints_are_removed():
    """They are replaced by an estimate of the torque."""
    facts = Facts(load_robot(QUADRUPED))
    found = ["repairs FL_calf_joint effort", "repairs FR_calf_joint velocity"]
    found += ["reports RL_calf_joint effort", "repairs elbow effort"]
    robot, (change,) = without_placeholder_efforts(report_of(facts, *found))
    unknown = [joint.name for joint in robot.joints if joint.effort is None]
    assert unknown == ["FL_calf_joint"]
    assert change.startswith("the effort limit of FL_calf_joint is a placeholder (45.43 N m); ")
    assert [joint.name for joint in facts.joints if joint.effort is None] == []


def test_robot_without_placeholders_is_unchanged():
    facts = Facts(load_robot(QUADRUPED))
    assert without_placeholder_efforts(report_of(facts)) == (facts, ())

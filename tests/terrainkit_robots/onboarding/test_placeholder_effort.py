from types import SimpleNamespace

from terrainkit_robots.onboarding.placeholder_effort import placeholder_effort


def test_placeholder_efforts_are_of_hinges_of_legs():
    """They are replaced by an estimate of the torque."""
    kinds = {"knee": "revolute", "ankle": "continuous", "shin": "prismatic"}
    robot = SimpleNamespace(leg_joints=[SimpleNamespace(name=n, kind=k) for n, k in kinds.items()])
    found = ["repairs knee effort", "repairs ankle velocity", "reports ankle effort"]
    found += ["repairs shin effort", "repairs elbow effort"]
    findings = [
        SimpleNamespace(onboarding=onboarding, subject=joint, measured={quantity: 1000})
        for onboarding, joint, quantity in map(str.split, found)
    ]
    assert placeholder_effort(robot, findings) == {"knee"}

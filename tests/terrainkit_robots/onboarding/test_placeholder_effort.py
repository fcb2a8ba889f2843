from types import SimpleNamespace

from terrainkit_robots.onboarding.placeholder_effort import placeholder_effort


def test_placeholder_efforts_are_of_hinges_of_legs():
    """They are replaced by an estimate of the torque."""
    kinds = {"knee": "revolute", "ankle": "continuous", "shin": "prismatic"}
    robot = SimpleNamespace(leg_joints=[SimpleNamespace(name=n, kind=k) for n, k in kinds.items()])
    found = ["JNT011 knee effort", "JNT011 ankle velocity", "JNT012 ankle effort"]
    found += ["JNT011 shin effort", "JNT011 elbow effort"]
    findings = [
        SimpleNamespace(code=code, subject=joint, measured={quantity: 1000})
        for code, joint, quantity in map(str.split, found)
    ]
    assert placeholder_effort(robot, findings) == {"knee"}

"""Classify joints: joints of legs, planar base joints."""

from collections import Counter
from collections.abc import Sequence

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.legs.legs import Leg
from terrainkit_robots.description.model import Joint


def leg_joints(legs: Sequence[Leg], bodies: Sequence[Body]) -> list[Joint]:
    """Return the joints that belong to exactly one leg, with those in its closed loops.

    A joint that legs share, such as a waist, is left out.
    """
    joints = [joint for leg in legs for joint in (*leg.joints, *leg.branches)]
    uses = Counter(joint.name for joint in joints)
    unshared = {joint.name for joint in robot_joints(bodies) if uses[joint.name] == 1}
    return [joint for joint in joints if joint.name in unshared]


def robot_joints(bodies: Sequence[Body]) -> list[Joint]:
    """Return the moving joints, except the joints that move the base of a planar model."""
    # Of several bodies on the world, each is a part of the robot.
    is_single = sum(body.parent == 0 for body in bodies) == 1
    base = {0} if is_single and bodies[0].virtual else set()
    found = []
    for body in bodies[1:]:
        if body.parent in base:
            if body.virtual:
                base.add(body.index)
            continue
        if body.joint is not None and body.joint.moves:
            found.append(body.joint)
    return found

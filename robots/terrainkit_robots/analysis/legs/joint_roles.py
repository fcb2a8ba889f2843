"""What joints are for: which are the legs', which carry the trunk, which spin a wheel."""

import math
from collections import Counter

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.cached_fact import per_robot
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import Joint

_BALANCED = 0.1
"""Distance of a centre of mass to the axis over the radius of gyration: a wheel or a propeller has
less, a part of a leg more than 1."""


def leg_joints(robot: Facts) -> list[Joint]:
    """Return the joints of the legs, or where some are called legs, of those.

    A joint that legs share, such as a waist, is of none.
    """
    uses = Counter(joint.name for leg in robot.legs for joint in leg.joints)
    own = {joint.name for joint in own_joints(robot) if uses[joint.name] == 1}
    called = [leg for leg in robot.legs if leg.limb.words]
    return [joint for leg in called or robot.legs for joint in leg.joints if joint.name in own]


def bodies_by_joint(robot: Facts) -> dict[str, Body]:
    """Return the body that each joint moves, by the joint's name."""
    return {body.joint.name: body for body in robot.bodies if body.joint is not None}


@per_robot
def _carriers(robot: Facts) -> frozenset[int | None]:
    """Return the bodies that carry others."""
    return frozenset(body.parent for body in robot.bodies)


def is_wheel(robot: Facts, body: Body) -> bool:
    """Return whether a body is balanced on its axis and carries no other: a wheel, a propeller."""
    if body.joint is None or body.index in _carriers(robot):
        return False
    arm = body.center - body.joint.anchor
    aside = float(np.linalg.norm(arm - (arm @ body.joint.direction) * body.joint.direction))
    moment = float(body.principal[2])
    return body.mass > 0 and moment > 0 and aside < _BALANCED * math.sqrt(moment / body.mass)


def own_joints(robot: Facts) -> list[Joint]:
    """Return the moving joints but those that carry the trunk of a model of the plane."""
    carriers = {0} if robot.bodies and robot.bodies[0].virtual else set()
    found = []
    for body in robot.bodies[1:]:
        if body.parent in carriers:
            if body.virtual:
                carriers.add(body.index)
            continue
        if body.joint is not None and body.joint.moves:
            found.append(body.joint)
    return found

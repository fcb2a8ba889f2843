"""Classify joints: joints of legs, planar base joints, wheels."""

import math
from collections import Counter
from collections.abc import Collection, Sequence

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.legs.legs import Leg
from terrainkit_robots.description.model import Joint

_MAX_WHEEL_OFFSET = 0.1
"""Distance of the center of mass to the axis over the radius of gyration, at most, of a wheel or a
propeller. Parts of legs have more than 1."""


def leg_joints(legs: Sequence[Leg], bodies: Sequence[Body]) -> list[Joint]:
    """Return the joints that belong to exactly one leg.

    If some legs are named as legs, only those count. A joint that legs share, such as a waist, is
    left out.
    """
    uses = Counter(joint.name for leg in legs for joint in leg.joints)
    unshared = {joint.name for joint in robot_joints(bodies) if uses[joint.name] == 1}
    named = [leg for leg in legs if leg.limb.has_leg_names]
    return [joint for leg in named or legs for joint in leg.joints if joint.name in unshared]


def is_wheel(body: Body, parents: Collection[int | None]) -> bool:
    """Return whether a body without children is balanced on its axis: a wheel or a propeller.

    Args:
        body: The body.
        parents: Indices of all bodies with children.
    """
    if body.joint is None or body.index in parents:
        return False
    arm = body.center - body.joint.anchor
    offset = float(np.linalg.norm(arm - (arm @ body.joint.direction) * body.joint.direction))
    moment = float(body.principal[2])
    if body.mass <= 0 or moment <= 0:
        return False
    return offset < _MAX_WHEEL_OFFSET * math.sqrt(moment / body.mass)


def robot_joints(bodies: Sequence[Body]) -> list[Joint]:
    """Return the moving joints, except the joints that move the base of a planar model."""
    base = {0} if bodies and bodies[0].virtual else set()
    found = []
    for body in bodies[1:]:
        if body.parent in base:
            if body.virtual:
                base.add(body.index)
            continue
        if body.joint is not None and body.joint.moves:
            found.append(body.joint)
    return found

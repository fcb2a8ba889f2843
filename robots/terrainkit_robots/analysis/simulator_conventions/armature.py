"""Compare the default armature of Genesis with the inertia that each joint moves.

Genesis adds this armature to all joints without one, which includes every joint of a URDF. If it
exceeds the inertia that a joint moves, the joint responds to torque like a much heavier one.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.inertia.composite_inertia import composite_inertias
from terrainkit_robots.description.model import Joint

GENESIS_ARMATURE = 0.1
"""`default_armature` of the morphs URDF, MJCF and Drone in genesis-world 1.4.5 [kg m2] or [kg]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class JointInertia:
    """A joint without armature, and the inertia that it moves."""

    joint: Joint

    inertia: float
    """Inertia about its axis of all bodies below it, all joints at 0 [kg m2]; for a prismatic joint
    their mass [kg]."""


def inertia_without_armature(
    bodies: Sequence[Body], actuated: Sequence[Joint]
) -> tuple[JointInertia, ...]:
    """Return the inertia of each actuated joint without armature, if it is positive and finite."""
    with np.errstate(all="ignore"):
        inertias = composite_inertias(bodies)
    actuated_set = set(actuated)
    return tuple(
        JointInertia(joint=body.joint, inertia=inertias[body.index])
        for body in bodies
        if body.joint is not None
        and body.joint in actuated_set
        and body.joint.armature == 0
        and math.isfinite(inertias[body.index])
        and inertias[body.index] > 0
    )

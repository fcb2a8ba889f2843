"""Compare the default armature of Genesis with the inertia that each joint moves.

Genesis adds this armature to all joints without one, which includes every joint of a URDF. If it
exceeds the inertia that a joint moves, the joint responds to torque like a much heavier one.
"""

import math
from collections.abc import Sequence

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.inertia.composite_inertia import composite_inertias
from terrainkit_robots.description.model import Joint

GENESIS_ARMATURE = 0.1
"""`default_armature` of the morphs URDF, MJCF and Drone in genesis-world 1.4.5 [kg m2] or [kg]."""


def inertia_without_armature(
    bodies: Sequence[Body], actuated: Sequence[Joint]
) -> dict[Joint, float]:
    """Return the inertia that each actuated joint without armature moves.

    Returns:
        Inertia about its axis of all bodies below a joint, all joints at 0 [kg m2]; for a prismatic
        joint their mass [kg]. Only positive and finite values.
    """
    with np.errstate(all="ignore"):
        inertias = composite_inertias(bodies)
    joints = {joint for joint in actuated if joint.armature == 0}
    return {
        body.joint: inertia
        for body, inertia in zip(bodies, inertias, strict=True)
        if body.joint in joints and 0 < inertia < math.inf
    }

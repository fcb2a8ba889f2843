"""Default armature: the rotor inertia that Genesis gives to joints whose file names none.

A URDF cannot name one, so every joint of a URDF gets it. Where it is more than what the joint moves
by itself, the joint reacts to torque as if it carried something else.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from terrainkit_robots.analysis.inertia.composite_inertia import carried_inertias
from terrainkit_robots.description.model import Joint

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts

GENESIS_ARMATURE = 0.1
"""What `default_armature` of the morphs URDF, MJCF and Drone is in genesis-world 1.4.5 [kg m2] or
[kg]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Moved:
    """A joint without armature and what it moves."""

    joint: Joint

    inertia: float
    """Inertia about its axis of all that is below it, all joints held at 0 [kg m2]; of a prismatic
    joint the mass [kg]."""


def moved_by_joints(facts: "Facts") -> tuple[Moved, ...]:
    """Return the motor-driven joints without armature; those that move no number are left out."""
    driven = set(facts.actuated)
    with np.errstate(all="ignore"):
        inertias = carried_inertias(facts)
    return tuple(
        Moved(joint=body.joint, inertia=inertias[body.index])
        for body in facts.bodies
        if body.joint is not None
        and body.joint in driven
        and body.joint.armature == 0
        and math.isfinite(inertias[body.index])
        and inertias[body.index] > 0
    )

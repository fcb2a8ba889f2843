"""Compare the default armature of Genesis with the inertia that each joint moves.

Genesis adds this armature to all joints without one, which includes every joint of a URDF. If it
exceeds the inertia that a joint moves, the joint responds to torque like a much heavier one.
"""

import math
from collections.abc import Sequence

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.kinematics import joint_axis
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.inertia.merged_inertia import parallel_axis
from terrainkit_robots.description.model import Joint

GENESIS_ARMATURE = 0.1
"""`default_armature` of the morphs URDF, MJCF and Drone in genesis-world 1.4.5 [kg m2] or [kg]."""


def inertia_without_armature(robot: Facts) -> dict[Joint, float]:
    """Return the inertia that each actuated joint without armature moves.

    Returns:
        Inertia about its axis of all bodies below a joint, all joints at 0 [kg m2]; for a prismatic
        joint their mass [kg]. Only positive and finite values.
    """
    with np.errstate(all="ignore"):
        inertias = _composite_inertias(robot.bodies)
    joints = {joint for joint in robot.actuated if joint.armature == 0}
    return {
        body.joint: inertia
        for body, inertia in zip(robot.bodies, inertias, strict=True)
        if body.joint in joints and 0 < inertia < math.inf
    }


def _composite_inertias(bodies: Sequence[Body]) -> list[float]:
    """Return the diagonal of the mass matrix, all joints at 0.

    Args:
        bodies: The bodies, parents first.

    Returns:
        For each body the inertia of it and all bodies below it about the axis of its joint
        [kg m2], or their mass [kg] for a prismatic joint. NaN for a body without a moving joint.
    """
    # Mass, first and second moments about one point, the origin of the trunk, add up over bodies.
    masses = [body.mass for body in bodies]
    firsts = [body.mass * body.zero_center for body in bodies]
    seconds = []
    for body in bodies:
        rotation, shift = body.zero_pose[:3, :3], parallel_axis(body.mass, body.zero_center)
        seconds.append(rotation @ body.inertia @ rotation.T + shift)
    inertias = [math.nan] * len(masses)
    for body in reversed(bodies):  # children before their parents
        index, joint = body.index, body.joint
        if joint is not None and joint.moves:
            point, axis = joint_axis(body, body.zero_pose)
            mass, first, second = masses[index], firsts[index], seconds[index]
            # Shifted from the origin of the trunk to the axis, neither of which is the center of
            # mass, hence the cross terms.
            cross_terms = 2 * (first @ point) * np.eye(3)
            cross_terms -= np.outer(first, point) + np.outer(point, first)
            about_axis = second - cross_terms + parallel_axis(mass, point)
            inertias[index] = mass if joint.kind == "prismatic" else float(axis @ about_axis @ axis)
        if body.parent is not None:
            masses[body.parent] += masses[index]
            firsts[body.parent] = firsts[body.parent] + firsts[index]
            seconds[body.parent] = seconds[body.parent] + seconds[index]
    return inertias

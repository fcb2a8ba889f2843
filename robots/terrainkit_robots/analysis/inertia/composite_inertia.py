"""Compute the inertia that each joint moves, including all bodies below it."""

import math
from collections.abc import Sequence

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.inertia.merged_inertia import parallel_axis


def composite_inertias(bodies: Sequence[Body]) -> list[float]:
    """Return the diagonal of the mass matrix, all joints at 0.

    Args:
        bodies: The bodies, parents first.

    Returns:
        For each body the inertia of it and all bodies below it about the axis of its joint
        [kg m2], or their mass [kg] for a prismatic joint. NaN for a body without a moving joint.
    """
    # Mass, first and second moments about one point, the origin of the trunk, add up over bodies.
    masses = [body.mass for body in bodies]
    firsts = []
    seconds = []
    for body in bodies:
        pose = body.zero_pose
        rotation, center = pose[:3, :3], pose[:3, :3] @ body.center + pose[:3, 3]
        firsts.append(body.mass * center)
        seconds.append(rotation @ body.inertia @ rotation.T + parallel_axis(body.mass, center))
    inertias = [math.nan] * len(masses)
    for body in reversed(bodies):  # children before their parents
        index, joint = body.index, body.joint
        if joint is not None and joint.moves:
            pose = body.zero_pose
            axis, point = pose[:3, :3] @ joint.direction, pose[:3, :3] @ joint.anchor + pose[:3, 3]
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

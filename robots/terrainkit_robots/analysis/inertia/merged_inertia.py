"""Merge the inertias of rigidly connected parts."""

from collections.abc import Iterable

import numpy as np

from terrainkit_robots.description.model import Inertial
from terrainkit_robots.transforms import Matrix


def parallel_axis(mass: float, offset: Matrix) -> Matrix:
    """Return the inertia of a point mass about a point, shape (3, 3) [kg m2].

    By the parallel axis theorem this is the difference between the inertia of a body about a point
    and about its center of mass.

    Args:
        mass: Mass [kg].
        offset: Vector between the two points, shape (3,) [m].
    """
    return np.asarray(mass * (offset @ offset * np.eye(3) - np.outer(offset, offset)))


def merged_inertia(parts: Iterable[tuple[Inertial, Matrix]]) -> Inertial | None:
    """Return the inertial of several parts as one body.

    Args:
        parts: The inertial of each part and the pose of its link, shape (4, 4) [m]. Parts without
            mass are ignored.

    Returns:
        The inertial in the frame of the poses, or None without mass.
    """
    weighted = [
        (part, part.mass, pose @ part.origin)
        for part, pose in parts
        if part.mass is not None and part.mass != 0
    ]
    total = sum(mass for _, mass, _ in weighted)
    if not weighted or total == 0:
        return None
    center = sum((mass * pose[:3, 3] for _, mass, pose in weighted), np.zeros(3)) / total
    # Turn each inertia to the common axes, and shift it from its own center of mass to the common
    # one.
    inertia = np.zeros((3, 3))
    for part, mass, pose in weighted:
        rotation = pose[:3, :3]
        if part.inertia is not None:
            inertia += rotation @ part.inertia @ rotation.T
        inertia += parallel_axis(mass, pose[:3, 3] - center)
    origin = np.eye(4)
    origin[:3, 3] = center
    return Inertial(source=weighted[0][0].source, mass=total, origin=origin, inertia=inertia)

"""Combined inertia: that of several parts which are rigidly connected."""

from collections.abc import Iterable

import numpy as np

from terrainkit_robots.description.model import Inertial
from terrainkit_robots.transforms import Matrix


def combined(parts: Iterable[tuple[Inertial, Matrix]]) -> Inertial | None:
    """Return the inertia of parts as one, in the frame in which they are placed.

    Args:
        parts: Each part and the pose of its link in that frame, shape (4, 4) [m]; parts without a
            mass count for nothing.
    """
    weighed = [
        (part, part.mass, pose @ part.origin)
        for part, pose in parts
        if part.mass is not None and part.mass != 0
    ]
    total = sum(mass for _, mass, _ in weighed)
    if not weighed or total == 0:
        return None
    center = sum((mass * pose[:3, 3] for _, mass, pose in weighed), np.zeros(3)) / total
    inertia = np.zeros((3, 3))
    for part, mass, pose in weighed:
        turn, arm = pose[:3, :3], pose[:3, 3] - center
        if part.inertia is not None:
            inertia += turn @ part.inertia @ turn.T
        inertia += mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))  # parallel axes
    origin = np.eye(4)
    origin[:3, 3] = center
    return Inertial(source=weighed[0][0].source, mass=total, origin=origin, inertia=inertia)

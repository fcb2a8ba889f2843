"""Routes across the patches of a map."""

import numpy as np
from numpy.typing import NDArray

from terrainkit.map.patch import Patch

GOAL_RADIUS = 0.4
"""Horizontal distance at which a goal is reached [m]."""

SPEED = 0.75
"""Speed as a fraction of the largest forward command, as in `evaluate` on a map."""

HEADING_STIFFNESS = 1.0
"""Yaw rate per heading error [1/s]."""


def patch_routes(patch: Patch) -> list[NDArray[np.float64]]:
    """Return the routes across a patch.

    A route leads through the goals of the patch. Without goals, it leads straight to the side that
    is farthest from the spawn origin; there are several routes if several sides are equally far.
    Feasibility assesses paths to the same sides.

    Args:
        patch: The patch.

    Returns:
        Waypoints of each route, x and y in the world frame [m], each of shape (k, 2).
    """
    if len(patch.goals):
        return [patch.goals[:, :2].astype(np.float64)]
    corners = (patch.grid.lower, patch.grid.upper)
    routes = []
    for side, axis in ((1, 0), (1, 1), (0, 0), (0, 1)):
        if patch.far_edges[side, axis]:
            goal = patch.origin[:2].astype(np.float64)
            goal[axis] = corners[side][axis]
            routes.append(goal[None])
    return routes

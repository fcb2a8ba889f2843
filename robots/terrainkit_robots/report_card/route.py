"""Routes across the patches of a map, and the commands that follow them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.patch import Patch
from terrainkit_robots.rl.config import Commands
from terrainkit_robots.transforms import FloatArray, wrap_to_pi

GOAL_RADIUS = 0.4
"""Horizontal distance at which a goal is reached [m]."""

SPEED = 0.75
"""Speed as a fraction of the largest forward command, as in `evaluate` on a map."""

HEADING_STIFFNESS = 1.0
"""Yaw rate per heading error [1/s]."""


def patch_routes(patch: Patch) -> list[NDArray[np.float64]]:
    """Return the routes across a patch: goals in their order, x and y [m], each of shape (k, 2).

    Without goals, a route leads straight to the side that is farthest from the spawn origin; there
    are several routes if several sides are. Feasibility assesses paths to the same sides.
    """
    if len(patch.goals):
        return [patch.goals[:, :2].astype(np.float64)]
    corners, routes = (patch.grid.lower, patch.grid.upper), []
    for side, axis in ((1, 0), (1, 1), (0, 0), (0, 1)):
        if patch.far_sides[side, axis]:
            goal = patch.origin[:2].astype(np.float64)
            goal[axis] = corners[side][axis]
            routes.append(goal[None])
    return routes


@dataclass(eq=False)
class Routes:
    """The routes of n robots, and the goal that each robot walks to."""

    goals: NDArray[np.float64]
    """Goals of each robot [m], shape (n, k, 2), padded with NaN."""

    index: NDArray[np.int64]
    """Next goal of each robot, shape (n,); the number of its goals after the last one."""

    def update(self, position: FloatArray) -> NDArray[np.bool_]:
        """Advance the robots that are at their goal; return which have reached the last one.

        `position` is x and y [m], shape (n, 2).
        """
        reached = np.linalg.norm(self._current() - position, axis=1) <= GOAL_RADIUS
        self.index += reached
        return self.index >= self._numbers()

    def lengths(self, start: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the lengths of the routes from the starts of the robots (n, 2) [m], shape (n,)."""
        points = np.concatenate([start[:, None], self.goals], axis=1)
        legs = np.linalg.norm(np.diff(points, axis=1), axis=2)
        return np.asarray(np.nansum(legs, axis=1))

    def commands(self, position: FloatArray, yaw: FloatArray, cfg: Commands) -> NDArray[np.float32]:
        """Return velocity commands toward the goals, shape (n, 3): turn to it, then walk ahead."""
        x, y = (self._current() - position).T
        error = np.nan_to_num(wrap_to_pi(np.arctan2(y, x) - yaw))
        forward = SPEED * cfg.lin_vel_x[1] * np.maximum(np.cos(error), 0)
        yaw_rate = np.clip(HEADING_STIFFNESS * error, *cfg.ang_vel_yaw)
        return np.column_stack([forward, np.zeros_like(forward), yaw_rate]).astype(np.float32)

    def _numbers(self) -> NDArray[np.int64]:
        return np.asarray((~np.isnan(self.goals[..., 0])).sum(axis=1))

    def _current(self) -> NDArray[np.float64]:
        """Return the next goals, the last ones after them, shape (n, 2)."""
        index = np.minimum(self.index, self._numbers() - 1)
        return self.goals[np.arange(len(index)), index]

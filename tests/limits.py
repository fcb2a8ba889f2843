"""Limits of a robot whose demands are easy to work out by hand, and open ground for it."""

import numpy as np

from terrainkit.feasibility import RobotLimits
from terrainkit.feasibility.columns import Columns

LIMITS = RobotLimits(
    step_up=0.2,
    step_down=0.25,
    gap=0.4,
    slope=0.5,
    foothold=0.1,
    body_width=0.4,
    standing_height=0.6,
    crouched_height=0.3,
)


def columns_of(heights, ceiling=np.inf):
    """Return columns of 0.1 m with these floors, shape (nx, ny) or (nx, ny, m)."""
    floor = np.array(heights, float)
    floor = floor[..., None] if floor.ndim == 2 else floor
    ceiling = np.broadcast_to(ceiling, floor.shape).copy()
    friction = np.ones_like(floor)
    return Columns(spacing=0.1, lower=(0.0, 0.0), floor=floor, ceiling=ceiling, friction=friction)

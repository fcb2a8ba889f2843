"""Limits of a robot whose demands are easy to work out by hand."""

from terrainkit.feasibility import RobotLimits

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

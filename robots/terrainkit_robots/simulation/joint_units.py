"""Units of revolute and prismatic joints."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class JointUnits:
    """Units of the quantities of a joint."""

    position: str
    velocity: str
    effort: str
    """Unit of the torque or force."""

    inertia: str


REVOLUTE = JointUnits(position="rad", velocity="rad/s", effort="N m", inertia="kg m2")
PRISMATIC = JointUnits(position="m", velocity="m/s", effort="N", inertia="kg")

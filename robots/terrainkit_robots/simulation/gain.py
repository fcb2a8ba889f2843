"""The gains of a PD controller."""

from dataclasses import dataclass
from typing import Literal

GainSet = Literal["stand", "train"]
"""Which gains to suggest: `stand` holds the default pose without a policy. `train` is as soft as
published training configurations, in which the policy holds the pose."""


@dataclass(frozen=True, kw_only=True)
class Gain:
    """PD gains of a joint: torque = stiffness * (target - q) - damping * dq."""

    stiffness: float
    """Proportional gain [N m/rad] or [N/m]. 0 for a wheel, whose target is a velocity."""

    damping: float
    """Derivative gain [N m s/rad] or [N s/m]."""

    armature: float
    """Reflected inertia of the rotor [kg m2] or [kg]: as declared, or more if the joint is too
    light for its gains."""

    reason: str
    """How the gains were computed, or where they are declared."""

    declared: bool = False
    """Whether the file of the robot declares them."""

"""Drives: how the motor of a joint is controlled in a MJCF."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class ActuatorConfig:
    """A position controller: torque = stiffness * (target - q) - damping * dq, up to effort.

    Without stiffness it is one of speed: torque = damping * (target - dq).
    """

    stiffness: float
    """[N m/rad] or [N/m]."""

    damping: float
    """[N m s/rad] or [N s/m]."""

    effort: float | None = None
    """Largest torque [N m] or force [N]; None if it is not limited."""

    armature: float = 0.0
    """Inertia of the rotor, reflected to the joint [kg m2] or [kg]."""

    velocity: float | None = None
    """Largest speed that a wheel may be told [rad/s]; None if it is not limited."""

    @property
    def is_velocity_control(self) -> bool:
        """Return whether it is told a speed, as a wheel is."""
        return self.stiffness == 0 and self.damping > 0

"""Controller of an actuated joint."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class ActuatorConfig:
    """PD controller: torque = stiffness * (target - q) - damping * dq, limited by effort.

    Without stiffness it controls velocity: torque = damping * (target - dq).
    """

    stiffness: float
    """Proportional gain [N m/rad] or [N/m]."""

    damping: float
    """Derivative gain [N m s/rad] or [N s/m]."""

    effort: float | None = None
    """Maximum torque [N m] or force [N]; None if unlimited."""

    armature: float = 0.0
    """Reflected rotor inertia [kg m2] or [kg]."""

    velocity: float | None = None
    """Maximum commanded speed of a wheel [rad/s]; None if unlimited."""

    @property
    def is_velocity_control(self) -> bool:
        """Return whether the command is a velocity, as for a wheel."""
        return self.stiffness == 0 and self.damping > 0

"""The state: all that observations and rewards may look at, after a step of the environment."""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float32]


@dataclass(frozen=True, kw_only=True, eq=False)
class Measured:
    """What is measured of n robots: j joints, f feet, p penalized bodies, k points of the scan.

    The arrays are copies: they stay what they are when the physics goes on.
    """

    base_pos: FloatArray
    """Position of the base in the world [m], shape (n, 3)."""

    base_quat: FloatArray
    """Rotation of the base, shape (n, 4)."""

    base_lin_vel: FloatArray
    """Velocity of the base in its own frame [m/s], shape (n, 3)."""

    base_ang_vel: FloatArray
    """Angular velocity of the base in its own frame [rad/s], shape (n, 3)."""

    projected_gravity: FloatArray
    """Direction of gravity in the base's frame, shape (n, 3); upright is (0, 0, -1)."""

    base_height: FloatArray
    """Height of the base above the ground under it [m], shape (n,)."""

    dof_pos: FloatArray
    """Position of the joints [rad], shape (n, j)."""

    dof_vel: FloatArray
    """Speed of the joints [rad/s], shape (n, j)."""

    dof_acc: FloatArray
    """Change of the speed since the last step, per second [rad/s2], shape (n, j)."""

    torques: FloatArray
    """Torque of the motors [N m], shape (n, j)."""

    foot_height: FloatArray
    """Height of the feet above the ground under them [m], shape (n, f)."""

    foot_vel: FloatArray
    """Velocity of the feet in the world [m/s], shape (n, f, 3)."""

    foot_force: FloatArray
    """Force of the ground on the feet, in the world's frame [N], shape (n, f, 3)."""

    first_contact: NDArray[np.bool_]
    """Feet that have just come down, shape (n, f)."""

    air_time: FloatArray
    """Time since each foot left the ground, up to this step [s], shape (n, f)."""

    penalized_force: FloatArray
    """Force on each penalized body [N], shape (n, p)."""

    height_scan: FloatArray
    """Height of the base above each point of the scan [m], shape (n, k); empty without one."""

    fallen: NDArray[np.bool_]
    """Robots whose episode ends as a fall, shape (n,)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class State(Measured):
    """What is measured of n robots, and what is known of them otherwise."""

    actions: FloatArray
    """The actions of this step, shape (n, j)."""

    last_actions: FloatArray
    """The actions of the step before, shape (n, j)."""

    last_last_actions: FloatArray
    """The actions of the step before that, shape (n, j)."""

    commands: FloatArray
    """What is asked for: speed forward, to the left [m/s], turning [rad/s], shape (n, 3)."""

    push_vel: FloatArray
    """What a push in this step added to the base's velocity, in the world's frame [m/s], shape
    (n, 3); of one before there is nothing left but that velocity, so it is 0 again."""

    friction: FloatArray
    """Friction of the robot's contacts, shape (n, 1)."""

    added_mass: FloatArray
    """Mass added to the base [kg], shape (n, 1)."""

    com_shift: FloatArray
    """Shift of the base's center of mass, in its frame [m], shape (n, 3)."""

    joint_offset: FloatArray
    """Error of the zero of each joint: what is measured less what is [rad], shape (n, j)."""

    def put(self, ids: NDArray[np.int64], other: "State") -> None:
        """Take over the robots `ids` from a state of those alone."""
        for field in fields(self):
            getattr(self, field.name)[ids] = getattr(other, field.name)

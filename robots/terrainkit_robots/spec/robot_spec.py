"""RobotSpec: what training needs to know of a robot, in one place, with units and origins.

A robot that was onboarded has it as `robot.toml`; users edit that file. Tables by joint take
patterns, as the frameworks of the field do: a key is the name of a joint, or a regular expression
that has to match the whole of it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

Origin = Literal["declared", "measured", "solved", "suggested"]
"""Where a value came from: written in the robot's file; measured on it, in geometry or simulation;
solved, as the standing pose is; or suggested, by a rule that `reason` states."""


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """Where a value came from."""

    origin: Origin

    reason: str = ""
    """How, in a few words."""


@dataclass(frozen=True, kw_only=True)
class Twin:
    """The mirror image of a joint: q of the joint looks like `sign` times q of the twin."""

    joint: str
    """Name of the twin; a joint in the mirror plane is its own."""

    sign: int
    """+1 or -1."""


PerJoint = Mapping[str, float]


def _in(unit: str) -> Any:
    """Return a field that is measured in `unit`."""
    return field(metadata={"unit": unit})


def _maybe(unit: str) -> Any:
    """Return a field that is measured in `unit`, and that a robot without legs has not."""
    return field(default=None, metadata={"unit": unit})


@dataclass(frozen=True, kw_only=True)
class RobotSpec:
    """A robot as training sees it. SI units and radians."""

    name: str
    """Name of the robot."""

    urdf: str
    """Its URDF, relative to the folder of the spec."""

    mjcf: str
    """Its MJCF, relative to the folder of the spec."""

    floating: bool
    """Whether the base moves freely; False for an arm that is bolted down."""

    joint_order: tuple[str, ...]
    """The actuated joints in the order of actions, observations and MuJoCo's actuators."""

    base: str
    """Body that carries the limbs."""

    feet: tuple[str, ...] = ()
    """Bodies that touch the ground, one a leg, in the order of the legs."""

    shanks: tuple[str, ...] = ()
    """Bodies below the knees, one a leg, in the order of `feet`."""

    thighs: tuple[str, ...] = ()
    """Bodies between hip and knee, one a leg, in the order of `feet`."""

    termination_contacts: tuple[str, ...] = ()
    """Bodies whose contact with the ground ends an episode."""

    penalized_contacts: tuple[str, ...] = ()
    """Bodies whose contacts cost reward."""

    default_pose: PerJoint = _in("rad or m")
    """Position of each joint that actions are added to."""

    stiffness: PerJoint = _in("N m/rad or N/m")
    """Proportional gain of each joint."""

    damping: PerJoint = _in("N m s/rad or N s/m")
    """Derivative gain of each joint."""

    effort: PerJoint = _in("N m or N")
    """Largest torque or force of each joint."""

    velocity: PerJoint = _in("rad/s or m/s")
    """Largest speed of each joint."""

    armature: PerJoint = _in("kg m2 or kg")
    """Inertia of each motor's rotor, reflected to the joint."""

    action_scale: PerJoint = _in("rad or m")
    """Change of a joint's target for an action of 1."""

    soft_limits: Mapping[str, tuple[float, float]] = _in("rad or m")
    """Lower and upper position of each joint with limits, that rewards keep it within."""

    reset_range: tuple[float, float] = field(default=(0.5, 1.5), metadata={"unit": "1"})
    """Factors on the default pose between which a joint starts an episode."""

    base_height_target: float | None = _maybe("m")
    """Height of the base's origin above the ground that rewards ask for."""

    spawn_height: float | None = _maybe("m")
    """Height of the base's origin above the ground at which the robot is let go."""

    leg_length: float | None = _maybe("m")
    """From hip over knee and ankle to the contact, mean of the legs."""

    stance_width: float | None = _maybe("m")
    """Distance between the left and right feet that are farthest apart, along the mirror's normal."""

    foot_radius: float | None = _maybe("m")
    """Radius of a ball foot; of a flat sole half of its width."""

    mirror: Mapping[str, Twin] = field(default_factory=dict)
    """The twin of each actuated joint that has one, by name."""

    provenance: Mapping[str, Provenance] = field(default_factory=dict)
    """Where each value came from, by the name of its field."""


def unit_of(name: str) -> str:
    """Return the unit of the field `name`; empty for one that is not a number."""
    unit: str = RobotSpec.__dataclass_fields__[name].metadata.get("unit", "")
    return unit

"""RobotSpec: what training needs to know of a robot, in one place, with units and origins.

A robot that was onboarded has it as `robot.toml`; users edit that file. Tables by joint take
patterns, as the frameworks of the field do: a key is the name of a joint, or a regular expression
that has to match the whole of it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Literal

from terrainkit.coerce import coerce
from terrainkit.errors import ConfigError, listing
from terrainkit_robots.spec.checked import checked
from terrainkit_robots.spec.per_joint import by_joint

Origin = Literal["declared", "measured", "solved", "suggested", "given"]
"""Where a value came from: written in the robot's file; measured on it, in geometry or simulation;
solved, as the standing pose is; suggested, by a rule that `reason` states; or given, in a spec that
somebody edited."""


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """Where a value came from."""

    origin: Origin

    reason: str = ""
    """How, in a few words."""

    def __post_init__(self) -> None:
        """Check it.

        Raises:
            ConfigError: if the origin is another, or the reason is no text.
        """
        coerce("origin", self.origin, Origin)
        coerce("reason", self.reason, str)


@dataclass(frozen=True, kw_only=True)
class Twin:
    """The mirror image of a joint: q of the joint looks like `sign` times q of the twin."""

    joint: str
    """Name of the twin; a joint in the mirror plane is its own."""

    sign: int
    """+1 or -1."""

    def __post_init__(self) -> None:
        """Check it.

        Raises:
            ConfigError: if the sign is neither, or the joint is no name.
        """
        coerce("joint", self.joint, str)
        if coerce("sign", self.sign, int) not in (-1, 1):
            raise ConfigError(f"sign is {self.sign}; wanted 1 or -1")


PerJoint = Mapping[str, float]


def _in(unit: str, least: float | None = None, *, above: bool = False) -> Mapping[str, Any]:
    """Return what is known of numbers in `unit`, nowhere below `least`, or all `above` it."""
    return {"unit": unit, "least": least, "above": above}


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

    default_pose: PerJoint = field(metadata=_in("rad or m"))
    """Position of each joint that actions are added to."""

    stiffness: PerJoint = field(metadata=_in("N m/rad or N/m", 0.0))
    """Proportional gain of each joint."""

    damping: PerJoint = field(metadata=_in("N m s/rad or N s/m", 0.0))
    """Derivative gain of each joint."""

    effort: PerJoint = field(metadata=_in("N m or N", 0.0, above=True))
    """Largest torque or force of each joint."""

    velocity: PerJoint = field(metadata=_in("rad/s or m/s", 0.0))
    """Largest speed of each joint."""

    armature: PerJoint = field(metadata=_in("kg m2 or kg", 0.0))
    """Inertia of each motor's rotor, reflected to the joint."""

    action_scale: PerJoint = field(metadata=_in("rad or m", 0.0))
    """Change of a joint's target for an action of 1; of a joint without stiffness, such as a wheel,
    the target is a speed."""

    soft_limits: Mapping[str, tuple[float, float]] = field(metadata=_in("rad or m"))
    """Lower and upper position of each joint with limits, that rewards keep it within."""

    reset_range: tuple[float, float] = field(default=(0.5, 1.5), metadata=_in("1", 0.0))
    """Factors on the default pose between which a joint starts an episode."""

    base_height_target: float | None = field(default=None, metadata=_in("m"))
    """Height of the base's origin above the ground that rewards ask for."""

    spawn_height: float | None = field(default=None, metadata=_in("m"))
    """Height of the base's origin above the ground at which the robot is let go."""

    leg_length: float | None = field(default=None, metadata=_in("m", 0.0))
    """From hip over knee and ankle to the contact, mean of the legs."""

    stance_width: float | None = field(default=None, metadata=_in("m", 0.0))
    """Distance between the feet that are farthest apart to the left and right."""

    foot_radius: float | None = field(default=None, metadata=_in("m", 0.0))
    """Radius of a ball foot; of a flat sole half of its width."""

    mirror: Mapping[str, Twin] = field(default_factory=dict)
    """The twin of each actuated joint that has one, by name."""

    provenance: Mapping[str, Provenance] = field(default_factory=dict)
    """Where values came from: by the name of the field, and by `field.key` what differs in a table,
    such as `effort.FL_calf_joint`."""

    def __post_init__(self) -> None:
        """Check every value; numbers become floats, lists tuples.

        Whether the tables name all joints is not asked here: a file that is edited has to be read
        before it can be told what is wrong with it.

        Raises:
            ConfigError: if a value is of another kind, not finite, or out of its range.
        """
        for each in fields(self):
            object.__setattr__(self, each.name, checked(each, getattr(self, each.name)))
        known = [each.name for each in fields(self)]
        for key in self.provenance:
            if key.partition(".")[0] not in known:
                raise ConfigError(f"provenance has {key!r}; wanted one of: {listing(known)}")

    def per_joint(self, name: str) -> dict[str, float]:
        """Return the value of each joint in the table `name`, in the order of `joint_order`.

        Args:
            name: A table with a value for every joint, such as `stiffness`.

        Raises:
            ConfigError: if a joint is not matched exactly once, or a key matches none.
        """
        if name not in JOINT_TABLES:
            raise ConfigError(f"no table by joint {name!r}; there are: {listing(JOINT_TABLES)}")
        return by_joint(getattr(self, name), self.joint_order, name)


JOINT_TABLES = tuple(each.name for each in fields(RobotSpec) if each.type == PerJoint)
"""Tables that have a value for every joint."""


def unit_of(name: str) -> str:
    """Return the unit of the field `name`; empty for one that is not a number."""
    unit: str = RobotSpec.__dataclass_fields__[name].metadata.get("unit", "")
    return unit

"""RobotSpec: the parameters of a robot that training needs, with units and provenance.

An onboarded robot has it as `robot.toml`, which users edit. Tables by joint accept patterns, as in
Isaac Lab and mjlab: a key is the name of a joint, or a regular expression that matches a whole
name. Beside each number the file has its unit and where it came from; the table `provenance` keeps
the latter as data.
"""

import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal, Self, get_args, get_origin

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from terrainkit.errors import ConfigError, listing
from terrainkit.settings.field_docs import field_docs
from terrainkit.settings.schema import Config, field_types
from terrainkit.settings.toml_text import LINE_LENGTH, comment_text, line_text
from terrainkit.settings.type_hint import SORTED, UNIQUE, parse_hint
from terrainkit_robots.spec.per_joint import by_joint

FORMAT_VERSION = 1
"""Version of the file format; it changes when an old file would be misread."""

Origin = Literal["declared", "measured", "solved", "suggested", "given"]
"""Where a value came from: declared in the robot's file; measured on its geometry or in simulation;
solved, as the standing pose; suggested by a rule that `reason` states; given in an edited spec."""

Name = Annotated[
    str, Meta(min_length=1, pattern=r"^[^\0\ud800-\udfff]+$", description="a non-empty string")
]
Names = Annotated[tuple[Name, ...], UNIQUE]

Position = Annotated[float, Meta(extra={"unit": "rad or m"})]
Scale = Annotated[float, Meta(ge=0, extra={"unit": "rad or m"})]
Stiffness = Annotated[float, Meta(ge=0, extra={"unit": "N m/rad or N/m"})]
Damping = Annotated[float, Meta(ge=0, extra={"unit": "N m s/rad or N s/m"})]
Effort = Annotated[float, Meta(gt=0, extra={"unit": "N m or N"})]
Velocity = Annotated[float, Meta(ge=0, extra={"unit": "rad/s or m/s"})]
Armature = Annotated[float, Meta(ge=0, extra={"unit": "kg m2 or kg"})]
Factor = Annotated[float, Meta(ge=0, extra={"unit": "1"})]
Height = Annotated[float, Meta(extra={"unit": "m"})]
Length = Annotated[float, Meta(ge=0, extra={"unit": "m"})]

_HEAD = """\
# The spec of {name} for training. SI units, radians, z up. You can edit every value.
#
# In a table by joint, a key is the name of a joint or a regular expression that matches the whole
# name, such as ".*_hip_joint". Each joint must be matched exactly once. The comments state the unit
# of each number, and its origin when this file was written, as does the table [provenance].
"""


@dataclass(frozen=True, kw_only=True)
class Provenance(Config):
    """Where a value came from."""

    origin: Origin
    """Kind of source."""

    reason: str = ""
    """Method, in a few words."""

    def to_table(self) -> dict[str, Any]:
        """Return the values that a TOML file holds, by key."""
        return {key: value for key, value in super().to_table().items() if value}

    def __str__(self) -> str:
        """Return such as `measured: drop test`."""
        return f"{self.origin}: {self.reason}" if self.reason else self.origin


@dataclass(frozen=True, kw_only=True)
class MirrorJoint(Config):
    """The mirror image of a joint: q of the joint looks like `sign` times q of the other joint."""

    joint: Name
    """Name of the other joint; a joint in the mirror plane is its own mirror image."""

    sign: Literal[1, -1]
    """+1 or -1."""


Point = tuple[Height, Height, Height]


@dataclass(frozen=True, kw_only=True)
class ClosedLoop(Config):
    """A loop that a URDF cannot have: two links share a point."""

    links: Annotated[tuple[Name, Name], UNIQUE]
    """The two links."""

    anchor: Point
    """The point in the frame of the first link [m]."""

    other_anchor: Point | None = None
    """The point in the frame of the second link [m]; none: where it is with all joints at zero."""

    kind: Literal["connect", "weld"] = "connect"
    """Whether the links may turn about the point, or keep their orientation at zero as well."""


@dataclass(frozen=True, kw_only=True)
class RobotSpec(Config):
    """The parameters of a robot that training needs besides its description. SI units and radians.

    The tables need not name all joints: an edited file is read first and checked then.

    Raises:
        ConfigError: if a value has the wrong type, is not finite, or is out of range.
    """

    name: Name
    """Name of the robot."""

    urdf: Name
    """URDF file, relative to the folder of the spec."""

    mjcf: Name
    """MJCF file, relative to the folder of the spec."""

    floating: bool
    """Whether the base moves freely; false for a robot with a fixed base, such as an arm."""

    joint_order: Names
    """The actuated joints in the order of actions, observations and MuJoCo's actuators."""

    base: Name
    """Body whose pose is the pose of the robot."""

    feet: Names = ()
    """Bodies that touch the ground, one per leg, in the order of the legs."""

    shanks: Names = ()
    """Bodies below the knees, one per leg, in the order of `feet`."""

    thighs: Names = ()
    """Bodies between hip and knee, one per leg, in the order of `feet`."""

    termination_contacts: Names = ()
    """Bodies whose contact with the ground ends an episode."""

    penalized_contacts: Names = ()
    """Bodies whose contacts are penalized."""

    loops: tuple[ClosedLoop, ...] = ()
    """Closed loops of the robot, which the URDF cannot have; the MJCF has them."""

    default_pose: Mapping[Name, Position]
    """Position of each joint that its action is added to."""

    stiffness: Mapping[Name, Stiffness]
    """Proportional gain of each joint."""

    damping: Mapping[Name, Damping]
    """Derivative gain of each joint."""

    effort: Mapping[Name, Effort]
    """Maximum torque or force of each joint."""

    velocity: Mapping[Name, Velocity]
    """Maximum velocity of each joint."""

    armature: Mapping[Name, Armature]
    """Rotor inertia of each motor, reflected to the joint."""

    action_scale: Mapping[Name, Scale]
    """Change of a joint's position target for an action of 1; of its velocity target if it has no
    stiffness, such as a wheel."""

    soft_limits: Mapping[Name, Annotated[tuple[Position, Position], SORTED]]
    """Lower and upper position that rewards keep each joint with limits within."""

    reset_range: Annotated[tuple[Factor, Factor], SORTED] = (0.5, 1.5)
    """Range of the factors by which the default pose is scaled at a reset."""

    base_height_target: Height | None = None
    """Target height of the base's origin above the ground for rewards."""

    spawn_height: Height | None = None
    """Height of the base's origin above the ground at a reset."""

    leg_length: Length | None = None
    """Length from the hip via knee and ankle to the contact point, mean of all legs."""

    stance_width: Length | None = None
    """Lateral distance between the outermost feet."""

    foot_radius: Length | None = None
    """Radius of a spherical foot, or half of the width of a flat sole."""

    mirror: Mapping[Name, MirrorJoint] = field(default_factory=dict)
    """Mirror image of each actuated joint that has one, by name."""

    provenance: Mapping[Name, Provenance] = field(default_factory=dict)
    """Origin of the values, by the name of the field, or by `field.key` for a differing entry of a
    table, such as `effort.FL_calf_joint`."""

    def __post_init__(self) -> None:
        super().__post_init__()
        known = field_types(RobotSpec)
        for key in self.provenance:
            if key.partition(".")[0] not in known:
                raise ConfigError(f"provenance: got {key!r}; expected one of: {listing(known)}")

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

    def joint_array(self, name: str) -> NDArray[np.float32]:
        """Return `per_joint` as an array in the order of `joint_order`, shape (j,)."""
        return np.array(list(self.per_joint(name).values()), np.float32)

    def mirror_joints(self) -> list[MirrorJoint]:
        """Return the mirror image of each joint, in the order of `joint_order`.

        Raises:
            ConfigError: if a joint has none, or is not the mirror image of its own.
        """
        for name in self.joint_order:
            pair = self.mirror.get(name, MirrorJoint(joint="nothing", sign=1))
            image = MirrorJoint(joint=name, sign=pair.sign)
            if pair.joint not in self.joint_order or self.mirror.get(pair.joint) != image:
                raise ConfigError(
                    f"mirror of {self.name}: {name} is paired with {pair.joint}; symmetry expects "
                    f"a joint that is paired with {name} with the same sign"
                )
        return [self.mirror[name] for name in self.joint_order]

    @classmethod
    def from_table(
        cls, table: Mapping[str, Any], default: Self | None = None, path: str = ""
    ) -> Self:
        """Return the spec that a TOML table describes; see `Config.from_table`."""
        version = table.get("format_version", "nothing")
        if version != FORMAT_VERSION or isinstance(version, bool):
            raise ConfigError(f"format_version: got {version}; expected {FORMAT_VERSION}")
        values = {key: value for key, value in table.items() if key != "format_version"}
        return super().from_table(values, default, path)

    def to_toml(self) -> str:
        """Return the spec as TOML with comments; `from_toml` restores it."""
        docs, values, tables = field_docs(RobotSpec), [], []
        for name, value in self.to_table().items():
            about = "".join(f"# {line}\n" for line in textwrap.wrap(docs[name], LINE_LENGTH - 2))
            unit = unit_of(name)
            comments = ("no unit" if unit == "1" else unit, self._origin_text(name))
            if isinstance(value, Mapping):
                header = f"{about}[{name}]{comment_text(*comments)}"
                tables.append("\n".join([header, *self._table_lines(name, value), ""]))
            elif name == "loops":
                for loop in self.loops:
                    lines = (line_text(k, v) for k, v in loop.to_table().items() if v is not None)
                    tables.append("\n".join([f"{about}[[loops]]", *lines, ""]))
                    about = ""
            elif value is not None:
                values.append(f"{about}{line_text(name, value, *comments)}\n")
        head = _HEAD.format(name=comment_text(self.name)[4:] or "The robot")
        return "\n".join([head, f"format_version = {FORMAT_VERSION}\n", *values, *tables])

    def _table_lines(self, name: str, table: Mapping[str, Any]) -> Iterator[str]:
        for key, value in table.items():
            item = value.to_table() if isinstance(value, Config) else value
            origin = self._origin_text(f"{name}.{key}") if name != "provenance" else ""
            yield line_text(key, item, origin)

    def _origin_text(self, key: str) -> str:
        return str(self.provenance.get(key, ""))


def unit_of(name: str) -> str:
    """Return the unit of the field `name`; empty if it is not a number."""
    return next(_units(field_types(RobotSpec)[name]), "")


def _units(hint: Any) -> Iterator[str]:
    parsed = parse_hint(hint)
    if "unit" in parsed.constraints:
        yield parsed.constraints["unit"]
    for part in parsed.args if parsed.origin is not Literal else ():
        yield from _units(part)


JOINT_TABLES = tuple(
    name
    for name, annotation in field_types(RobotSpec).items()
    if get_origin(annotation) is Mapping and parse_hint(get_args(annotation)[1]).kind is float
)
"""Tables that have a value for every joint."""

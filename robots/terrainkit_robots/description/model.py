"""The robot as its file says it is: plain data, each element with the file and line it came from.

URDF, xacro and MJCF are read into the same classes. Nothing is corrected on the way: a mass that is
negative stays negative, and what could not be read at all is a `Problem`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from terrainkit_robots.transforms import Matrix

Kind = Literal["urdf", "xacro", "mjcf"]

MOVING = frozenset({"revolute", "continuous", "prismatic"})
"""Joints with one degree of freedom, as URDF calls them; MJCF's hinge and slide become these."""

JOINT_TYPES = MOVING | {"fixed", "floating", "planar", "ball"}


@dataclass(frozen=True, kw_only=True)
class Source:
    """Where an element is written."""

    file: Path
    """The file, as it was given or included."""

    line: int
    """Line on which the element starts; the first is 1, and 0 stands for the file as a whole."""

    element: int | None = None
    """Which element of the file it is, counted from 0 as they start; None where it cannot be
    edited: in a file that is not well-formed, or made from xacro."""


@dataclass(frozen=True, kw_only=True)
class Problem:
    """Something that could not be read; the rule of the same code reports it."""

    code: str
    """Code of the rule."""

    message: str
    """What was found, and what was wanted."""

    source: Source
    """Where."""

    subject: str = ""
    """Name of the link, joint or file it belongs to."""

    details: Mapping[str, str] = field(default_factory=dict)
    """What a fix needs to know, such as the attribute's name."""


def _identity() -> Matrix:
    return np.eye(4)


@dataclass(frozen=True, kw_only=True, eq=False)
class Inertial:
    """Mass and its distribution, as declared."""

    source: Source

    mass: float | None
    """Mass [kg]; None if it is missing or not a number, NaN where MuJoCo takes it from a mesh."""

    origin: Matrix = field(default_factory=_identity)
    """Frame of the centre of mass and of the inertia in the link's, shape (4, 4) [m]."""

    inertia: Matrix | None = None
    """Inertia about the centre of mass in the frame `origin`, shape (3, 3) [kg m2]; None if it is
    missing or not of numbers, NaN where MuJoCo takes it from a mesh."""

    inertia_source: Source | None = None
    """The element that holds the six numbers, if it is another than `source`."""

    attribute: str = ""
    """The attribute that holds the inertia, `diaginertia` or `fullinertia`; MJCF only."""

    axes_attribute: str = ""
    """The attribute that turns the axes of `origin`: `quat`, `euler` or others; MJCF only."""

    missing: tuple[str, ...] = ()
    """Those of ixx, iyy and izz that are not written; URDF only."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshFile:
    """A reference to a mesh file."""

    source: Source

    filename: str
    """The name, as written."""

    path: Path
    """Where that is on this machine; the file may not exist."""

    attribute: str = "filename"
    """The attribute of `source` that holds the name."""

    found_by: Literal["path", "package", "search", "nothing"] = "path"
    """How `path` came about: a plain path, a package that was named or has a package.xml, a search
    in the folders around, or nothing (`path` is a guess)."""

    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Factor on each axis."""

    scale_source: Source | None = None
    """The element that holds the scale, if it is another than `source`."""


ShapeKind = Literal["box", "sphere", "cylinder", "capsule", "ellipsoid", "plane", "mesh", "unknown"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Geometry:
    """A shape on a link, to be seen or to collide."""

    source: Source

    shape: ShapeKind

    name: str = ""
    """Its own name, if it has one."""

    size: tuple[float, ...] = ()
    """MuJoCo's size numbers [m]: box, three half lengths; sphere, radius; cylinder and capsule,
    radius and half length along z; ellipsoid, three radii; none for a mesh or a plane."""

    size_source: Source | None = None
    """The element that holds the size, if it is another than `source`."""

    origin: Matrix = field(default_factory=_identity)
    """Pose in the link's frame, shape (4, 4) [m]."""

    mesh: MeshFile | None = None
    """The file of a mesh."""

    contype: int = 1
    """Bits of what it collides as; MJCF only."""

    conaffinity: int = 1
    """Bits of what it collides with: two shapes do if the bits of one meet the other's."""

    fit_to_mesh: bool = False
    """Whether MuJoCo fits the primitive to the mesh, whose shape this is not; MJCF only."""

    color: tuple[float, float, float, float] | None = None
    """Red, green, blue and opacity that it is drawn with, in 0..1; None if the file gives none."""

    @property
    def contacts(self) -> bool:
        """Whether it can touch anything at all."""
        return bool(self.contype or self.conaffinity)


@dataclass(frozen=True, kw_only=True, eq=False)
class Link:
    """A rigid part: a URDF link or a MJCF body."""

    name: str
    source: Source
    inertial: Inertial | None = None
    collisions: tuple[Geometry, ...] = ()
    visuals: tuple[Geometry, ...] = ()

    virtual: bool = False
    """Whether no element stands for it: it lies between two joints of one MJCF body."""


@dataclass(frozen=True, kw_only=True)
class Limit:
    """Limits of a joint, as declared; None where there is none, or not a number."""

    source: Source

    lower: float | None = None
    """Lowest position [rad] or [m]."""

    upper: float | None = None
    """Highest position [rad] or [m]."""

    effort: float | None = None
    """Largest torque [N m] or force [N]."""

    velocity: float | None = None
    """Largest speed [rad/s] or [m/s]; MJCF has none."""


@dataclass(frozen=True, kw_only=True)
class Mimic:
    """A joint that follows another: q = multiplier * q_of_target + offset."""

    source: Source
    joint: str
    """Name of the joint that is followed."""

    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Joint:
    """What joins a link to its parent."""

    name: str
    source: Source

    kind: str
    """One of JOINT_TYPES, or whatever else is written; MJCF's hinge is revolute where it has a
    range and continuous where it has none, its slide prismatic, its free joint floating."""

    parent: str
    """Name of the parent link; empty if missing, `world` for a root of MJCF."""

    child: str
    """Name of the child link; empty if missing."""

    origin: Matrix = field(default_factory=_identity)
    """The child's frame in the parent's at position `reference`, shape (4, 4) [m]."""

    axis: Matrix | None = None
    """Axis in the child's frame as written, shape (3,), not normalised; None if missing, which
    means (1, 0, 0) in URDF."""

    axis_source: Source | None = None
    """The element that holds the axis, if it is another than `source`."""

    anchor: Matrix = field(default_factory=lambda: np.zeros(3))
    """A point of the axis in the child's frame, shape (3,) [m]; zero in URDF."""

    reference: float = 0.0
    """Position at which `origin` holds [rad] or [m]; zero in URDF."""

    limit: Limit | None = None
    mimic: Mimic | None = None

    damping: float = 0.0
    """Viscous friction [N m s/rad] or [N s/m]."""

    friction: float = 0.0
    """Dry friction [N m] or [N], the same at every speed."""

    armature: float = 0.0
    """Reflected inertia of the rotor [kg m2] or [kg]; MJCF only."""

    dont_collapse: bool = False
    """Whether Isaac Gym is told to keep the child of this fixed joint as a body of its own."""

    safety_controller: Source | None = None
    """The element `safety_controller` with a k_position, if there is one."""

    @property
    def moves(self) -> bool:
        """Whether it is a joint with one degree of freedom."""
        return self.kind in MOVING

    @property
    def unit(self) -> str:
        """Return the unit of where it is."""
        return "m" if self.kind == "prismatic" else "rad"

    @property
    def effort_unit(self) -> str:
        """Return the unit of what drives it."""
        return "N" if self.kind == "prismatic" else "N m"

    @property
    def speed_unit(self) -> str:
        """Return the unit of how fast it moves."""
        return "m/s" if self.kind == "prismatic" else "rad/s"

    @property
    def range(self) -> tuple[float, float] | None:
        """Return lower and upper [rad] or [m]; None where they are not limits that make sense."""
        limit = self.limit
        if self.kind == "continuous" or limit is None or None in (limit.lower, limit.upper):
            return None
        assert limit.lower is not None
        assert limit.upper is not None
        return (limit.lower, limit.upper) if limit.lower < limit.upper else None

    @property
    def direction(self) -> Matrix:
        """Return the axis as a unit vector, shape (3,); (1, 0, 0) where there is none to be had."""
        axis = np.array([1.0, 0, 0]) if self.axis is None else self.axis
        length = float(np.linalg.norm(axis)) if np.isfinite(axis).all() else 0.0
        return axis / length if 1e-12 < length < np.inf else np.array([1.0, 0, 0])


@dataclass(frozen=True, kw_only=True)
class Actuator:
    """A motor of a MJCF file."""

    name: str
    source: Source
    joint: str
    """Name of the joint it drives; empty if it drives something else."""

    effort: float | None = None
    """Largest torque [N m] or force [N] on the joint; None if it is unlimited."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RobotModel:
    """A robot description."""

    name: str
    """Name of the robot; empty if it has none."""

    kind: Kind

    file: Path
    """The file that was read."""

    source: Source
    """The root element, or the file."""

    links: tuple[Link, ...] = ()
    """In the order of the file, duplicates included."""

    joints: tuple[Joint, ...] = ()
    """In the order of the file, duplicates included."""

    actuators: tuple[Actuator, ...] = ()
    """In the order of the file; MJCF only."""

    home: Mapping[str, float] = field(default_factory=dict)
    """Joint positions [rad] or [m] of the first keyframe, by joint; MJCF only."""

    imu: tuple[str, Matrix] | None = None
    """Where turning and acceleration are sensed: a link, and the pose in its frame, shape (4, 4)
    [m]; MJCF only."""

    floating: bool | None = None
    """Whether the base moves freely; None where that has to be found out."""

    excluded: frozenset[frozenset[str]] = frozenset()
    """Pairs of links whose contacts are switched off; MJCF only."""

    problems: tuple[Problem, ...] = ()
    """What could not be read."""

    sources: tuple[Path, ...] = ()
    """Every file that was read as text: the file itself and what it includes."""

    @property
    def title(self) -> str:
        """Return what to call the robot: its name, or that of its file."""
        return self.name or self.file.name

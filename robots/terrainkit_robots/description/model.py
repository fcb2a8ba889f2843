"""The robot model that URDF, xacro and MJCF files are read into.

Every element records the file and line it came from. Values are not corrected: a negative mass
stays negative. What could not be read is recorded as a `Problem`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from terrainkit_robots.description.fix import Fix
from terrainkit_robots.description.fix import Source as Source
from terrainkit_robots.transforms import Matrix

Kind = Literal["urdf", "xacro", "mjcf"]

MOVING = frozenset({"revolute", "continuous", "prismatic"})
"""Joint types with one degree of freedom, in URDF's terms. MJCF's hinge and slide are mapped to
these."""

WORLD = "world"
"""Name of the world: the parent of the root bodies of an MJCF, or a root link of a URDF."""

JOINT_TYPES = MOVING | {"fixed", "floating", "planar", "ball"}


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


@dataclass(frozen=True, kw_only=True)
class Problem:
    """Something that could not be read. The lint rule with the same code reports it."""

    code: str
    """Code of the lint rule."""

    message: str
    """What was found, and what was expected."""

    source: Source
    """Location in the file."""

    subject: str = ""
    """Name of the link, joint or file that the problem belongs to."""

    attribute: str = ""
    """Name of the attribute that is invalid or missing."""

    severity: Literal["error", "warning"] | None = None
    """By default, the severity of the rule."""

    fix: Fix | None = None
    """The edits that correct it, if it can be corrected automatically."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Inertial:
    """Mass and inertia of a link, as declared."""

    source: Source

    mass: float | None
    """Mass [kg]. None if missing or not a number; NaN if MuJoCo computes it from a mesh."""

    origin: Matrix = field(default_factory=lambda: np.eye(4))
    """Frame of the center of mass and of the inertia in the link frame, shape (4, 4) [m]."""

    inertia: Matrix | None = None
    """Inertia about the center of mass in the frame `origin`, shape (3, 3) [kg m2]. None if missing
    or not numeric; NaN if MuJoCo computes it from a mesh."""

    inertia_source: Source | None = None
    """Element that holds the six inertia values, if it is not `source`."""

    attribute: str = ""
    """MJCF attribute that holds the inertia: `diaginertia` or `fullinertia`."""

    axes_attribute: str = ""
    """MJCF attribute that sets the orientation of `origin`, such as `quat` or `euler`."""

    missing: tuple[str, ...] = ()
    """Names among ixx, iyy and izz that are missing; URDF only."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshFile:
    """Reference to a mesh file."""

    source: Source

    filename: str
    """File name, as written."""

    path: Path
    """Resolved path; the file may not exist."""

    attribute: str = "filename"
    """Attribute of `source` that holds the file name."""

    found_by: Literal["path", "package", "search", "nothing"] = "path"
    """How `path` was resolved: as a plain path, through a package that was given or has a
    package.xml, by a search of nearby folders, or not at all, in which case `path` is a guess."""

    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Scale along each axis."""

    scale_source: Source | None = None
    """Element that holds the scale, if it is not `source`."""

    implied_name: str = ""
    """Name of a mesh asset without a name, which follows from its file name."""


ShapeKind = Literal["box", "sphere", "cylinder", "capsule", "ellipsoid", "plane", "mesh", "unknown"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Geometry:
    """Visual or collision geometry of a link."""

    source: Source

    shape: ShapeKind

    name: str = ""
    """Name of the geometry, if it has one."""

    size: tuple[float, ...] = ()
    """MuJoCo's size parameters [m]. Box: three half lengths; sphere: radius; cylinder and capsule:
    radius and half length along z; ellipsoid: three radii; mesh and plane: none."""

    size_source: Source | None = None
    """Element that holds the size, if it is not `source`."""

    origin: Matrix = field(default_factory=lambda: np.eye(4))
    """Pose in the link frame, shape (4, 4) [m]."""

    mesh: MeshFile | None = None
    """Mesh file of a mesh geometry."""

    contype: int = 1
    """Contact type bits; MJCF only."""

    conaffinity: int = 1
    """Contact affinity bits. Two geometries collide if the contype of one and the conaffinity of
    the other share a bit; MJCF only."""

    fit_to_mesh: bool = False
    """Whether MuJoCo fits a primitive to `mesh`, so that the shape differs from the mesh; MJCF
    only."""

    color: tuple[float, float, float, float] | None = None
    """RGBA color in [0, 1]; None if the file sets no color."""

    friction: float | None = None
    """Coefficient of sliding friction; MJCF only."""

    priority: int = 0
    """Priority of `friction` and `condim`; the geometry of a contact with the higher priority
    decides. MJCF only."""

    condim: int = 3
    """Dimension of the contact space: 1 without friction; MJCF only."""

    settings: Mapping[str, str] = field(default_factory=dict)
    """Further attributes of its contacts, such as solref, as MuJoCo writes them; MJCF only."""

    @property
    def contacts(self) -> bool:
        """Whether the geometry can collide with anything."""
        return bool(self.contype or self.conaffinity)


@dataclass(frozen=True, kw_only=True, eq=False)
class Link:
    """Rigid body: a URDF link or an MJCF body."""

    name: str
    source: Source
    inertial: Inertial | None = None
    collisions: tuple[Geometry, ...] = ()
    visuals: tuple[Geometry, ...] = ()

    virtual: bool = False
    """Whether the link has no element of its own, because it lies between two joints of one MJCF
    body."""

    gravity_compensation: float = 0.0
    """Share of its weight that MuJoCo cancels; MJCF only."""


@dataclass(frozen=True, kw_only=True)
class Limit:
    """Limits of a joint, as declared; None where a limit is missing or not a number."""

    source: Source

    lower: float | None = None
    """Lower position limit [rad] or [m]."""

    upper: float | None = None
    """Upper position limit [rad] or [m]."""

    effort: float | None = None
    """Maximum torque [N m] or force [N]. In MJCF, the sum of the limits of the actuators on the
    joint, or the limit of the joint if that is lower."""

    velocity: float | None = None
    """Maximum speed [rad/s] or [m/s]; MJCF has none."""


@dataclass(frozen=True, kw_only=True)
class Mimic:
    """Coupling of a joint to another one: q = multiplier * q_of_target + offset."""

    source: Source
    joint: str
    """Name of the target joint."""

    multiplier: float = 1.0
    offset: float = 0.0

    settings: Mapping[str, str] = field(default_factory=dict)
    """Further attributes of the constraint, such as solref, as MuJoCo writes them; MJCF only."""


@dataclass(frozen=True, kw_only=True)
class Coupling:
    """Constraint that makes a joint or tendon a polynomial of another one; MJCF only."""

    kind: Literal["joint", "tendon"]

    follower: str
    """Name of the joint or tendon."""

    target: str
    """Name of the other joint or tendon; empty to hold the follower."""

    coefficients: tuple[float, ...]
    """Coefficients of the powers 0 to 4 of the position of the target."""

    settings: Mapping[str, str]
    """Further attributes of the constraint, such as solref, as MuJoCo writes them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Loop:
    """Constraint that closes a kinematic loop: two frames on two links coincide."""

    name: str
    """Unique name."""

    kind: Literal["connect", "weld"]
    """Whether only the origins of the frames coincide, or their orientations as well."""

    links: tuple[str, str]
    """Names of the links."""

    origins: tuple[Matrix, Matrix]
    """Pose of the frame in each link, shape (4, 4) [m]."""

    settings: Mapping[str, str] = field(default_factory=dict)
    """Further attributes of the constraint, such as solref, as MuJoCo writes them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Tendon:
    """Tendon that acts on joints, or passes through points of links; MJCF only."""

    name: str
    """Unique name."""

    joints: Mapping[str, float]
    """Coefficient of each joint; empty for a tendon through points."""

    points: tuple[tuple[str, Matrix] | float, ...]
    """Link and pose of each point in the link, shape (4, 4) [m], and divisors of pulleys."""

    settings: Mapping[str, str]
    """Further attributes, such as stiffness, as MuJoCo writes them."""


@dataclass(frozen=True, kw_only=True)
class Dynamics:
    """Losses of a joint, as declared; None where a number is missing or not a number."""

    source: Source

    damping: float | None = None
    """Viscous damping [N m s/rad] or [N s/m]."""

    friction: float | None = None
    """Coulomb friction [N m] or [N]."""


@dataclass(frozen=True, kw_only=True)
class SafetyController:
    """The `safety_controller` of a URDF joint; None where a number is missing or not a number."""

    source: Source

    k_position: float | None = None
    """Gain from the distance to a soft limit to the velocity limit [1/s]."""

    k_velocity: float | None = None
    """Gain from the velocity error to the effort limit [N m s/rad] or [N s/m]."""

    soft_lower_limit: float | None = None
    """Lower soft limit [rad] or [m]."""

    soft_upper_limit: float | None = None
    """Upper soft limit [rad] or [m]."""


@dataclass(frozen=True, kw_only=True)
class PositionGains:
    """Gains of the position controllers of a joint, as declared."""

    source: Source

    stiffness: float
    """Proportional gain [N m/rad] or [N/m]."""

    damping: float | None = None
    """Derivative gain [N m s/rad] or [N s/m]; None if the file declares none or a damping ratio."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Joint:
    """Connection of a link to its parent."""

    name: str
    source: Source

    kind: str
    """One of JOINT_TYPES, or the type as written. An MJCF hinge is revolute if it has a range and
    continuous otherwise; a slide is prismatic and a free joint floating."""

    parent: str
    """Name of the parent link; empty if missing, WORLD for a root body of an MJCF."""

    child: str
    """Name of the child link; empty if missing."""

    origin: Matrix = field(default_factory=lambda: np.eye(4))
    """Pose of the child frame in the parent frame at position `reference`, shape (4, 4) [m]."""

    axis: Matrix | None = None
    """Axis in the child frame as written, not normalized, shape (3,). None if missing, which means
    (1, 0, 0) in URDF."""

    axis_source: Source | None = None
    """Element that holds the axis, if it is not `source`."""

    anchor: Matrix = field(default_factory=lambda: np.zeros(3))
    """Point on the axis in the child frame, shape (3,) [m]; zero in URDF."""

    reference: float = 0.0
    """Joint position at which `origin` holds [rad] or [m]; zero in URDF."""

    limit: Limit | None = None
    mimic: Mimic | None = None

    coupled: bool = False
    """Whether other joints move it through a closed loop or a tendon."""

    dynamics: Dynamics | None = None
    """Damping and friction; None if the file declares neither."""

    armature: float = 0.0
    """Reflected rotor inertia [kg m2] or [kg]; MJCF only."""

    stiffness: float = 0.0
    """Stiffness of its spring [N m/rad] or [N/m]; MJCF only."""

    spring_reference: float = 0.0
    """Position at which the spring has no force [rad] or [m]; MJCF only."""

    settings: Mapping[str, str] = field(default_factory=dict)
    """Further attributes of its limits and friction, as MuJoCo writes them; MJCF only."""

    dont_collapse: bool = False
    """Whether the URDF tells Isaac Gym not to merge the child of this fixed joint."""

    safety_controller: SafetyController | None = None

    position_gains: PositionGains | None = None
    """Gains of its position actuators in MJCF, or of its ros2_control in URDF."""

    @property
    def damping(self) -> float:
        """Return the viscous damping [N m s/rad] or [N s/m]; 0 if it is missing."""
        return (self.dynamics and self.dynamics.damping) or 0.0

    @property
    def friction(self) -> float:
        """Return the Coulomb friction [N m] or [N]; 0 if it is missing."""
        return (self.dynamics and self.dynamics.friction) or 0.0

    @property
    def effort(self) -> float | None:
        """Return the effort limit [N m] or [N]; None if it is unlimited."""
        return self.limit.effort if self.limit else None

    @property
    def velocity(self) -> float | None:
        """Return the velocity limit [rad/s] or [m/s]; None if it is missing."""
        return self.limit.velocity if self.limit else None

    @property
    def moves(self) -> bool:
        """Whether the joint has one degree of freedom."""
        return self.kind in MOVING

    @property
    def units(self) -> JointUnits:
        """Return the units of its quantities."""
        return PRISMATIC if self.kind == "prismatic" else REVOLUTE

    @property
    def unit(self) -> str:
        """Return the unit of its position."""
        return self.units.position

    @property
    def range(self) -> tuple[float, float] | None:
        """Return the lower and upper limit [rad] or [m]; None if the joint has no valid limits."""
        limit = self.limit
        lower, upper = (limit.lower, limit.upper) if limit else (None, None)
        if self.kind == "continuous" or lower is None or upper is None:
            return None
        return (lower, upper) if lower < upper else None

    @property
    def direction(self) -> Matrix:
        """Return the axis as a unit vector, shape (3,); (1, 0, 0) if it is missing or zero."""
        axis = np.array([1.0, 0, 0]) if self.axis is None else self.axis
        length = float(np.linalg.norm(axis)) if np.isfinite(axis).all() else 0.0
        return axis / length if 1e-12 < length < np.inf else np.array([1.0, 0, 0])


@dataclass(frozen=True, kw_only=True)
class Actuator:
    """Actuator of an MJCF file."""

    name: str
    source: Source
    joint: str
    """Name of the actuated joint; empty if the actuator does not act on a joint."""

    effort: float | None = None
    """Maximum torque [N m] or force [N] on the joint; None if unlimited."""

    gear: float = 1.0
    """Force on the joint divided by the force of the actuator."""

    stiffness: float | None = None
    """Position gain on the joint [N m/rad] or [N/m]; None if it is not a position actuator."""

    damping: float = 0.0
    """Derivative gain on the joint [N m s/rad] or [N s/m]; 0 if it is a damping ratio."""

    armature: float = 0.0
    """Inertia that it adds to the armature of the joint [kg m2] or [kg]."""

    commands: tuple[float, float] | None = None
    """Range of the commanded force of a motor; None if it is unlimited or commands something
    else."""

    targets: tuple[float, float] | None = None
    """Range of the target position of the joint [rad] or [m]; None if it is unlimited or not a
    position actuator."""


@dataclass(frozen=True, kw_only=True)
class PhysicsOptions:
    """Settings of the simulation; MJCF only."""

    source: Source

    gravity: tuple[float, float, float]
    """Acceleration of gravity in the world frame [m/s2]."""

    timestep: float
    """Time step [s]."""

    disabled: frozenset[str] = frozenset()
    """Attributes of <flag> that are set to disable."""

    degrees: bool = False
    """Whether angles of the file are in degrees."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RobotModel:
    """Contents of a robot file."""

    name: str
    """Name of the robot; empty if it has none."""

    kind: Kind

    file: Path
    """Path of the robot file."""

    source: Source
    """Location of the root element, or of the file."""

    links: tuple[Link, ...] = ()
    """Links in document order, including duplicates."""

    joints: tuple[Joint, ...] = ()
    """Joints in document order, including duplicates."""

    actuators: tuple[Actuator, ...] = ()
    """Actuators in document order; in URDF, of the joints that a spec with loops names."""

    driven: frozenset[str] = frozenset()
    """Names of joints with a transmission or a command interface of ros2_control; URDF only."""

    options: PhysicsOptions | None = None
    """Settings of the simulation; None for URDF."""

    keyframe: Mapping[str, float] = field(default_factory=dict)
    """Joint positions [rad] or [m] of the first keyframe by joint name; MJCF only."""

    imu: tuple[str, Matrix] | None = None
    """Link of the IMU and its pose in the link frame, shape (4, 4) [m]; MJCF only."""

    floating: bool | None = None
    """Whether the base is free; None if the file does not say."""

    keeps_fixed_links: bool = False
    """Whether the file tells MuJoCo to keep links on fixed joints as bodies; URDF only."""

    excluded: frozenset[frozenset[str]] = frozenset()
    """Pairs of links whose contacts are disabled; MJCF only."""

    feet: tuple[str, ...] = ()
    """Links that the user names as the feet."""

    loops: tuple[Loop, ...] = ()
    """Constraints that close kinematic loops."""

    couplings: tuple[Coupling, ...] = ()
    """Constraints of joints that are not the mimic of a joint; MJCF only."""

    tendons: tuple[Tendon, ...] = ()
    """Tendons; MJCF only."""

    left_out: tuple[str, ...] = ()
    """Parts of the file that the model does not have, such as keyframes, one phrase each."""

    problems: tuple[Problem, ...] = ()
    """What could not be read."""

    sources: tuple[Path, ...] = ()
    """Text files that were read: the robot file and everything it includes."""

    @property
    def title(self) -> str:
        """Return the name of the robot, or the name of its file."""
        return self.name or self.file.name

"""Measure the quantities in which published robots resemble each other, by role of link and joint.

Lengths and masses are divided by those of the robot, so that robots of all sizes can be compared.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from terrainkit.settings.toml_text import parse_toml
from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.bounds import half_diagonal
from terrainkit_robots.analysis.bodies.shapes import bounds, has_bounds
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.inertia.density import has_derived_mass
from terrainkit_robots.analysis.inertia.inertial import mass_part
from terrainkit_robots.analysis.inertia.physical import MIN_INERTIA, gyration_radius
from terrainkit_robots.analysis.legs.stance import GRAVITY
from terrainkit_robots.description.fix import Part
from terrainkit_robots.description.model import Joint

_MIN_OFFSET, _MIN_FRICTION, _MAX_DAMPED_SPEED = 0.2, 0.01, 1000.0
"""Offset over half a diagonal, friction over effort, and effort over damping [rad/s] from which on
all values towards zero offset, friction and damping count as normal."""

_MIN_JOINTS = 3
"""Number of joints of a robot below which shares of its mass say nothing."""

_MIN_SIZE = 1e-3
"""Side of a box below which a density and a ratio of sizes say nothing [m]."""

_MIN_THICKNESS = 0.2
"""Side of a visible box over its longest side, at least: a thin plate has no thickness."""

_LEG_ROLES = ("hip", "thigh", "shank", "foot")
"""Roles of the links of legs, whose masses count for all legs together."""

QUANTITIES = {
    "mass": ("mass over cubed leg length", "kg/m3"),
    "mass share": ("share of the mass of the robot", ""),
    "density": ("mass over the box around the shapes", "kg/m3"),
    "center of mass": ("distance of the center of mass from the middle over half the diagonal", ""),
    "radius of gyration": ("radius of gyration over half the diagonal", ""),
    "collision offset": ("distance of the collision shapes from the visible ones over size", ""),
    "collision size": ("size of the collision shapes over that of the visible ones", ""),
    "range": ("range", "rad"),
    "velocity": ("velocity limit", "rad/s"),
    "effort": ("effort limit over weight times leg length", ""),
    "stiffness": ("stiffness over weight times leg length", "1/rad"),
    "damping": ("damping over weight times leg length", "s/rad"),
    "friction": ("friction over effort limit", ""),
    "damped speed": ("effort limit over damping", "rad/s"),
    "acceleration": ("effort limit over armature", "rad/s2"),
}
"""What each quantity is, and its unit."""

ROLES = ("robot", "trunk", "hip", "thigh", "shank", "foot", "other")
"""Roles of links, and of the joints that move them, from the trunk outward."""

NORMS = Path(__file__).with_suffix(".toml")
"""The norms, which docs/robot_norms.py writes."""

LEVELS = (0.0, 0.01, 0.02, 0.05, 0.25, 0.5, 0.75, 0.95, 0.98, 0.99, 1.0)
"""Shares of robots at which norms.toml gives values."""

_MARGIN = 2.0
"""How many times beyond the values of 90 % of the robots a value is unusual. Of 39 held-out robots
without errors, 14 have such values (benchmarks/results/robot_norms.md)."""


@dataclass(frozen=True, kw_only=True)
class Norm:
    """What is normal for a quantity of a role: the values of published robots."""

    robots: int
    """Number of robots."""

    values: tuple[float, ...]
    """Value at each of `LEVELS`: of the smallest value of each robot below the median, of the
    median value at it, and of the largest value above it."""

    @property
    def median(self) -> float:
        """Return the median robot's value."""
        return self.values[LEVELS.index(0.5)]

    @property
    def usual(self) -> tuple[float, float]:
        """Return the range of 90 % of the robots."""
        return self.values[LEVELS.index(0.05)], self.values[LEVELS.index(0.95)]

    @property
    def limits(self) -> tuple[float, float]:
        """Return the values beyond which a value is unusual."""
        low, high = self.usual
        return low / _MARGIN, high * _MARGIN

    def robots_below(self, value: float) -> int:
        """Return how many of the robots have a smaller value."""
        return round(self.robots * float(np.interp(value, self.values, LEVELS)))


@cache
def norms() -> Mapping[tuple[str, str], Norm]:
    """Return the norms by quantity and role."""
    tables = parse_toml(NORMS.read_text(encoding="utf-8"))
    return {
        (quantity, role): Norm(robots=int(row[0]), values=tuple(row[1:]))
        for quantity, roles in tables.items()
        for role, row in roles.items()
    }


@dataclass(frozen=True, kw_only=True)
class Sample:
    """A quantity of a link or joint."""

    quantity: str
    role: str
    """Role of the link or joint, such as thigh."""

    value: float
    element: Part


def measure(
    robot: Facts, gains: Mapping[str, tuple[float, float]] | None = None
) -> Iterator[Sample]:
    """Yield the quantities of a robot that are known and above zero.

    Args:
        robot: The robot.
        gains: Stiffness and damping by joint. By default, those of the file.
    """
    if gains is None:
        declared = {joint.name: joint.position_gains for joint in robot.joints}
        gains = {name: (g.stiffness, g.damping or 0.0) for name, g in declared.items() if g}
    roles = _roles(robot)
    length = max((leg.length for leg in robot.legs), default=0.0)
    if length > 0 and robot.total_mass > 0:
        trunk = mass_part(robot.bodies[0].main_link)
        value = robot.total_mass / length**3
        yield Sample(quantity="mass", role="robot", value=value, element=trunk)
    for body in robot.bodies:
        if not body.virtual:
            role, part = roles.get(body.index, "other"), mass_part(body.main_link)
            for quantity, value in _body_values(robot, body, role):
                if 0 < value < math.inf:
                    yield Sample(quantity=quantity, role=role, value=value, element=part)
    for joint in robot.actuated_hinges:
        role = roles.get(robot.body_of_joint[joint.name].index, "other")
        part = Part(joint.name, (joint.limit or joint).source)
        for quantity, value in _joint_values(robot, joint, gains).items():
            if 0 < value < math.inf:
                yield Sample(quantity=quantity, role=role, value=value, element=part)


def _roles(robot: Facts) -> Mapping[int, str]:
    """Return the roles of the trunk and of the bodies of legs with a knee."""
    roles = {0: "trunk"}
    for leg in robot.legs:
        if "knee" not in leg.roles:
            continue
        knee = leg.roles.index("knee")
        for k, (joint, role) in enumerate(zip(leg.joints, leg.roles, strict=True)):
            index = robot.body_of_joint[joint.name].index
            if k > knee and role != "wheel" and index == leg.limb.chain[-1]:
                roles[index] = "foot"
            elif k <= knee and role != "waist":
                roles[index] = "hip" if k < knee - 1 else "thigh" if k < knee else "shank"
    return roles


def _body_values(robot: Facts, body: Body, role: str) -> Iterator[tuple[str, float]]:
    has_mass = body.mass > MIN_INERTIA and not has_derived_mass(body)
    if has_mass and robot.total_mass > 0 and len(robot.joints) >= _MIN_JOINTS:
        count = len(robot.legs) if role in _LEG_ROLES else 1
        yield "mass share", count * body.mass / robot.total_mass
    shapes = (*body.collisions, *body.visuals)
    if not shapes or not all(has_bounds(shape.geometry, robot.meshes) for shape in shapes):
        return
    box = robot.body_bounds.box_if(body, lambda _: True)
    assert box is not None
    size, half = box[1] - box[0], half_diagonal(box)
    if has_mass and float(size.min()) > _MIN_SIZE:
        yield "density", body.mass / float(np.prod(size))
        offset = float(np.linalg.norm(body.center - box.mean(axis=0))) / half
        yield "center of mass", max(offset, _MIN_OFFSET)
        if body.principal[0] > MIN_INERTIA:
            radius = gyration_radius(body.principal, body.mass)
            yield "radius of gyration", radius / half
    collision = bounds(body.collisions, robot.meshes)
    visual = bounds(body.visuals, robot.meshes)
    if collision is not None and visual is not None:
        seen = visual[1] - visual[0]
        reference = np.maximum(seen, _MIN_THICKNESS * float(seen.max()))
        if float(reference.min()) > _MIN_SIZE:
            shift = np.linalg.norm(collision.mean(axis=0) - visual.mean(axis=0))
            yield "collision offset", max(float(shift) / half_diagonal(visual), _MIN_OFFSET)
            for ratio in (collision[1] - collision[0]) / reference:
                yield "collision size", float(ratio)


def _joint_values(
    robot: Facts, joint: Joint, gains: Mapping[str, tuple[float, float]]
) -> Mapping[str, float]:
    length = max((leg.length for leg in robot.legs), default=robot.body_bounds.robot_size)
    weight = max(robot.total_mass * GRAVITY * length, 0.0) or math.inf
    effort = joint.effort or 0.0
    stiffness, damping = gains.get(joint.name, (0.0, 0.0))
    return {
        "range": joint.range[1] - joint.range[0] if joint.range is not None else 0.0,
        "velocity": joint.velocity or 0.0,
        "effort": effort / weight,
        "stiffness": stiffness / weight,
        "damping": damping / weight,
        "friction": max(joint.friction / effort, _MIN_FRICTION)
        if min(effort, joint.friction) > 0
        else 0.0,
        "damped speed": min(effort / joint.damping, _MAX_DAMPED_SPEED)
        if joint.damping > 0
        else 0.0,
        "acceleration": effort / joint.armature if joint.armature > 0 else 0.0,
    }

"""Body masses: how the mass of two descriptions of a robot is spread over their bodies."""

from dataclasses import dataclass

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.xml.document import RobotFileError, parse_xml, read_bytes
from terrainkit_robots.lint.compare.pairing import Pairing, from_link
from terrainkit_robots.transforms import Matrix


@dataclass(frozen=True, kw_only=True)
class BodyGap:
    """What two bodies that belong together differ in."""

    ours: Body
    theirs: Body

    mass: float
    """Difference of the masses over the larger one."""

    center: float
    """Distance between the centres of mass [m]."""

    inertia: float
    """Largest difference of the inertias' elements over the largest element."""


def body_gap(one: Facts, other: Facts, pairing: Pairing, ours: Body, theirs: Body) -> BodyGap:
    """Return the difference of two bodies.

    Where the frames of the bodies are turned against each other, they are seen from the base; what
    is closer counts.
    """
    frames = [
        from_link(robot, base) @ robot.zero_poses[body.index]
        for robot, base, body in zip((one, other), pairing.base, (ours, theirs), strict=True)
    ]
    own = [np.eye(4), np.eye(4)]
    if ours.parent is None:  # whose frame may be that of another link
        own = frames
    centers, inertias = [], []
    with np.errstate(all="ignore"):
        for a, b in (own, frames):
            centers.append(np.linalg.norm(_center(ours, a) - _center(theirs, b)))
            left, right = _inertia(ours, a), _inertia(theirs, b)
            largest = max(np.abs(left).max(), np.abs(right).max())
            inertias.append(np.abs(left - right).max() / largest if largest > 0 else 0.0)
    return BodyGap(
        ours=ours,
        theirs=theirs,
        mass=share(ours.mass, theirs.mass),
        center=float(min(centers)),
        inertia=float(min(inertias)),
    )


def is_known(body: Body) -> bool:
    """Return whether the masses and inertias of a body are all written, and none hangs on a mesh.

    What is missing or negative is told by INR.
    """
    inertials = [link.inertial for link in body.links if link.inertial is not None]
    return bool(inertials) and all(
        each.mass is not None
        and each.mass >= 0
        and each.inertia is not None
        and bool(np.isfinite(each.inertia).all())
        for each in inertials
    )


def share(a: float, b: float) -> float:
    """Return how far apart two numbers are, over the larger of them; 0 for two zeros."""
    largest = max(abs(a), abs(b))
    return abs(a - b) / largest if largest != 0 else 0.0


def dropped_mass(robot: Facts) -> float:
    """Return the mass that MuJoCo drops when it loads a URDF as it stands [kg].

    That of the trunk, which it welds to the world, unless the file has a floating joint above it or
    tells MuJoCo to keep static bodies.
    """
    floats = any(joint.kind == "floating" for joint in robot.model.joints)
    if robot.model.kind != "urdf" or floats or not robot.bodies:
        return 0.0
    try:
        root = parse_xml(robot.model.file, read_bytes(robot.model.file)).root
    except RobotFileError:
        return 0.0
    compiler = None if root is None else root.find("mujoco/compiler")
    kept = compiler is not None and compiler.get("fusestatic") == "false"
    return 0.0 if kept else robot.bodies[0].mass


def _center(body: Body, frame: Matrix) -> Matrix:
    return frame[:3, :3] @ body.center + frame[:3, 3]


def _inertia(body: Body, frame: Matrix) -> Matrix:
    return frame[:3, :3] @ body.inertia @ frame[:3, :3].T

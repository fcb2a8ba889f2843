"""Compare the mass and inertia of the bodies of two descriptions of a robot."""

from dataclasses import dataclass

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.lint.compare.robot_pairs import RobotPairs, trunk_pose_in_link
from terrainkit_robots.transforms import Matrix


@dataclass(frozen=True, kw_only=True)
class BodyDifference:
    """The difference of two corresponding bodies."""

    mass: float
    """Difference of the masses, relative to the larger one."""

    center: float
    """Distance between the centers of mass [m]."""

    inertia: float
    """Maximum difference of the inertia elements, relative to the largest element."""


def body_difference(
    robot: Facts, other: Facts, pairs: RobotPairs, body: Body, other_body: Body
) -> BodyDifference:
    """Return the difference of two corresponding bodies.

    The bodies are compared in their own frames and in the frame of the base, because their own
    frames may be rotated relative to each other. The smaller difference is returned.
    """
    base_frames = [
        trunk_pose_in_link(facts, base) @ side.zero_pose
        for facts, base, side in zip((robot, other), pairs.base, (body, other_body), strict=True)
    ]
    own_frames = [np.eye(4), np.eye(4)]
    if body.parent is None:  # the frames of the trunks may belong to different links
        own_frames = base_frames
    centers, inertias = [], []
    with np.errstate(all="ignore"):
        for a, b in (own_frames, base_frames):
            centers.append(np.linalg.norm(_center(body, a) - _center(other_body, b)))
            inertias.append(relative_difference(_inertia(body, a), _inertia(other_body, b)))
    return BodyDifference(
        mass=relative_difference(body.mass, other_body.mass),
        center=float(min(centers)),
        inertia=min(inertias),
    )


def has_valid_inertial(body: Body) -> bool:
    """Return whether all masses and inertias of a body are explicit and finite, with mass >= 0.

    The INR rules report missing and negative ones.
    """
    inertials = [link.inertial for link in body.links if link.inertial is not None]
    return bool(inertials) and all(
        inertial.mass is not None
        and inertial.mass >= 0
        and inertial.inertia is not None
        and bool(np.isfinite(inertial.inertia).all())
        for inertial in inertials
    )


def relative_difference(a: float | Matrix, b: float | Matrix) -> float:
    """Return the difference of two numbers relative to the larger one, or 0 for two zeros.

    Of two arrays, this is the largest difference relative to the largest number.
    """
    largest = float(max(np.abs(a).max(), np.abs(b).max()))
    return float(np.abs(a - b).max()) / largest if largest != 0 else 0.0


def _center(body: Body, frame: Matrix) -> Matrix:
    return frame[:3, :3] @ body.center + frame[:3, 3]


def _inertia(body: Body, frame: Matrix) -> Matrix:
    return frame[:3, :3] @ body.inertia @ frame[:3, :3].T

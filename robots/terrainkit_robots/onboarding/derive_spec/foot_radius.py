"""Foot radius: how large the feet of a robot are, measured on their collision shapes."""

from collections.abc import Sequence

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import BodyShape
from terrainkit_robots.analysis.bodies.contact import contact_points
from terrainkit_robots.analysis.bodies.kinematics import body_poses
from terrainkit_robots.analysis.bodies.shapes import has_bounds, min_height, support
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.legs import Leg
from terrainkit_robots.transforms import Matrix

_LEVEL = 0.7
"""Cosine of the tilt up to which a cylinder rolls on its side."""


def foot_radius(robot: Facts) -> float | None:
    """Return the radius of a ball foot, or half the width of a sole, mean of the feet [m].

    None without feet, or without shapes on them.
    """
    if robot.stance is None:
        return None
    poses = body_poses(robot.bodies, robot.stance.positions)
    radii = [_radius(robot, leg, poses) for leg in robot.legs]
    known = [radius for radius in radii if radius > 0]
    return sum(known) / len(known) if known else None


def _radius(robot: Facts, leg: Leg, poses: Sequence[Matrix]) -> float:
    """Return the radius of one foot; 0 if it is not known."""
    body = robot.bodies[leg.limb.chain[-1]]
    pose = poses[body.index]
    shapes = [shape for shape in body.collisions if has_bounds(shape.geometry, robot.meshes)]
    if not shapes:
        return 0.0
    width = float(np.ptp(contact_points(body, pose, robot.meshes) @ leg.pitch))
    touching = min(shapes, key=lambda shape: min_height(shape, pose, robot.meshes))
    return max(width / 2, _roundness(robot, touching, pose, leg.pitch))


def _roundness(robot: Facts, placed: BodyShape, pose: Matrix, side: Matrix) -> float:
    """Return the radius on which a shape rolls to the side or ahead; 0 for one with a flat sole."""
    geometry, turn = placed.geometry, (pose @ placed.pose)[:3, :3]
    match geometry.shape:
        case "sphere" | "capsule":
            return geometry.size[0]
        case "cylinder" if abs(turn[2, 2]) < _LEVEL:
            return geometry.size[0]
        case "ellipsoid":
            return support(geometry, turn.T @ side, robot.meshes)
    return 0.0

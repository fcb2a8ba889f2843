"""Measure the radius of the feet on their collision shapes."""

from collections.abc import Sequence

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import BodyShape
from terrainkit_robots.analysis.bodies.contact import contact_points
from terrainkit_robots.analysis.bodies.kinematics import body_poses, joint_axis
from terrainkit_robots.analysis.bodies.shapes import has_bounds, min_height, support
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.legs import Leg
from terrainkit_robots.transforms import Matrix

_MAX_AXIS_Z = 0.7
"""A cylinder whose axis has a larger z component does not roll on its side."""


def foot_radius(robot: Facts) -> float | None:
    """Return the radius of wheels or spherical feet, or half the width of soles [m].

    It is the mean of all feet.

    Returns:
        The radius; None without feet, or if they have no collision shapes.
    """
    if robot.stance is None:
        return None
    poses = body_poses(robot.bodies, robot.stance.positions)
    radii = [_leg_radius(robot, leg, poses) for leg in robot.legs]
    known = [radius for radius in radii if radius > 0]
    return sum(known) / len(known) if known else None


def _leg_radius(robot: Facts, leg: Leg, poses: Sequence[Matrix]) -> float:
    """Return the radius of one foot, or 0 if it is unknown."""
    body = robot.bodies[leg.limb.chain[-1]]
    pose = poses[body.index]
    shapes = [shape for shape in body.collisions if has_bounds(shape.geometry, robot.meshes)]
    if not shapes:
        return 0.0
    contacts = contact_points(body, pose, robot.meshes)
    if leg.limb.has_wheel:  # the distance from its axle to the ground
        return float(joint_axis(body, pose)[0][2] - contacts[:, 2].min())
    width = float(np.ptp(contacts @ leg.pitch))
    touching = min(shapes, key=lambda shape: min_height(shape, pose, robot.meshes))
    # A round foot touches in a point, and a sole along its width; a wide roller does both.
    return max(width / 2, _shape_radius(robot, touching, pose, leg.pitch))


def _shape_radius(robot: Facts, shape: BodyShape, pose: Matrix, axis: Matrix) -> float:
    """Return the radius on which a shape rolls about an axis; 0 for a flat sole."""
    geometry = shape.geometry
    rotation = (pose @ shape.pose)[:3, :3]
    match geometry.shape:
        case "sphere" | "capsule":
            return geometry.size[0]
        case "cylinder" if abs(rotation[2, 2]) < _MAX_AXIS_Z:
            return geometry.size[0]
        case "ellipsoid":
            return support(geometry, rotation.T @ axis, robot.meshes)
    return 0.0

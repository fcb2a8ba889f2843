"""Decide whether the first keyframe of a file is a standing pose."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import center_of_mass
from terrainkit_robots.analysis.bodies.contact import contact_points
from terrainkit_robots.analysis.bodies.kinematics import body_poses
from terrainkit_robots.analysis.bodies.shapes import min_height
from terrainkit_robots.analysis.legs.legs import Leg
from terrainkit_robots.transforms import Matrix

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts

_MIN_CLEARANCE = 0.01
"""Clearance of the trunk, hips and thighs above the ground, at least, over the leg length."""

_MAX_LIFT = 0.1
"""Height of a foot above the ground, at most, over the leg length. Legs are bent unequally if the
trunk of the keyframe is not level."""

_MAX_COM_OFFSET = 0.03
"""Distance of the center of mass from the bounding rectangle of the feet, at most, over the leg
length."""


def has_leg_positions(robot: "Facts") -> bool:
    """Return whether the keyframe has the positions of all joints of the legs."""
    keyframe = robot.model.keyframe
    return bool(keyframe) and all(j.name in keyframe for leg in robot.legs for j in leg.joints)


def is_standing_keyframe(robot: "Facts") -> bool:
    """Return whether the robot stands on its feet in the keyframe."""
    return has_leg_positions(robot) and not keyframe_defect(robot)


def keyframe_defect(robot: "Facts") -> str:
    """Return why the feet do not carry the robot in the keyframe; empty if they do."""
    if not has_leg_positions(robot) or not robot.legs:
        return ""
    positions = {joint.name: robot.model.keyframe.get(joint.name, 0.0) for joint in robot.joints}
    poses = body_poses(robot.bodies, positions)
    lowest = {
        body.index: min(min_height(shape, pose, robot.meshes) for shape in body.collisions)
        for body, pose in zip(robot.bodies, poses, strict=True)
        if body.collisions
    }
    feet = {
        leg.foot: lowest[leg.limb.chain[-1]] for leg in robot.legs if leg.limb.chain[-1] in lowest
    }
    if not feet:
        return ""
    length = max(leg.length for leg in robot.legs)
    ground = min(feet.values())
    lower_legs = {index for leg in robot.legs for index in _lower_leg(leg, robot)}
    others = {index: height for index, height in lowest.items() if index not in lower_legs}
    body = min(others, key=others.__getitem__, default=None)
    if body is not None and others[body] < ground + _MIN_CLEARANCE * length:
        return f"{robot.bodies[body].name} lies on the ground"
    foot = max(feet, key=feet.__getitem__)
    if feet[foot] > ground + _MAX_LIFT * length:
        return f"{foot} is {feet[foot] - ground:.2g} m above the ground"
    offset = _com_offset(robot, poses)
    if offset > _MAX_COM_OFFSET * length:
        return f"the center of mass is {offset:.2g} m outside of the feet"
    return ""


def _com_offset(robot: "Facts", poses: Sequence[Matrix]) -> float:
    """Return how far the center of mass is outside of the rectangle around the feet [m]."""
    feet = [leg.limb.chain[-1] for leg in robot.legs]
    points = np.concatenate([contact_points(robot.bodies[i], poses[i], robot.meshes) for i in feet])
    com = center_of_mass(robot.bodies, poses)
    outside = np.maximum(points.min(axis=0) - com, com - points.max(axis=0))[:2]
    return float(outside.max(initial=0.0)) if np.isfinite(com).all() else 0.0


def _lower_leg(leg: Leg, robot: "Facts") -> Iterator[int]:
    """Yield the last body of a leg, and all bodies that its knee moves."""
    knee = leg.joint("knee")
    is_below = False
    for index in leg.limb.chain:
        is_below |= knee is not None and robot.bodies[index].joint is knee
        if is_below or index == leg.limb.chain[-1]:
            yield index

"""Mirror map: the joint on the other side of each joint, and the sign between the two."""

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.kinematics import axis_in_trunk
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.spec.robot_spec import MirrorJoint

_NEAR = 0.02
"""A body this share of the robot's size away from the mirror plane lies in it, as in
symmetry/mirror.py."""

_ALONG = 0.7
"""Cosine from which two axes are the same one."""


def mirror_map(robot: Facts) -> dict[str, MirrorJoint]:
    """Return the twin of each actuated joint that has one.

    A joint in the mirror plane is its own: a waist that yaws does so the other way, one that
    pitches the same way.
    """
    driven = {joint.name for joint in robot.actuated}
    points = np.array([pose[:3, 3] for pose in robot.at_zero]).reshape(-1, 3)
    near = max(_NEAR * float(np.linalg.norm(np.ptp(points, axis=0))), 1e-3) if len(points) else 0.0
    found: dict[str, MirrorJoint] = {}
    for body in robot.bodies:
        joint = body.joint
        if joint is None or joint.name not in driven:
            continue
        twin = robot.mirror.twin(body.index)
        if twin is None:
            sign = _own_sign(robot, body, near)
            if sign:
                found[joint.name] = MirrorJoint(joint=joint.name, sign=sign)
            continue
        other, sign = robot.bodies[twin[0]].joint, twin[1]
        if sign and other is not None and other.name in driven:
            found[joint.name] = MirrorJoint(joint=other.name, sign=sign)
    return {joint.name: found[joint.name] for joint in robot.actuated if joint.name in found}


def _own_sign(robot: Facts, body: Body, near: float) -> int:
    """Return how a joint in the mirror plane mirrors itself; 0 for one that is elsewhere.

    A reflection turns a rotation by q about a into one by -q about the reflected a.
    """
    assert body.joint is not None
    pose, mirror = robot.at_zero[body.index], robot.mirror
    anchor, axis = axis_in_trunk(body, pose)
    center = pose[:3, :3] @ body.center + pose[:3, 3]
    aside = [abs(float(p @ mirror.normal) - mirror.offset) for p in (anchor, pose[:3, 3], center)]
    if min(aside) > near:
        return 0
    image = mirror.image(axis) if body.joint.kind == "prismatic" else -mirror.image(axis)
    agreement = float(image @ axis)
    return 0 if abs(agreement) < _ALONG else 1 if agreement > 0 else -1

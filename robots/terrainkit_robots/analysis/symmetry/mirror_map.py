"""Compute the mirrored joint of each joint, and the sign between the two."""

from typing import TYPE_CHECKING

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.kinematics import joint_axis
from terrainkit_robots.analysis.symmetry.mirror import MAX_MIRROR_ERROR, Mirror, Sign
from terrainkit_robots.spec.robot_spec import MirrorJoint

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts


def mirror_map(robot: "Facts") -> dict[str, MirrorJoint]:
    """Return the mirrored joint of each actuated joint that has one, by name.

    A joint in the mirror plane mirrors itself: with sign -1 if it yaws, with +1 if it pitches.
    """
    names = {joint.name for joint in robot.actuated}
    tolerance = max(MAX_MIRROR_ERROR * robot.body_bounds.robot_size, 1e-3)
    found: dict[str, MirrorJoint] = {}
    for body in robot.bodies:
        joint = body.joint
        if joint is None or joint.name not in names:
            continue
        image = robot.mirror.image_body(body.index)
        if image is None:
            sign = _self_sign(robot.mirror, body, tolerance)
            if sign:
                found[joint.name] = MirrorJoint(joint=joint.name, sign=sign)
            continue
        other, sign = robot.bodies[image[0]].joint, image[1]
        if sign and other is not None and other.name in names:
            found[joint.name] = MirrorJoint(joint=other.name, sign=sign)
    return {joint.name: found[joint.name] for joint in robot.actuated if joint.name in found}


def _self_sign(mirror: Mirror, body: Body, tolerance: float) -> Sign:
    """Return how a joint in the mirror plane mirrors itself, 0 for a joint outside of the plane."""
    assert body.joint is not None
    pose = body.zero_pose
    anchor, axis = joint_axis(body, pose)
    points = (anchor, pose[:3, 3], body.zero_center)
    if min(abs(float(point @ mirror.normal) - mirror.offset) for point in points) > tolerance:
        return 0
    return mirror.joint_sign(body.joint, axis, axis)

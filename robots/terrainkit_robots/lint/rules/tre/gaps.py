"""Rule on links that do not touch the link above them."""

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.gaps import (
    box_at_zero,
    box_distance,
    shapes_of,
)
from terrainkit_robots.analysis.bodies.kinematics import joint_axis
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.legs import mean_length
from terrainkit_robots.lint.rule import Violation, Violations, findings_of, rule
from terrainkit_robots.text import contrast
from terrainkit_robots.transforms import Matrix

_MAX_GAP = 0.15
"""Distance between the bounding boxes of two linked bodies, or of an axis from both of them, over
the leg length. 2,260 joints of 116 published files have at most 0.027."""


@rule("TRE013", "detached-link", "warning", needs=("legs",), certainty="likely")
def detached_link(robot: Facts) -> Violations:
    """A link of a leg hangs in the air: it does not meet the link that its joint connects it to.

    There is a gap between the shapes of both links, or the axis of the joint is far from both.
    The numbers of the joint's <origin> are wrong, such as a length that was added twice or has
    another unit. The robot then has longer or wider legs than the real one.

    Fix:
        Correct the <origin> of the joint.

    Source:
        Bounding boxes of all visual and collision shapes at position 0, which are larger than the
        shapes, and contain the origin and the center of mass of the body. Prismatic joints and
        bodies with unreadable meshes are not checked.
    """
    # Meshes whose up axis some importers ignore are turned, and miss the center of mass.
    if finding := next(findings_of(robot, "MSH011", "INR008"), None):
        raise CannotCheckError(f"the shapes or the mass of {finding.subject} are probably wrong")
    reported = {finding.subject for finding in findings_of(robot, "SYM006")}
    limit = _MAX_GAP * mean_length(robot.legs)
    for body in (robot.bodies[index] for index in sorted(robot.leg_bodies)):
        joint, parent = body.joint, robot.physical_parent(body)
        if joint is None or joint.kind == "prismatic" or joint.name in reported:
            continue
        if parent is None or not (shapes_of(parent) and shapes_of(body)):
            continue
        # Visual meshes are opened only if the result depends on them.
        if max(_gaps(body, _collision_box(robot, parent), _collision_box(robot, body))) <= limit:
            continue
        boxes = [box_at_zero(side, shapes_of(side), robot.meshes) for side in (parent, body)]
        parent_box, box = boxes
        if parent_box is None or box is None:
            continue
        # A calf may have only the sphere of its foot. Then it begins at its joint.
        gap, distance = _gaps(body, _with_frame(parent, parent_box), _with_frame(body, box))
        if parent.visuals and body.visuals:
            distance = _gaps(body, parent_box, box)[1]
        if max(gap, distance) <= limit:
            continue
        what = "distance of the axis from" if distance > limit else "gap between"
        got, expected = contrast(
            1000 * (distance if distance > limit else gap), 1000 * limit, ".3g"
        )
        yield Violation(
            element=joint,
            message=f"{what} the shapes of {parent.name} and {body.name} at joint {joint.name}: "
            f"got {got} mm; expected at most {expected} mm, {_MAX_GAP:.0%} of the leg length",
            measured={"gap": gap, "distance": distance, "limit": limit, "parent": parent.name},
        )


def _collision_box(robot: Facts, body: Body) -> Matrix:
    """Return the bounding box of the collision shapes, or the origin without any."""
    box = box_at_zero(body, body.collisions, robot.meshes)
    return body.zero_pose[None, :3, 3] if box is None else box


def _with_frame(body: Body, box: Matrix) -> Matrix:
    """Return a box that also contains the origin and the center of mass of a body."""
    points = np.vstack([box, body.zero_pose[:3, 3], body.zero_center])
    return np.array([points.min(axis=0), points.max(axis=0)])


def _gaps(body: Body, *boxes: Matrix) -> tuple[float, float]:
    """Return the gap between two boxes, and the distance of the axis from the closer one [m].

    The origin of a hinge may be anywhere along its axis.
    """
    point, axis = joint_axis(body, body.zero_pose)
    distances = []
    for box in boxes:
        size = float(np.linalg.norm(box[-1] - box[0]))
        along = (box.mean(axis=0) - point) @ axis + np.linspace(-size, size, 41)
        points = point + along[:, None] * axis
        outside = np.maximum(0, np.maximum(box[0] - points, points - box[-1]))
        distances.append(float(np.linalg.norm(outside, axis=1).min()))
    return box_distance(*boxes), min(distances)

"""Rules on the symmetry of joint origins and axes."""

import math

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.gaps import box_at_zero, box_distance, shapes_of
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.symmetry.asymmetry import (
    MAX_AXIS_ERROR,
    MAX_POSITION_ERROR,
    MAX_RELATIVE_POSITION_ERROR,
    Misalignment,
    find_flipped_joints,
    find_flipped_pairs,
    limits_match,
)
from terrainkit_robots.analysis.symmetry.mirror_pairs import MirrorSide, outlier_first
from terrainkit_robots.lint.rule import Measured, Part, Violation, Violations, findings_of, rule
from terrainkit_robots.lint.rules.sym.other_rules import check_joint_types
from terrainkit_robots.text import numbers
from terrainkit_robots.transforms import Matrix


@rule("SYM006", "joint-origin-asymmetry", "warning")
def joint_origin_asymmetry(robot: Facts) -> Violations:
    """The origin of a joint is not the mirror image of its counterpart's origin.

    One leg is longer, mounted further out, or bent at zero. The robot leans or stands on three
    legs, and a gait learned for one side is wrong for the other.

    Fix:
        Mirror the origin of the joint: negate the lateral coordinate and two of the angles.

    Source:
        The joint origins of tested robots without defects agree to 0.1 mm.
    """
    check_joint_types(robot)
    errors, _ = robot.misalignments
    for error in errors:
        if not error.is_axis:
            yield _report_pair(robot, error)


@rule("SYM007", "joint-axis-asymmetry", "warning")
def joint_axis_asymmetry(robot: Facts) -> Violations:
    """The axis of a joint is not the mirror image of its counterpart's axis.

    With a tilted axis the leg moves sideways. With an inverted axis the joint moves in the opposite
    direction; this shows in its limits, which still match the other legs or the mirror image.

    Fix:
        Give the axis the numbers of the mirror image, if the frames of both joints are parallel.

    Source:
        Tested robots have either the same axis on all legs, or mirrored axes on all legs.
    """
    check_joint_types(robot)
    errors, _ = robot.misalignments
    for error in errors:
        if error.is_axis:
            yield _report_pair(robot, error)
    reported = {finding.subject for finding in findings_of(robot, "JNT004")}
    for found in find_flipped_joints(robot.legs, robot.bodies):
        joint = found.joint
        if joint.name in reported:
            continue
        reported.add(joint.name)
        yield Violation(
            element=Part(joint.name, joint.axis_source or joint.source),
            message=f"axis of joint {joint.name} in the trunk frame: got "
            f"{_format_axis(found.axis)}; expected the direction of the same joint of all "
            f"{found.others} other legs, such as {_format_axis(found.expected_axis)}, or mirrored "
            "axes on each side",
            measured={"others": found.others},
        )
    yield from _opposite_axes(robot, reported)


def _opposite_axes(robot: Facts, reported: set[str]) -> Violations:
    """Yield joints whose axis is opposite to the mirror image's axis, but should not be."""
    for pair in robot.uncopied_pairs:
        left, right = pair.left, pair.right
        a, b = left.joint.range, right.joint.range
        if pair.sign == 0 or a is None or b is None:
            continue
        negated = not limits_match(a, b, pair.sign) and limits_match(a, b, -pair.sign)
        known = not reported.isdisjoint({left.joint.name, right.joint.name})
        if negated and pair.has_flipped_axes and not known:
            reported.add(right.joint.name)
            yield _report_axis(
                left,
                right,
                f"got {_format_axis(right.axis)} with limits {numbers(b, '.5g', ' to ')} "
                f"{right.joint.unit}, opposite to {_format_axis(left.axis)} with limits "
                f"{numbers(a, '.5g', ' to ')} {left.joint.unit} of its mirror image "
                f"{left.joint.name}; expected the negated axis or the negated limits",
                {"lower": b[0], "upper": b[1], "other_lower": a[0], "other_upper": a[1]},
            )
    for pair, others in find_flipped_pairs(
        robot.legs, robot.mirror, robot.uncopied_pairs, robot.leg_bodies
    ):
        left, right = pair.left, pair.right
        if right.joint.name not in reported:
            yield _report_axis(
                left,
                right,
                f"got {_format_axis(right.axis)}, opposite to {_format_axis(left.axis)} of its "
                f"mirror image {left.joint.name}; expected the same direction, as in the {others} "
                "other pairs with such an axis",
                {"others": others},
            )


def _report_axis(
    left: MirrorSide, right: MirrorSide, message: str, measured: Measured
) -> Violation:
    joint = right.joint
    return Violation(
        element=Part(joint.name, joint.axis_source or joint.source),
        message=f"axis of joint {joint.name} in the trunk frame: {message}",
        measured={**measured, "mirror_image": left.joint.name},
    )


def _format_axis(axis: Matrix) -> str:
    return f"({numbers(np.round(axis, 3), '.3g', ', ')})"


def _report_pair(robot: Facts, error: Misalignment) -> Violation:
    def position(body: Body) -> Matrix:
        anchor = np.zeros(3) if body.joint is None else body.joint.anchor
        return np.asarray(body.origin[:3, :3] @ anchor + body.origin[:3, 3])

    def axis(body: Body) -> Matrix | None:
        return body.joint.direction if body.joint else None

    def rotation(body: Body) -> Matrix:
        return body.origin[:3, :3]

    value = axis if error.is_axis else position if error.distance else rotation

    def gap(body: Body) -> float | None:
        parent = robot.physical_parent(body) if error.distance else None
        if parent is None:
            return None
        a, b = (box_at_zero(side, shapes_of(side), robot.meshes) for side in (parent, body))
        return None if a is None or b is None else box_distance(a, b)

    odd, other, reason = outlier_first(robot, error.pair, value, gap)
    name, mirror = odd.joint.name, other.joint.name
    if error.distance:
        offsets = [numbers(1000 * side.offset, ".1f", ", ") for side in (odd, other)]
        message = (
            f"position of joint {name} relative to the joint above it, in the trunk frame: got "
            f"({offsets[0]}) mm, and ({offsets[1]}) mm for its mirror image {mirror}: "
            f"{1000 * error.distance:.3g} mm from mirrored; expected at most "
            f"{1000 * MAX_POSITION_ERROR:g} mm plus {MAX_RELATIVE_POSITION_ERROR:.0%} of the "
            "distance"
        )
    else:
        part = "axis" if error.is_axis else "frame"
        message = (
            f"angle between the {part} of joint {name} and its mirror image {mirror}: got "
            f"{math.degrees(error.angle):.3g} deg; expected at most "
            f"{math.degrees(MAX_AXIS_ERROR):.0f} deg"
        )
    source = (odd.joint.axis_source if error.is_axis else None) or odd.joint.source
    return Violation(
        element=Part(name, source),
        message=f"{message}; {reason}",
        measured={"gap": error.distance, "angle": error.angle, "mirror_image": mirror},
    )

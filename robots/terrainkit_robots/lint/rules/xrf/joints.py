"""Rules that compare which joints exist, and their types, axes and mimics."""

import math

import numpy as np

from terrainkit.settings.text import truncate
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import Joint, Mimic, Source
from terrainkit_robots.lint.compare.body_mass import relative_difference
from terrainkit_robots.lint.compare.robot_pairs import trunk_pose_in_link
from terrainkit_robots.lint.rule import Part, Severity, Violation, Violations, rule
from terrainkit_robots.lint.rules.xrf.other_robot import (
    JointPair,
    joint_name,
    joint_pairs,
    other_name,
    other_robot,
    robot_pairs,
)
from terrainkit_robots.text import count, names, numbers
from terrainkit_robots.transforms import Matrix

_MAX_AXIS_ANGLE = 0.01
"""Allowed angle between axes [rad]: axes with two digits, such as 0.71 0.71 0."""

_MAX_HINGE_ERROR, _MAX_SLIDE_ERROR = 0.002, 0.0005
"""Allowed difference of limits [rad], [m]: 1.57 instead of 1.5708, or degrees with one decimal."""

MAX_RELATIVE_DIFFERENCE = 0.01
"""Allowed relative difference of efforts, velocities and mimic multipliers, for rounding."""


@rule("XRF001", "joint-set-differs", "error", needs=("against",))
def compare_joint_sets(robot: Facts) -> Violations:
    """One file has a joint that the other one lacks.

    A policy has one action for each joint. A policy trained on one file has the wrong number of
    actions for the other file, or drives the wrong joints.

    Fix:
        Give both files the same joints. A joint that is fixed in one file, such as an arm joint
        during walking, must be fixed in the other as well. Rename joints with different names.

    Source:
        Joints with one degree of freedom are matched by name; case and a suffix such as _joint are
        ignored.
    """
    pairs, other, there = robot_pairs(robot), other_robot(robot), other_name(robot)
    joint_names = pairs.joint_names
    ours = [joint for joint in robot.joints if joint.name in joint_names.only_first]
    theirs = [joint for joint in other.joints if joint.name in joint_names.only_second]
    counts = {"here": len(robot.joints), "there": len(other.joints)}
    for joints, side, fixed, missing in (
        (ours, other, f"that move here but are fixed in {there}", f"missing in {there}"),
        (theirs, robot, f"that move in {there} but are fixed here", f"of {there} missing here"),
    ):
        for is_fixed, text in ((True, fixed), (False, missing)):
            group = [j for j in joints if (_fixed_source(side, j) is not None) == is_fixed]
            if group:
                source = group[0].source
                if side is robot:
                    source = _fixed_source(robot, group[0]) or robot.model.source
                yield Violation(
                    element=Part(group[0].name, source),
                    message=f"joints {text}: got {len(group)} "
                    f"({names(joint.name for joint in group)}); expected 0; moving joints: "
                    f"{counts['here']} here, {counts['there']} in {there}",
                    measured={"joints": len(group), **counts},
                )
    renamed = joint_names.renamed
    if renamed:
        yield Violation(
            element=next(joint for joint in robot.joints if joint.name == renamed[0][0]),
            severity="note",
            certainty="likely",
            message=f"{count(len(renamed), 'joint')} of {there} matched by a similar name: "
            f"{names([f'{a} is {b}' for a, b in renamed])}",
            measured={"joints": len(renamed)},
        )


def _fixed_source(robot: Facts, joint: Joint) -> Source | None:
    """Return the source of the fixed joint above the child of a joint of the other robot."""
    above = robot.tree.parent_joint.get(joint.child)
    return above.source if above is not None and above.kind == "fixed" else None


@rule("XRF002", "joint-differs", "error", needs=("against",))
def compare_joints(robot: Facts) -> Violations:
    """The type, axis or mimic of a joint differs between the files.

    The same action then causes a different motion.

    Fix:
        Give the joint the same type, axis and mimic in both files. If an axis is inverted, negate
        its limits and its default position as well.

    Source:
        Both formats give the axis in the frame of the child link. If these frames are rotated
        against each other, the axes are compared in the frame of the base.
    """
    there = other_name(robot)
    for one, other in joint_pairs(robot):
        label, difference, severity = joint_difference(robot, one, other)
        if label:
            yield Violation(
                element=one,
                severity=severity,
                message=f"{label} of joint {joint_name(one, other)}: got {difference} "
                f"({there}, line {other.source.line})",
            )


def joint_difference(robot: Facts, one: Joint, other: Joint) -> tuple[str, str, Severity | None]:
    """Return what differs between two joints, how, and the severity; empty texts if nothing."""
    if one.kind != other.kind and "prismatic" in (one.kind, other.kind):
        return "type", f"{one.kind} here and {other.kind} there; expected the same", "error"
    angle = _axis_angle(robot, one, other)
    if angle > _MAX_AXIS_ANGLE:
        axes = (
            f"({numbers(one.direction, '.3g')}) here and ({numbers(other.direction, '.3g')}) there"
        )
        opposite = ", the opposite direction" if angle > math.pi - _MAX_AXIS_ANGLE else ""
        limit = f"{math.degrees(_MAX_AXIS_ANGLE):.1g} deg"
        angle_text = f"{math.degrees(angle):.3g} deg apart{opposite}; expected at most {limit}"
        return "axis", f"{axes}, {angle_text}", "error"
    return _mimic_difference(robot, one, other)


def _mimic_difference(robot: Facts, one: Joint, other: Joint) -> tuple[str, str, Severity | None]:
    ours, theirs = one.mimic, other.mimic
    if ours is None and theirs is None:
        return "", "", None
    if ours is None or theirs is None:
        texts = [f"a mimic of {truncate(m.joint)}" if m else "none" for m in (ours, theirs)]
        return "mimic", f"{texts[0]} here and {texts[1]} there; expected the same", "warning"
    partner = dict(robot_pairs(robot).joint_names.pairs)
    same = partner.get(ours.joint, ours.joint) == theirs.joint
    close = relative_difference(ours.multiplier, theirs.multiplier) <= MAX_RELATIVE_DIFFERENCE
    if same and close and abs(ours.offset - theirs.offset) <= limit_tolerance(one):
        return "", "", None
    text = f"{_format_mimic(ours)} here and {_format_mimic(theirs)} there; expected the same"
    return "mimic", text, "error"


def _format_mimic(mimic: Mimic) -> str:
    return f"{mimic.multiplier:.4g} x {truncate(mimic.joint)} + {mimic.offset:.4g}"


def _axis_angle(robot: Facts, one: Joint, other: Joint) -> float:
    """Return the smaller angle between two axes, in their own frames or in the base frame [rad]."""
    own = _angle(one.direction, other.direction)
    if own <= _MAX_AXIS_ANGLE:
        return own
    base = robot_pairs(robot).base
    ours = _axis_in_link(base[0], robot, one)
    return min(own, _angle(ours, _axis_in_link(base[1], other_robot(robot), other)))


def _axis_in_link(link: str, robot: Facts, joint: Joint) -> Matrix:
    """Return the axis of a joint in the frame of a link, all joints at 0."""
    pose = trunk_pose_in_link(robot, link) @ robot.body_of[joint.child].zero_pose
    return pose[:3, :3] @ joint.direction


def _angle(a: Matrix, b: Matrix) -> float:
    return math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b))


def limit_tolerance(joint: Joint) -> float:
    """Return the allowed difference of a position [rad] or [m]."""
    return _MAX_SLIDE_ERROR if joint.kind == "prismatic" else _MAX_HINGE_ERROR


def matching_joints(robot: Facts) -> list[JointPair]:
    """Return the pairs of joints with the same motion, whose numbers can be compared."""
    return [(a, b) for a, b in joint_pairs(robot) if joint_difference(robot, a, b)[2] != "error"]

"""Rules that compare the robot with another description of it (XRF)."""

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from terrainkit.settings.text import truncate
from terrainkit_robots.analysis.bodies.joint_order import is_reordered, permutation
from terrainkit_robots.analysis.cached_fact import cached_fact
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import Joint, Mimic, Source
from terrainkit_robots.lint.compare.body_mass import (
    body_difference,
    dropped_mass,
    has_valid_inertial,
    relative_difference,
)
from terrainkit_robots.lint.rule import Severity, Violation, rule
from terrainkit_robots.text import count, names
from terrainkit_robots.transforms import Matrix

if TYPE_CHECKING:
    from terrainkit_robots.lint.compare.link_poses import LinkPoseDifference
    from terrainkit_robots.lint.compare.robot_pairs import RobotPairs

_MAX_AXIS_ANGLE = 0.01
"""Allowed angle between axes [rad]: axes with two digits, such as 0.71 0.71 0."""

_MAX_HINGE_ERROR, _MAX_SLIDE_ERROR = 0.002, 0.0005
"""Allowed difference of limits [rad], [m]: 1.57 instead of 1.5708, or degrees with one decimal."""

_MAX_EFFORT_DIFFERENCE = 0.01
"""Allowed relative difference of efforts, velocities and mimic multipliers, for rounding."""

_MAX_MASS_DIFFERENCE, _MAX_MASS_ERROR = 0.01, 0.05
"""Relative difference of masses: limits of the warning (cables and screws) and the error (a payload
or a missing part)."""

_MAX_COM_DISTANCE = 0.002
"""Allowed distance of centers of mass [m]; rounding causes less than 0.1 mm."""

_MAX_INERTIA_DIFFERENCE = 0.05
"""Allowed difference of inertias, as a share of the largest element."""

_MIN_MASS = 1e-3
"""Bodies lighter than this are placeholders whose inertia has no meaning [kg]."""

_MAX_LISTED_BODIES = 3
"""Number of bodies listed as the main causes of a mass difference."""

_JointPair = tuple[Joint, Joint]


@cached_fact
def _pair_robots(robot: Facts) -> "RobotPairs | None":
    from terrainkit_robots.lint.compare.robot_pairs import pair_robots

    return pair_robots(robot, _other(robot))


def _robot_pairs(robot: Facts) -> "RobotPairs":
    pairs = _pair_robots(robot)
    if pairs is None:
        empty = robot if not robot.links else _other(robot)
        raise CannotCheckError(f"{truncate(empty.model.file.name)} has no links")
    return pairs


def _joint_pairs(robot: Facts) -> tuple[_JointPair, ...]:
    """Return the pairs of joints.

    Raises:
        CannotCheckError: If there is none.
    """
    pairs = _robot_pairs(robot)
    if not robot.joints or not _other(robot).joints:
        raise CannotCheckError("one of the two has no joints with one degree of freedom")
    if not pairs.joints:
        raise CannotCheckError(f"no joint of {_other_name(robot)} has the name of a joint here")
    return pairs.joints


def _other(robot: Facts) -> Facts:
    assert robot.against is not None
    return robot.against


def _other_name(robot: Facts) -> str:
    """Return the name of the other file, with its folder if both files have the same name."""
    other = _other(robot).model.file
    same = other.name == robot.model.file.name
    return truncate(str(Path(*other.parts[-2:])) if same else other.name)


def _joint_name(one: Joint, other: Joint) -> str:
    return one.name if one.name == other.name else f"{one.name} ({other.name} there)"


@rule("XRF001", "joint-set-differs", "error", needs=("against",))
def compare_joint_sets(robot: Facts) -> Iterator[Violation]:
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
    pairs, other, there = _robot_pairs(robot), _other(robot), _other_name(robot)
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
                    subject=group[0].name,
                    source=source,
                    message=f"joints {text}: got {len(group)} "
                    f"({names(joint.name for joint in group)}); expected 0; moving joints: "
                    f"{counts['here']} here, {counts['there']} in {there}",
                    measured={"joints": len(group), **counts},
                )
    renamed = joint_names.renamed
    if renamed:
        yield Violation(
            subject=renamed[0][0],
            source=next(j.source for j in robot.joints if j.name == renamed[0][0]),
            severity="info",
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
def compare_joints(robot: Facts) -> Iterator[Violation]:
    """The type, axis or mimic of a joint differs between the files.

    The same action then causes a different motion.

    Fix:
        Give the joint the same type, axis and mimic in both files. If an axis is inverted, negate
        its limits and its default position as well.

    Source:
        Both formats give the axis in the frame of the child link. If these frames are rotated
        against each other, the axes are compared in the frame of the base.
    """
    there = _other_name(robot)
    for one, other in _joint_pairs(robot):
        label, difference, severity = _difference(robot, one, other)
        if label:
            yield Violation(
                subject=one.name,
                source=one.source,
                severity=severity,
                message=f"{label} of joint {_joint_name(one, other)}: got {difference} "
                f"({there}, line {other.source.line})",
            )


def _difference(robot: Facts, one: Joint, other: Joint) -> tuple[str, str, Severity | None]:
    """Return what differs between two joints, how, and the severity; empty texts if nothing."""
    if one.kind != other.kind and "prismatic" in (one.kind, other.kind):
        return "type", f"{one.kind} here and {other.kind} there; expected the same", "error"
    angle = _axis_angle(robot, one, other)
    if angle > _MAX_AXIS_ANGLE:
        axes = f"({_format_axis(one.direction)}) here and ({_format_axis(other.direction)}) there"
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
    partner = dict(_robot_pairs(robot).joint_names.pairs)
    same = partner.get(ours.joint, ours.joint) == theirs.joint
    close = relative_difference(ours.multiplier, theirs.multiplier) <= _MAX_EFFORT_DIFFERENCE
    if same and close and abs(ours.offset - theirs.offset) <= _limit_tolerance(one):
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
    base = _robot_pairs(robot).base
    ours = _axis_in_link(base[0], robot, one)
    return min(own, _angle(ours, _axis_in_link(base[1], _other(robot), other)))


def _axis_in_link(link: str, robot: Facts, joint: Joint) -> Matrix:
    """Return the axis of a joint in the frame of a link, all joints at 0."""
    from terrainkit_robots.lint.compare.robot_pairs import trunk_pose_in_link

    pose = trunk_pose_in_link(robot, link) @ robot.body_of[joint.child].zero_pose
    return pose[:3, :3] @ joint.direction


def _angle(a: Matrix, b: Matrix) -> float:
    return math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b))


def _format_axis(axis: Matrix) -> str:
    return " ".join(f"{x:.3g}" for x in axis + 0.0)


def _limit_tolerance(joint: Joint) -> float:
    return _MAX_SLIDE_ERROR if joint.kind == "prismatic" else _MAX_HINGE_ERROR


def _matching_joints(robot: Facts) -> list[_JointPair]:
    """Return the pairs of joints with the same motion, whose numbers can be compared."""
    return [(a, b) for a, b in _joint_pairs(robot) if _difference(robot, a, b)[2] != "error"]


@rule("XRF003", "joint-limits-differ", "warning", needs=("against",))
def compare_limits(robot: Facts) -> Iterator[Violation]:
    """The limits of a joint differ between the files.

    Limits clip targets, end episodes, and define penalties. A policy trained with one file reaches
    limits in the other file that it does not know.

    Fix:
        Find out the limits of the real robot, and write them into both files.

    Source:
        MuJoCo reads both formats; the tolerance is 0.002 rad, 0.5 mm, and 1 % of a velocity.
    """
    there = _other_name(robot)
    pairs = _matching_joints(robot)
    for group in _grouped(pairs, _range_difference):
        one, other = group[0]
        unit = one.unit
        yield _report_group(
            group,
            "limits",
            f"{_format_range(one)} here and {_format_range(other)} in {there}; expected a "
            f"difference of at most {_limit_tolerance(one)} {unit}",
        )
    for group in _grouped(pairs, _velocity_difference):
        one, other = group[0]
        assert one.limit is not None
        assert other.limit is not None
        yield _report_group(
            group,
            "velocity limit",
            f"{one.limit.velocity:.6g} {one.speed_unit} here and {other.limit.velocity:.6g} "
            f"{one.speed_unit} in {there}; expected a difference of at most "
            f"{_MAX_EFFORT_DIFFERENCE:.0%}",
        )


def _range_difference(one: Joint, other: Joint) -> tuple[object, ...] | None:
    """Return the ranges of two joints if they differ."""
    a, b = one.range, other.range
    if a == b or (a and b and np.abs(np.subtract(a, b)).max() <= _limit_tolerance(one)):
        return None
    return one.kind == "prismatic", a, b


def _velocity_difference(one: Joint, other: Joint) -> tuple[object, ...] | None:
    """Return the velocities of two joints if both are given and they differ."""
    a = one.limit.velocity if one.limit else None
    b = other.limit.velocity if other.limit else None
    if not a or not b or relative_difference(a, b) <= _MAX_EFFORT_DIFFERENCE:
        return None
    return one.kind == "prismatic", a, b


def _format_range(joint: Joint) -> str:
    if joint.range is None:
        return "none"
    return f"({joint.range[0]:.6g}, {joint.range[1]:.6g}) {joint.unit}"


def _grouped(
    pairs: Sequence[_JointPair], key: Callable[[Joint, Joint], tuple[object, ...] | None]
) -> Iterator[list[_JointPair]]:
    """Yield groups of pairs with the same difference, without the pairs that agree."""
    groups: dict[tuple[object, ...], list[_JointPair]] = {}
    for one, other in pairs:
        difference = key(one, other)
        if difference is not None:
            groups.setdefault(difference, []).append((one, other))
    yield from groups.values()


def _report_group(
    group: Sequence[_JointPair], label: str, difference: str, severity: Severity | None = None
) -> Violation:
    one, other = group[0]
    listed = names(_joint_name(a, b) for a, b in group)
    joints = f"{len(group)} joints ({listed})" if len(group) > 1 else f"joint {listed}"
    return Violation(
        subject=one.name,
        source=(one.limit or one).source,
        severity=severity,
        message=f"{label} of {joints}: got {difference} "
        f"(line {(other.limit or other).source.line} there)",
        measured={"joints": len(group)},
    )


@rule("XRF004", "joint-order-differs", "warning", needs=("against",))
def compare_joint_order(robot: Facts) -> Iterator[Violation]:
    """The order of the joints differs between the files.

    Simulators number joints in the order of the file. The actions and observations of a policy
    trained on one file then silently belong to other joints of the other file.

    Fix:
        Permute actions and observations with the lists in the message, or reorder one of the files.

    Source:
        The order is that of the tree, depth first, siblings as in the file, which is MuJoCo's order
        for both formats.
    """
    pairs, other, there = _joint_pairs(robot), _other(robot), _other_name(robot)
    ours = {one.name: two.name for one, two in pairs}
    theirs = [joint.name for joint in other.joints if joint.name in ours.values()]
    indices = permutation(list(ours.values()), theirs)
    if indices is None or not is_reordered(indices):
        return
    subset = len(pairs) < max(len(robot.joints), len(other.joints))
    yield Violation(
        subject=robot.model.title,
        source=robot.model.source,
        message=f"order of the {f'{len(pairs)} common ' if subset else ''}joints: got "
        f"{names(ours, max_count=4)} here and {names(theirs, max_count=4)} in {there}; "
        f"{_format_order('theirs', 'ours', indices)}",
        measured={"permutation": str(indices), "back": str(_inverse(indices))},
    )


def _format_order(target: str, source: str, indices: Sequence[int]) -> str:
    """Return a permutation and its inverse as two expressions that can be pasted into code."""
    inverse = _inverse(indices)
    return f"{target} = {source}[{list(indices)}] and {source} = {target}[{inverse}]"


def _inverse(indices: Sequence[int]) -> list[int]:
    return [int(index) for index in np.argsort(indices)]


@rule("XRF005", "actuator-order-differs", "warning", needs=("against",))
def compare_actuator_order(robot: Facts) -> Iterator[Violation]:
    """The order of the actuators of an MJCF file differs from that of the joints.

    Controls are ordered by actuator, positions by joint. Actions in the order of the joints, as in
    a URDF, drive the wrong joints.

    Fix:
        Permute actions with the lists in the message, or reorder the actuators.

    Source:
        MuJoCo: `ctrl` has the order of <actuator>, `qpos` that of the bodies. In Unitree's MJCF of
        Go2 the right legs come first in the actuators and last in the joints.
    """
    other, there = _other(robot), _other_name(robot)
    partner = dict(_robot_pairs(robot).joint_names.pairs)
    ours = [partner[name] for name in robot.actuator_order if name in partner]
    theirs = other.actuator_order
    common = [name for name in theirs if name in ours]
    indices = permutation([name for name in ours if name in common], common)
    within = [
        f"actuator order of {file}: got another order than that of its joints; {difference}"
        for file, difference in (
            ("this file", _actuator_difference(robot)),
            (there, _actuator_difference(other)),
        )
        if difference
    ]
    if not common:  # at most one of the files is an MJCF with actuators
        yield from (_report_actuators(robot, message) for message in within)
    elif indices and is_reordered(indices):
        between = (
            f"actuator order: got another order than in {there}; "
            f"{_format_order('theirs', 'ours', indices)}"
        )
        yield _report_actuators(robot, "; ".join([between, *within]))
    elif within:
        yield _report_actuators(robot, "; ".join(["both files agree", *within]), "info")


def _actuator_difference(robot: Facts) -> str:
    """Return the permutation between the actuators and joints of a file; empty if they agree."""
    actuated = robot.actuator_order
    joints = [joint.name for joint in robot.joints if joint.name in actuated]
    indices = permutation(joints, actuated)
    if indices is None or not is_reordered(indices):
        return ""
    return (
        f"{_format_order('ctrl', 'joints', indices)}, where joints has the order "
        f"{names(joints, max_count=4)} and ctrl the order {names(actuated, max_count=4)}"
    )


def _report_actuators(robot: Facts, message: str, severity: Severity | None = None) -> Violation:
    first = next((actuator.source for actuator in robot.model.actuators), robot.model.source)
    return Violation(subject=robot.model.title, source=first, message=message, severity=severity)


@rule("XRF006", "effort-differs", "warning", needs=("against",))
def compare_effort(robot: Facts) -> Iterator[Violation]:
    """The effort limit of a joint differs between the files.

    The robot is stronger in one simulator than in the other. Motions learned in one of them fail in
    the other, or on the real robot.

    Fix:
        Look up the torque of the motor after gear and linkage, and write it into both files.

    Source:
        effort in URDF; in MJCF the largest force of the joint's actuators, and actuatorfrcrange.
    """
    other, there = _other(robot), _other_name(robot)
    pairs = _matching_joints(robot)
    efforts = {a.name: (robot.effort_limit(a), other.effort_limit(b)) for a, b in pairs}

    def difference(one: Joint, _: Joint) -> tuple[object, ...] | None:
        a, b = efforts[one.name]
        if not a or not b or relative_difference(a, b) <= _MAX_EFFORT_DIFFERENCE:
            return None
        return one.kind == "prismatic", a, b

    def missing(one: Joint, _: Joint) -> tuple[object, ...] | None:
        a, b = efforts[one.name]
        return None if bool(a) == bool(b) else (bool(a),)

    for group in _grouped(pairs, difference):
        one, unit = group[0][0], group[0][0].effort_unit
        a, b = (effort or 0.0 for effort in efforts[one.name])
        yield _report_group(
            group,
            "effort limit",
            f"{a:.5g} {unit} here and {b:.5g} {unit} in {there}, "
            f"{relative_difference(a, b):.1%} apart; expected at most {_MAX_EFFORT_DIFFERENCE:.0%}",
        )
    for group in _grouped(pairs, missing):
        limited = bool(efforts[group[0][0].name][0])
        bare = other if limited else robot
        has_actuators = bool(bare.model.actuators) or bare.model.kind != "mjcf"
        without, note = there if limited else "this file", ", which has no actuators"
        yield _report_group(
            group,
            "effort limit",
            f"none in {without}{'' if has_actuators else note}; expected the limit of "
            f"{'this file' if limited else there}",
            severity=None if has_actuators else "info",
        )


@rule("XRF007", "total-mass-differs", "warning", needs=("against",))
def compare_total_mass(robot: Facts) -> Iterator[Violation]:
    """The total mass of the robot differs between the files.

    A part is missing in one file, or counted twice. A policy adapts its forces to the weight of the
    robot.

    Fix:
        Check the bodies listed in the message: a mass may have been mistyped, or lost or replaced
        by the density of water during a conversion.

    Source:
        Declared masses; in MJCF also those that MuJoCo computes from shapes. MuJoCo 4.0 drops the
        mass of the trunk of a URDF without a floating joint, since it welds the trunk to the world.
    """
    pairs, other, there = _robot_pairs(robot), _other(robot), _other_name(robot)
    a, b = robot.total_mass, other.total_mass
    for each, mass in ((robot, a), (other, b)):
        if math.isnan(mass):
            file = truncate(each.model.file.name)
            raise CannotCheckError(f"masses of {file} are computed from mesh files")
    difference = relative_difference(a, b)
    if difference > _MAX_MASS_DIFFERENCE:
        bodies = sorted(pairs.bodies, key=lambda pair: -abs(pair[0].mass - pair[1].mass))
        causes = [
            f"{truncate(one.name)} {one.mass:.4g} and {two.mass:.4g} kg"
            for one, two in bodies[:_MAX_LISTED_BODIES]
            if relative_difference(one.mass, two.mass) > _MAX_MASS_DIFFERENCE
        ]
        yield Violation(
            subject=robot.model.title,
            source=robot.model.source,
            severity="error" if difference > _MAX_MASS_ERROR else None,
            message=f"total mass: got {a:.5g} kg here and {b:.5g} kg in {there}, {difference:.1%} "
            f"apart; expected at most {_MAX_MASS_DIFFERENCE:.0%}"
            f"{f'; largest differences: {names(causes)}' if causes else ''}",
            measured={"here": a, "there": b, "share": difference},
        )
    yield from _missing_mass(robot, other)


def _missing_mass(robot: Facts, other: Facts) -> Iterator[Violation]:
    """Yield the mass that MuJoCo drops from a URDF whose MJCF has a floating base."""
    for urdf, mjcf in ((robot, other), (other, robot)):
        floating = any(joint.kind == "floating" for joint in mjcf.model.joints)
        dropped = dropped_mass(urdf) if mjcf.model.kind == "mjcf" and floating else 0.0
        if dropped > _MAX_MASS_DIFFERENCE * urdf.total_mass:
            root, file = urdf.bodies[0].top.name, truncate(urdf.model.file.name)
            yield Violation(
                subject=root,
                source=robot.model.source,
                severity="info",
                message=f"mass that MuJoCo drops when it loads {file}: got {dropped:.5g} of "
                f"{urdf.total_mass:.5g} kg; expected 0 kg, as for {truncate(mjcf.model.file.name)} "
                f"with {mjcf.total_mass:.5g} kg; the URDF has no floating joint, so that {root} is "
                "welded to the world with all links fixed to it",
                hint="Load the MJCF, or add a floating joint above the base of the URDF.",
                measured={"dropped": dropped, "declared": urdf.total_mass},
            )


@rule("XRF008", "kinematics-differ", "error", needs=("against",))
def compare_kinematics(robot: Facts) -> Iterator[Violation]:
    """The pose of a link differs between the files at equal joint positions.

    A length, an origin, or the zero position of a joint differs. The feet then touch the ground
    where the policy does not expect it.

    Fix:
        Compare the origin of the joint of the first link that differs.

    Source:
        Both robots are compared in 20 random poses. The link poses of a URDF are computed by
        yourdfpy and those of an MJCF by MuJoCo, two independent implementations.
    """
    from terrainkit_robots.lint.compare.link_poses import compare_link_poses

    held = [a.name for a, b in _joint_pairs(robot) if _difference(robot, a, b)[2] == "error"]
    gap = compare_link_poses(robot, _other(robot), locked=held)
    if gap.is_within_tolerance:
        return
    severity: Severity | None = "warning" if gap.is_rotation_only else None
    if gap.is_base_offset and gap.base[0] != gap.base[1]:
        severity = "info"
    links = {link.name: link for link in robot.links}
    subject = gap.base[0] if gap.is_base_offset else gap.first
    yield Violation(
        subject=subject,
        source=links[subject].source,
        severity=severity,
        message=_kinematics_message(gap, _other_name(robot)),
        measured={
            "distance": gap.distance,
            "angle": gap.angle,
            "link": gap.link,
            "pose": gap.pose,
            "poses": gap.poses,
            "seed": gap.seed,
        },
    )


def _kinematics_message(gap: "LinkPoseDifference", other: str) -> str:
    from terrainkit_robots.lint.compare.link_poses import MAX_ANGLE, MAX_DISTANCE

    ours, theirs = gap.base
    base = ours if ours == theirs else f"{ours} ({theirs} there)"
    angle = f"{math.degrees(gap.angle):.3g} deg"
    expected = f"expected at most {1000 * MAX_DISTANCE:g} mm and {math.degrees(MAX_ANGLE):.1g} deg"
    if gap.is_base_offset:
        return (
            f"frame of {base} on the trunk: got a difference to {other} of "
            f"{1000 * gap.distance:.4g} mm and {angle}, the same for all {gap.links} links; "
            f"{expected}"
        )
    if gap.is_rotation_only:
        return (
            f"rotation of link frames against those of {other}: got up to {angle} at {gap.link}, "
            f"the same in every pose, first at {gap.first}; {expected}; all origins agree to "
            f"{1000 * gap.distance:.2g} mm"
        )
    return (
        f"position of link {gap.link} relative to {base}: got a difference to {other} of "
        f"{1000 * gap.distance:.4g} mm and up to {angle} in pose {gap.pose} of {gap.poses} (seed "
        f"{gap.seed}); {expected}; the first of {gap.links} links that differs is {gap.first}"
    )


@rule("XRF009", "inertia-differs", "warning", needs=("against",))
def compare_inertia(robot: Facts) -> Iterator[Violation]:
    """The mass, center of mass or inertia of a body differs between the files.

    Robots with equal total mass can still differ, such as in the height of the center of mass or
    the inertia of the feet. A typical cause is a conversion that replaced an inertia by a
    placeholder.

    Fix:
        Use the numbers that come from CAD. Round or equal numbers are placeholders.

    Source:
        Links that are connected by fixed joints count as one body, as simulators merge them. Only
        bodies with the same joints in both files are compared.
    """
    pairs, other, there = _robot_pairs(robot), _other(robot), _other_name(robot)
    total_differs = relative_difference(robot.total_mass, other.total_mass) > _MAX_MASS_DIFFERENCE
    for one, two in pairs.bodies:
        if min(one.mass, two.mass) < _MIN_MASS:
            continue
        if not (has_valid_inertial(one) and has_valid_inertial(two)):
            continue
        gap, body, message = body_difference(robot, other, pairs, one, two), truncate(one.name), ""
        if gap.mass > _MAX_MASS_DIFFERENCE:
            if not total_differs:  # else reported by XRF007
                message = (
                    f"mass of body {body}: got {one.mass:.4g} kg here and {two.mass:.4g} kg in "
                    f"{there}; expected a difference of at most {_MAX_MASS_DIFFERENCE:.0%}"
                )
        elif gap.center > _MAX_COM_DISTANCE:
            message = (
                f"center of mass of body {body}: got a distance of {1000 * gap.center:.3g} mm from "
                f"that in {there}; expected at most {1000 * _MAX_COM_DISTANCE:g} mm"
            )
        elif gap.inertia > _MAX_INERTIA_DIFFERENCE:
            message = (
                f"principal moments of body {body}: got {_format_moments(one.principal)} kg m2 "
                f"here and {_format_moments(two.principal)} kg m2 in {there}, an inertia "
                f"{gap.inertia:.0%} apart; expected at most {_MAX_INERTIA_DIFFERENCE:.0%}"
            )
        if message:
            link = next(link for link in one.links if link.name == one.name)
            yield Violation(
                subject=one.name,
                source=(link.inertial or link).source,
                message=message,
                measured={"mass": gap.mass, "center": gap.center, "inertia": gap.inertia},
            )


def _format_moments(moments: Matrix) -> str:
    return f"({', '.join(f'{moment:.3g}' for moment in moments)})"

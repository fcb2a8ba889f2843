"""Rules on the symmetry of left and right (SYM)."""

import math
from collections import Counter
from collections.abc import Callable, Iterator
from decimal import Decimal
from functools import cached_property

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.link_source import inertia_source, mass_source
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.symmetry.asymmetry import (
    MAX_AXIS_ERROR,
    MAX_LIMIT_ERROR,
    MAX_POSITION_ERROR,
    MAX_RELATIVE_LIMIT_ERROR,
    MAX_RELATIVE_POSITION_ERROR,
    Misalignment,
    find_flipped_joints,
    find_flipped_pairs,
    has_flipped_axes,
    limits_match,
)
from terrainkit_robots.analysis.symmetry.mirror_pairs import MirrorSide
from terrainkit_robots.description.model import Joint, Source
from terrainkit_robots.lint.rule import Check, Measured, Violation, rule
from terrainkit_robots.lint.rules.inr import (
    com_outside_body,
    implausible_density,
    inertia_too_large,
    inertia_too_small,
    mass_ratio,
    massless_body,
    not_positive_definite,
    placeholder_inertia,
    triangle_inequality,
)
from terrainkit_robots.lint.rules.jnt import (
    placeholder_limit,
    unknown_joint_type,
    wide_range,
    zero_axis,
)
from terrainkit_robots.text import contrast
from terrainkit_robots.transforms import Matrix

_MAX_MASS_DIFFERENCE = 0.02
"""Allowed relative difference of masses: cables and screws that CAD adds on one side only."""

_MAX_COM_ERROR, _COM_ERROR_SHARE = 0.002, 0.1
"""Allowed distance of a center of mass from the mirrored one: a constant [m] plus a share of the
radius of gyration."""

_MAX_TRUNK_OFFSET, _TRUNK_OFFSET_SHARE = 0.02, 0.25
"""Allowed distance of the trunk's center of mass from the mirror plane: at least this distance [m]
and this share of that of the legs. Of 143 published legged robots, none exceeds 0.11."""

_MAX_MOMENT_DIFFERENCE = 0.05
"""Allowed difference of principal moments, as a share of the largest one."""

_MAX_LIMIT_DIFFERENCE = 0.01
"""Allowed relative difference of effort and velocity limits."""


@rule("SYM001", "mass-asymmetry", "warning")
def mass_asymmetry(robot: Facts) -> Iterator[Violation]:
    """The mass of a body differs from that of its mirror image.

    A number was mistyped, or changed on one side only. The robot leans, and a policy learns to
    compensate for a lean that the real robot does not have.

    Fix:
        Give both bodies the same mass; ignore the rule if the real masses differ.

    Source:
        The masses of tested robots without defects agree to four digits.
    """
    _check_joint_types(robot)
    other_checks = _OtherChecks(robot, implausible_density, mass_ratio, massless_body)
    for pair in robot.uncopied_pairs:
        left, right = pair.left, pair.right
        difference = _relative_difference(left.body.mass, right.body.mass)
        if not _has_mass(left, right) or difference <= _MAX_MASS_DIFFERENCE:
            continue
        if other_checks.report(left, right):
            continue
        odd, other = robot.outlier_first(left, right, lambda body: np.array([body.mass]))
        yield _report(
            odd.body.name,
            other.body.name,
            f"mass of body {odd.body.name}: got {odd.body.mass:.4g} kg, "
            f"{contrast(difference, _MAX_MASS_DIFFERENCE, '.1%')[0]} from the "
            f"{other.body.mass:.4g} kg of its mirror image {other.body.name}; expected at most "
            f"{_MAX_MASS_DIFFERENCE:.0%}",
            {"mass": odd.body.mass, "other": other.body.mass},
            mass_source(odd.body.main_link),
        )


def _has_mass(left: MirrorSide, right: MirrorSide) -> bool:
    """Return whether both bodies have valid masses; the INR rules report the others."""
    inertials = [link.inertial for joint in (left, right) for link in joint.body.links]
    masses = [inertial.mass for inertial in inertials if inertial is not None]
    valid = all(mass is not None and mass >= 0 for mass in masses)
    return valid and min(left.body.mass, right.body.mass) > 0


def _relative_difference(a: float, b: float) -> float:
    largest = max(abs(a), abs(b))
    return abs(a - b) / largest if largest > 0 else 0.0


def _report(
    name: str, mirror_image: str, message: str, measured: Measured, source: Source
) -> Violation:
    return Violation(
        subject=name,
        source=source,
        certainty="likely",
        message=message,
        measured={**measured, "mirror_image": mirror_image},
    )


@rule("SYM002", "com-asymmetry", "warning")
def com_asymmetry(robot: Facts) -> Iterator[Violation]:
    """A center of mass is not at the mirrored position of its mirror image.

    Usually a sign was lost when one side was copied from the other, or the frame of one link is
    rotated. As with a wrong mass, the weight shifts to one side. The center of mass of the trunk
    has to be close to the mirror plane.

    Fix:
        Mirror the origin of the <inertial>, in the frame of its own link.

    Source:
        The centers of mass of tested robots without defects agree to 0.1 mm; the tolerance is 2 mm
        plus 10 % of the radius of gyration.
    """
    _check_joint_types(robot)
    _, displaced = robot.misalignments
    other_checks = _OtherChecks(robot, com_outside_body)
    for pair in robot.uncopied_pairs:
        left, right = pair.left, pair.right
        if pair.indices & displaced or not _has_mass(left, right):
            continue
        difference = _relative_difference(left.body.mass, right.body.mass)
        if _is_merged(left, right) and difference > _MAX_MASS_DIFFERENCE:
            continue  # a heavier part shifts the center of mass of the merged body
        error, limit = _com_error(robot, left, right), _max_com_error(left, right)
        if error <= limit or other_checks.report(left, right):
            continue
        if _is_same_part(robot, left.body, right.body):
            continue
        odd, other = robot.outlier_first(left, right, lambda body: body.center)
        got, expected = contrast(1000 * error, 1000 * limit, ".3g")
        yield _report(
            odd.body.name,
            other.body.name,
            f"center of mass of body {odd.body.name}: got {_format_point(odd.body.center)} mm, and "
            f"{_format_point(other.body.center)} mm for its mirror image {other.body.name}, each "
            f"in its own frame: {got} mm from mirrored; expected at most {expected} mm",
            {"gap": error, "allowed": limit},
            mass_source(odd.body.main_link),
        )
    if len(robot.legs) > 1 and robot.uncopied_pairs:
        yield from _trunk_offset(robot)


def _trunk_offset(robot: Facts) -> Iterator[Violation]:
    """Yield a violation if the center of mass of the trunk is far from the mirror plane."""
    trunk, mirror = robot.bodies[0], robot.mirror
    starts = [abs(float(leg.limb.points[0] @ mirror.normal) - mirror.offset) for leg in robot.legs]
    limit = max(_MAX_TRUNK_OFFSET, _TRUNK_OFFSET_SHARE * max(starts))
    distance = abs(float(trunk.center @ mirror.normal) - mirror.offset)
    reported = {violation.subject for violation in com_outside_body(robot)}
    if trunk.mass > 0 and distance > limit and trunk.name not in reported:
        got, expected = contrast(1000 * distance, 1000 * limit, ".3g")
        yield Violation(
            subject=trunk.name,
            source=mass_source(trunk.main_link),
            certainty="likely",
            message=f"distance of the center of mass of trunk {trunk.name} from the mirror plane: "
            f"got {got} mm; expected at most {expected} mm",
            measured={"gap": distance, "allowed": limit},
        )


def _com_error(robot: Facts, left: MirrorSide, right: MirrorSide) -> float:
    return float(np.linalg.norm(robot.mirror.image(left.arm) - right.arm))


def _max_com_error(left: MirrorSide, right: MirrorSide) -> float:
    radii = [
        math.sqrt(max(float(joint.body.principal[2]), 0.0) / joint.body.mass)
        for joint in (left, right)
    ]
    return _MAX_COM_ERROR + _COM_ERROR_SHARE * min(radii)


def _is_same_part(robot: Facts, a: Body, b: Body) -> bool:
    """Return whether both sides use the same part without mirroring it.

    The center of mass, the shapes and the child bodies are then at the same places of the frame.
    """
    return (
        bool(np.abs(a.center - b.center).max() < _MAX_COM_ERROR)
        and bool(a.collisions or a.visuals)
        and _signature(robot, a) == _signature(robot, b)
    )


def _signature(robot: Facts, body: Body) -> Counter[tuple[object, ...]]:
    """Return the shapes and child bodies of a body with their poses, key to 1 mm."""

    def key(pose: Matrix) -> tuple[float, ...]:
        return tuple(float(x) for x in np.round(pose[:3], 3).ravel() + 0.0)

    shapes = [
        (g.shape, g.size, (g.mesh.filename, g.mesh.scale) if g.mesh else None, key(placed.pose))
        for placed in (*body.collisions, *body.visuals)
        for g in (placed.geometry,)
    ]
    mounts = [key(other.origin) for other in robot.bodies if other.parent == body.index]
    return Counter([*shapes, *mounts])


def _is_merged(left: MirrorSide, right: MirrorSide) -> bool:
    """Return whether one of two bodies has several links with mass."""
    return any(
        sum(link.inertial is not None and bool(link.inertial.mass) for link in joint.body.links) > 1
        for joint in (left, right)
    )


def _format_point(vector: Matrix) -> str:
    return "(" + ", ".join(f"{1000 * x + 0.0:.1f}" for x in vector) + ")"


_INERTIA_RULES = (
    not_positive_definite,
    placeholder_inertia,
    triangle_inequality,
    inertia_too_large,
    inertia_too_small,
    implausible_density,
)
"""Rules whose violations explain a difference of inertias."""


@rule("SYM003", "inertia-asymmetry", "warning")
def inertia_asymmetry(robot: Facts) -> Iterator[Violation]:
    """The principal moments of a body differ from those of its mirror image.

    A reflection changes the signs of products of inertia, but not the principal moments. If they
    differ, a number was mistyped or changed on one side only.

    Fix:
        Copy the inertia from the correct side, and negate the two products that contain the
        mirrored axis.

    Source:
        The principal moments of tested robots without defects agree to 0.1 %.
    """
    _check_joint_types(robot)
    other_checks = _OtherChecks(robot, *_INERTIA_RULES)
    for pair in robot.uncopied_pairs:
        left, right = pair.left, pair.right
        if not _has_mass(left, right) or not _has_same_parts(robot, left, right):
            continue
        a, b = left.body.principal, right.body.principal
        scaled = b * (left.body.mass / right.body.mass)  # SYM001 reports the difference of masses
        difference = min(_moment_difference(a, b), _moment_difference(a, scaled))
        if difference <= _MAX_MOMENT_DIFFERENCE or other_checks.report(left, right):
            continue
        digit = max(_precision(left.body), _precision(right.body))
        if digit >= (difference - _MAX_MOMENT_DIFFERENCE) * float(max(a[2], b[2])):
            continue  # rounding explains the difference
        odd, other = robot.outlier_first(left, right, lambda body: body.principal)
        yield _report(
            odd.body.name,
            other.body.name,
            f"principal moments of body {odd.body.name}: got {_format(odd.body.principal)} kg m2, "
            f"and {_format(other.body.principal)} kg m2 for its mirror image {other.body.name}: "
            f"{contrast(difference, _MAX_MOMENT_DIFFERENCE, '.1%')[0]} of the largest apart; "
            f"expected at most {_MAX_MOMENT_DIFFERENCE:.0%}",
            {"gap": difference},
            inertia_source(odd.body.main_link),
        )


def _has_same_parts(robot: Facts, left: MirrorSide, right: MirrorSide) -> bool:
    """Return whether merged bodies agree in mass and center of mass; else moments must differ."""
    if not _is_merged(left, right):
        return True
    difference = _relative_difference(left.body.mass, right.body.mass)
    close = _com_error(robot, left, right) <= _max_com_error(left, right)
    return close and difference <= _MAX_MASS_DIFFERENCE


def _moment_difference(a: Matrix, b: Matrix) -> float:
    largest = max(float(np.abs(a).max()), float(np.abs(b).max()))
    return float(np.abs(a - b).max()) / largest if largest > 0 else 0.0


def _precision(body: Body) -> float:
    """Return the value of the last decimal digit of a body's inertia [kg m2]."""
    inertial = body.main_link.inertial
    if inertial is None or inertial.inertia is None:
        return 0.0
    numbers = [Decimal(repr(float(x))) for x in inertial.inertia.flat if x]
    exponents = [e for x in numbers if isinstance(e := x.as_tuple().exponent, int)]
    return float(10.0 ** min(exponents, default=0))


def _format(moments: Matrix) -> str:
    return ", ".join(f"{moment:.4g}" for moment in moments)


@rule("SYM004", "limit-asymmetry", "warning")
def limit_asymmetry(robot: Facts) -> Iterator[Violation]:
    """The limits of a joint do not match those of its mirror image.

    If equal positions mirror each other, the limits must be equal. If opposite positions do, as for
    most roll and yaw joints, lower and upper must be swapped and negated. Otherwise one leg cannot
    reach the poses of the other.

    Fix:
        Copy the limits of the mirror image, or swap lower and upper and negate both.

    Source:
        The limits of tested robots without defects agree exactly.
    """
    other_checks = _OtherChecks(robot, wide_range)
    for pair in robot.uncopied_pairs:
        left, right = pair.left, pair.right
        a, b = left.joint.range, right.joint.range
        if pair.sign == 0 or a is None or b is None or limits_match(a, b, pair.sign):
            continue
        if other_checks.report(left, right):
            continue
        if has_flipped_axes(left, right) and limits_match(a, b, -pair.sign):
            continue  # SYM007 reports the axis
        odd, other = robot.outlier_first(left, right, _limit_sizes)
        own, mirror = (a, b) if odd is left else (b, a)
        expected = mirror if pair.sign > 0 else (-mirror[1], -mirror[0])
        unit, name = odd.joint.unit, other.joint.name
        yield _report(
            odd.joint.name,
            name,
            f"limits of joint {odd.joint.name}: got {_format_limits(own)} {unit}; expected "
            f"{_format_limits(expected)} {unit}, mirrored from those of {name}, "
            f"within {MAX_LIMIT_ERROR:g} {unit} plus {MAX_RELATIVE_LIMIT_ERROR:.0%} of the range",
            {"lower": own[0], "upper": own[1], "other_lower": mirror[0], "other_upper": mirror[1]},
            _limit_source(odd.joint),
        )


def _limit_sizes(body: Body) -> Matrix | None:
    limits = body.joint.range if body.joint else None
    return None if limits is None else np.sort(np.abs(limits))


def _limit_source(joint: Joint) -> Source:
    return joint.limit.source if joint.limit else joint.source


def _format_limits(limits: tuple[float, float]) -> str:
    return f"{limits[0] + 0.0:.5g} to {limits[1] + 0.0:.5g}"


@rule("SYM005", "effort-asymmetry", "warning")
def effort_asymmetry(robot: Facts) -> Iterator[Violation]:
    """The effort or velocity limit of a joint differs from that of its mirror image.

    Both joints have the same motor. The weaker one saturates first, and the robot veers to one
    side.

    Fix:
        Give both joints the limits of the motor.

    Source:
        The limits of tested robots without defects agree exactly.
    """
    other_checks = _OtherChecks(robot, placeholder_limit)
    for pair in robot.uncopied_pairs:
        left, right = pair.left, pair.right
        differences: dict[str, tuple[float, float, float, _LimitOf]] = {}
        for name, limit_of in (("effort", Facts.effort_limit), ("velocity", _velocity_of)):
            a, b = limit_of(robot, left.joint), limit_of(robot, right.joint)
            if a is None or b is None or min(a, b) <= 0:
                continue
            difference = _relative_difference(a, b)
            if difference > _MAX_LIMIT_DIFFERENCE:
                differences[name] = (a, b, difference, limit_of)
        if not differences or other_checks.report(left, right):
            continue

        _, _, _, first = next(iter(differences.values()))

        def value(body: Body, limit_of: _LimitOf = first) -> Matrix | None:
            limit = limit_of(robot, body.joint) if body.joint else None
            return None if limit is None else np.array([limit])

        odd, other = robot.outlier_first(left, right, value)
        joint, parts = odd.joint, list[str]()
        measured: dict[str, float | int | str] = {}
        for name, (a, b, difference, _) in differences.items():
            own, mirror = (b, a) if odd is right else (a, b)
            unit = joint.effort_unit if name == "effort" else joint.speed_unit
            parts.append(f"{own:g} {unit}, {_percent(difference)} from the {mirror:g} {unit}")
            measured[name], measured[f"other_{name}"] = own, mirror
        yield _report(
            joint.name,
            other.joint.name,
            f"{' and '.join(differences)} limit of joint {joint.name}: got {' and '.join(parts)} "
            f"of its mirror image {other.joint.name}; expected at most "
            f"{_MAX_LIMIT_DIFFERENCE:.0%}",
            measured,
            _limit_source(joint),
        )


def _percent(difference: float) -> str:
    return contrast(difference, _MAX_LIMIT_DIFFERENCE, ".1%")[0]


_LimitOf = Callable[[Facts, Joint], float | None]


def _velocity_of(_: Facts, joint: Joint) -> float | None:
    return joint.limit.velocity if joint.limit else None


@rule("SYM006", "joint-origin-asymmetry", "warning")
def joint_origin_asymmetry(robot: Facts) -> Iterator[Violation]:
    """The origin of a joint does not mirror that of its mirror image.

    One leg is longer, mounted further out, or bent at zero. The robot leans or stands on three
    legs, and a gait learned for one side is wrong for the other.

    Fix:
        Mirror the origin of the joint: negate the lateral coordinate and two of the angles.

    Source:
        The joint origins of tested robots without defects agree to 0.1 mm.
    """
    _check_joint_types(robot)
    errors, _ = robot.misalignments
    for error in errors:
        if not error.is_axis:
            yield _report_pair(robot, error)


@rule("SYM007", "joint-axis-asymmetry", "warning")
def joint_axis_asymmetry(robot: Facts) -> Iterator[Violation]:
    """The axis of a joint does not mirror that of its mirror image.

    With a tilted axis the leg moves sideways. With an inverted axis the joint moves in the opposite
    direction; this shows in its limits, which still match those of the other legs or of the mirror
    image.

    Fix:
        Give the axis the numbers of the mirror image, if the frames of both joints are parallel.

    Source:
        Tested robots have either the same axis on all legs, or mirrored axes on all legs.
    """
    _check_joint_types(robot)
    errors, _ = robot.misalignments
    for error in errors:
        if error.is_axis:
            yield _report_pair(robot, error)
    reported = {violation.subject for violation in zero_axis(robot)}
    for found in find_flipped_joints(robot.legs, robot.bodies):
        joint = found.joint
        if joint.name in reported:
            continue
        reported.add(joint.name)
        yield Violation(
            subject=joint.name,
            source=joint.axis_source or joint.source,
            certainty="likely",
            message=f"axis of joint {joint.name} in the trunk frame: got "
            f"{_format_axis(found.axis)}; expected the direction of the same joint of all "
            f"{found.others} other legs, such as {_format_axis(found.expected_axis)}, or mirrored "
            "axes on each side",
            measured={"others": found.others},
        )
    yield from _opposite_axes(robot, reported)


def _opposite_axes(robot: Facts, reported: set[str]) -> Iterator[Violation]:
    """Yield joints whose axis is opposite to that of the mirror image, but should not be."""
    for pair in robot.uncopied_pairs:
        left, right = pair.left, pair.right
        a, b = left.joint.range, right.joint.range
        if pair.sign == 0 or a is None or b is None:
            continue
        negated = not limits_match(a, b, pair.sign) and limits_match(a, b, -pair.sign)
        known = not reported.isdisjoint({left.joint.name, right.joint.name})
        if negated and has_flipped_axes(left, right) and not known:
            reported.add(right.joint.name)
            yield _report_axis(
                left,
                right,
                f"got {_format_axis(right.axis)} with limits {_format_limits(b)} "
                f"{right.joint.unit}, opposite to {_format_axis(left.axis)} with limits "
                f"{_format_limits(a)} {left.joint.unit} of its mirror image {left.joint.name}; "
                "expected the negated axis or the negated limits",
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
    return _report(
        joint.name,
        left.joint.name,
        f"axis of joint {joint.name} in the trunk frame: {message}",
        measured,
        joint.axis_source or joint.source,
    )


def _format_axis(axis: Matrix) -> str:
    return "(" + ", ".join(f"{x:.3g}" for x in np.round(axis, 3) + 0.0) + ")"


def _report_pair(robot: Facts, error: Misalignment) -> Violation:
    def position(body: Body) -> Matrix:
        anchor = np.zeros(3) if body.joint is None else body.joint.anchor
        return np.asarray(body.origin[:3, :3] @ anchor + body.origin[:3, 3])

    def axis(body: Body) -> Matrix | None:
        return body.joint.direction if body.joint else None

    def rotation(body: Body) -> Matrix:
        return body.origin[:3, :3].ravel()

    value = axis if error.is_axis else position if error.distance else rotation
    odd, other = robot.outlier_first(error.left, error.right, value)
    name, mirror = odd.joint.name, other.joint.name
    if error.distance:
        message = (
            f"position of joint {name} relative to the joint above it, in the trunk frame: got "
            f"{_format_point(odd.offset)} mm, and {_format_point(other.offset)} mm for its mirror "
            f"image {mirror}: {1000 * error.distance:.3g} mm from mirrored; expected at most "
            f"{1000 * MAX_POSITION_ERROR:g} mm plus {MAX_RELATIVE_POSITION_ERROR:.0%} of the "
            "distance"
        )
    else:
        part = "axis" if error.is_axis else "frame"
        message = (
            f"angle between the {part} of joint {name} and that of its mirror image {mirror}: got "
            f"{math.degrees(error.angle):.3g} deg; expected at most "
            f"{math.degrees(MAX_AXIS_ERROR):.0f} deg"
        )
    source = (odd.joint.axis_source if error.is_axis else None) or odd.joint.source
    return _report(name, mirror, message, {"gap": error.distance, "angle": error.angle}, source)


@rule("SYM008", "copied-assembly", "info")
def copied_assembly(robot: Facts) -> Iterator[Violation]:
    """The left and the right side are the same assembly, mounted twice.

    Two arms of one product are equal in their own frames, and are not mirror images of each other.
    The other rules on symmetry do not apply to them, and a policy cannot be mirrored by swapping
    joints with a sign.

    Fix:
        No action if the real robot is built like this. Otherwise mirror one side: centers of mass,
        products of inertia, origins and limits.

    Source:
        Both sides have the same meshes, inertials, joint axes, origins and limits, and at least one
        center of mass or range is not mirrored.
    """
    copied = robot.copied_pairs
    differing = [
        pair
        for pair in copied
        if (
            _has_mass(pair.left, pair.right)
            and _com_error(robot, pair.left, pair.right) > _max_com_error(pair.left, pair.right)
        )
        or (
            pair.sign != 0
            and (a := pair.left.joint.range) is not None
            and (b := pair.right.joint.range) is not None
            and not limits_match(a, b, pair.sign)
        )
    ]
    if differing:
        first = copied[0]
        yield _report(
            first.left.body.name,
            first.right.body.name,
            f"assemblies on both sides: got {len(copied)} equal pairs of bodies, from "
            f"{first.left.body.name} and {first.right.body.name} on; {len(differing)} of them are "
            "not mirror images",
            {"pairs": len(copied), "differing": len(differing)},
            first.left.body.top.source,
        )


def _check_joint_types(robot: Facts) -> None:
    """Raise CannotCheckError if a joint has an unknown type, so that its body may be merged."""
    for violation in unknown_joint_type(robot):
        raise CannotCheckError(f"the type of joint {violation.subject} is unknown")


class _OtherChecks:
    """Links and joints that other rules report, computed on first use."""

    def __init__(self, robot: Facts, *checks: Check) -> None:
        self._robot = robot
        self._checks = checks

    @cached_property
    def _names(self) -> set[str]:
        violations = (violation for check in self._checks for violation in check(self._robot))
        return {violation.subject for violation in violations if violation.severity != "info"}

    def report(self, left: MirrorSide, right: MirrorSide) -> bool:
        """Return whether a link or joint of one of two bodies is reported."""
        names = {link.name for joint in (left, right) for link in joint.body.links}
        return not self._names.isdisjoint(names | {left.joint.name, right.joint.name})

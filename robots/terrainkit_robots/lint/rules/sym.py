"""SYM: left and right."""

import math
from collections import Counter
from collections.abc import Callable, Iterator
from decimal import Decimal
from functools import cached_property

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.main_link import inertia_source, main_link, mass_source
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.effort import effort_of
from terrainkit_robots.analysis.symmetry.asymmetry import (
    LIMIT,
    LIMIT_SHARE,
    PLACE,
    PLACE_SHARE,
    TURNED,
    Slip,
    against_its_kind,
    against_the_rest,
    limits_match,
    opposed,
    slips,
)
from terrainkit_robots.analysis.symmetry.mirror_pairs import Twin, odd_one_first, twins
from terrainkit_robots.description.model import Joint, Source
from terrainkit_robots.lint.rule import Check, Measured, Violation, rule
from terrainkit_robots.lint.rules.inr import (
    center_of_mass_outside,
    implausible_density,
    mass_ratio,
    massless_body,
    not_positive_definite,
    placeholder_inertia,
    too_concentrated_inertia,
    too_spread_inertia,
    triangle_inequality,
)
from terrainkit_robots.lint.rules.jnt import (
    placeholder_limit,
    unknown_type,
    wide_range,
    zero_axis,
)
from terrainkit_robots.transforms import Matrix

_MASS = 0.02
"""Share by which masses may differ: cables and screws that CAD puts on one side only."""

_CENTER, _CENTER_SHARE = 0.002, 0.1
"""How far centres of mass may be from mirrored: some metres and a share of the gyration radius."""

_MOMENTS = 0.05
"""Share of the largest principal moment by which moments may differ."""

_STRENGTH = 0.01
"""Share by which effort and velocity may differ."""


@rule("SYM001", "mass-differs", "warning")
def mass_differs(robot: Facts) -> Iterator[Violation]:
    """A body is heavier than its mirror image.

    One number was mistyped, or changed on one side only. The robot leans, and a policy learns to
    make up for it, which it then does on a robot that does not lean.

    Fix:
        Give both the same mass; ignore the rule if they do differ.

    Source:
        Sound robots that were tried are the same left and right to four digits.
    """
    _need_the_tree(robot)
    told = _Told(robot, implausible_density, mass_ratio, massless_body)
    for _, left, right in twins(robot):
        a, b = left.body.mass, right.body.mass
        if not _both_have_mass(left, right) or not _apart(a, b, _MASS):
            continue
        if told.any_of(left, right):
            continue
        odd, other = odd_one_first(robot, left, right, lambda body: np.array([body.mass]))
        yield _differ(
            odd,
            other,
            f"has {odd.body.mass:.4g} kg, {{other}} {other.body.mass:.4g} kg: "
            f"{_share(a, b):.1%} apart; wanted {_MASS:.0%} at most",
            {"mass": odd.body.mass, "other": other.body.mass},
            mass_source(main_link(odd.body)),
        )


def _both_have_mass(left: Twin, right: Twin) -> bool:
    """Return whether two masses can be compared; INR tells where they cannot."""
    masses = [
        link.inertial.mass
        for link in (*left.body.links, *right.body.links)
        if link.inertial is not None
    ]
    sound = all(mass is not None and mass >= 0 for mass in masses)
    return sound and min(left.body.mass, right.body.mass) > 0


def _apart(a: float, b: float, share: float) -> bool:
    return abs(a - b) > share * max(abs(a), abs(b))


def _share(a: float, b: float) -> float:
    return abs(a - b) / max(abs(a), abs(b))


def _differ(
    odd: Twin, other: Twin, message: str, measured: Measured, source: Source, *, joint: bool = False
) -> Violation:
    """Return a defect of one of two; in the message, {other} stands for the name of the other."""
    names = [twin.joint.name if joint else twin.body.name for twin in (odd, other)]
    told = message.replace("{other}", f"its mirror image {names[1]}")
    return Violation(
        subject=names[0],
        source=source,
        certainty="likely",
        message=f"{'joint' if joint else 'body'} {names[0]} {told}",
        measured={**measured, "mirror_image": names[1]},
    )


@rule("SYM002", "center-of-mass-differs", "warning")
def center_differs(robot: Facts) -> Iterator[Violation]:
    """A centre of mass is not where that of its mirror image is.

    Mostly a sign was lost when one side was copied from the other, or the frame of one link is
    turned. It shifts the weight to one side, as a wrong mass does.

    Fix:
        Mirror the origin of the <inertial>, in the frame of its own link.

    Source:
        Sound robots that were tried agree to 0.1 mm; the margin is 2 mm and a tenth of the radius
        of gyration.
    """
    _need_the_tree(robot)
    _, displaced = slips(robot)
    told = _Told(robot, center_of_mass_outside)
    for pair, left, right in twins(robot):
        if {pair.left, pair.right} & displaced or not _both_have_mass(left, right):
            continue
        if _merged(left, right) and _apart(left.body.mass, right.body.mass, _MASS):
            continue  # a part that is heavier draws the centre to itself
        gap = float(np.linalg.norm(robot.mirror.image(left.arm) - right.arm))
        allowed = _allowed_gap(left, right)
        if gap <= allowed or told.any_of(left, right):
            continue
        if not _one_part(robot, left.body, right.body):
            odd, other = odd_one_first(robot, left, right, lambda body: body.center)
            yield _differ(
                odd,
                other,
                f"has its centre of mass at {_millimeters(odd.body.center)} mm, {{other}} at "
                f"{_millimeters(other.body.center)} mm, each in its own frame: {1000 * gap:.3g} mm "
                f"from mirrored; wanted {1000 * allowed:.2g} mm at most",
                {"gap": gap, "allowed": allowed},
                mass_source(main_link(odd.body)),
            )


def _one_part(robot: Facts, a: Body, b: Body) -> bool:
    """Return whether both sides are one and the same part, which is not mirrored.

    Its centre of mass, its shapes and what hangs from it are then at the same places of its frame.
    """
    return (
        bool(np.abs(a.center - b.center).max() < _CENTER)
        and bool(a.collisions or a.visuals)
        and _features(robot, a) == _features(robot, b)
    )


def _features(robot: Facts, body: Body) -> Counter[tuple[object, ...]]:
    """Return what is on a body and where, to the millimetre."""

    def place(pose: Matrix) -> tuple[float, ...]:
        return tuple(float(x) for x in np.round(pose[:3], 3).ravel() + 0.0)

    shapes = [
        (g.shape, g.size, (g.mesh.filename, g.mesh.scale) if g.mesh else None, place(placed.pose))
        for placed in (*body.collisions, *body.visuals)
        for g in (placed.geometry,)
    ]
    mounts = [place(other.mount) for other in robot.bodies if other.parent == body.index]
    return Counter([*shapes, *mounts])


def _merged(left: Twin, right: Twin) -> bool:
    """Return whether one of the two is made of several links with mass."""
    return any(
        sum(link.inertial is not None and bool(link.inertial.mass) for link in twin.body.links) > 1
        for twin in (left, right)
    )


def _allowed_gap(left: Twin, right: Twin) -> float:
    radii = [
        math.sqrt(max(float(twin.body.principal[2]), 0.0) / twin.body.mass)
        for twin in (left, right)
    ]
    return _CENTER + _CENTER_SHARE * min(radii)


def _millimeters(vector: Matrix) -> str:
    return "(" + ", ".join(f"{1000 * x + 0.0:.1f}" for x in vector) + ")"


@rule("SYM003", "moments-differ", "warning")
def moments_differ(robot: Facts) -> Iterator[Violation]:
    """The principal moments of inertia differ from those of the mirror image.

    A reflection changes the signs of products, but not the principal moments. If these differ, a
    number was mistyped or changed on one side only.

    Fix:
        Copy the inertia from the side that is right, with the sign of two products changed: those
        that have the mirrored axis in them.

    Source:
        Sound robots that were tried agree to 0.1 %.
    """
    _need_the_tree(robot)
    told = _Told(robot, *_SHAPELESS)
    for _, left, right in twins(robot):
        if not _both_have_mass(left, right) or not _same_parts(robot, left, right):
            continue
        a, b = left.body.principal, right.body.principal
        scaled = b * (left.body.mass / right.body.mass)  # the mass is another rule's
        gap = min(_largest_gap(a, b), _largest_gap(a, scaled))
        digit = max(_last_digit(left.body), _last_digit(right.body))
        rounded = digit >= (gap - _MOMENTS) * float(max(a[2], b[2]))
        if gap > _MOMENTS and not rounded and not told.any_of(left, right):
            odd, other = odd_one_first(robot, left, right, lambda body: body.principal)
            yield _differ(
                odd,
                other,
                f"has principal moments {_listed(odd.body.principal)} kg m2, {{other}} "
                f"{_listed(other.body.principal)} kg m2: {gap:.1%} of the largest apart; wanted "
                f"{_MOMENTS:.0%} at most",
                {"gap": gap},
                inertia_source(main_link(odd.body)),
            )


_SHAPELESS = (
    not_positive_definite,
    placeholder_inertia,
    triangle_inequality,
    too_spread_inertia,
    too_concentrated_inertia,
    implausible_density,
)
"""Rules that tell of an inertia; that it is not the twin's either goes without saying."""


def _same_parts(robot: Facts, left: Twin, right: Twin) -> bool:
    """Return whether the moments can be compared: parts of one body are alike in mass and place."""
    if not _merged(left, right):
        return True
    gap = float(np.linalg.norm(robot.mirror.image(left.arm) - right.arm))
    same_mass = not _apart(left.body.mass, right.body.mass, _MASS)
    return same_mass and gap <= _allowed_gap(left, right)


def _largest_gap(a: Matrix, b: Matrix) -> float:
    largest = max(float(np.abs(a).max()), float(np.abs(b).max()))
    return float(np.abs(a - b).max()) / largest if largest > 0 else 0.0


def _last_digit(body: Body) -> float:
    """Return the value of the last digit in which a body's inertia is written [kg m2]."""
    link = next(link for link in body.links if link.name == body.name)
    if link.inertial is None or link.inertial.inertia is None:
        return 0.0
    numbers = [Decimal(repr(float(x))) for x in link.inertial.inertia.flat if x]
    exponents = [e for x in numbers if isinstance(e := x.as_tuple().exponent, int)]
    return float(10.0 ** min(exponents, default=0))


def _listed(moments: Matrix) -> str:
    return ", ".join(f"{moment:.4g}" for moment in moments)


@rule("SYM004", "limits-differ", "warning")
def limits_differ(robot: Facts) -> Iterator[Violation]:
    """The limits of a joint are not mirrored by those of its twin.

    Where equal positions look mirrored, the limits are the same; where opposite ones do, as for
    most joints that roll or yaw, lower and upper change places and signs. Copied limits that were
    not turned around keep one leg from doing what the other does.

    Fix:
        Give the twin the same limits, or exchange lower and upper and their signs.

    Source:
        Sound robots that were tried agree to the last digit.
    """
    told = _Told(robot, wide_range)
    for pair, left, right in twins(robot):
        a, b = left.joint.range, right.joint.range
        if pair.sign == 0 or a is None or b is None or limits_match(a, b, pair.sign):
            continue
        if told.any_of(left, right):
            continue
        if opposed(left, right) and limits_match(a, b, -pair.sign):
            continue  # the axis is what is wrong
        odd, other = odd_one_first(robot, left, right, _sizes_of_limits)
        own, its = (a, b) if odd is left else (b, a)
        unit = odd.joint.unit
        wanted = "the same" if pair.sign > 0 else "the same with exchanged signs"
        alike = "equal" if pair.sign > 0 else "opposite"
        yield _differ(
            odd,
            other,
            f"has limits {_written(own)} {unit}, {{other}} {_written(its)} {unit}; wanted {wanted} "
            f"within {LIMIT:g} {unit} and {LIMIT_SHARE:.0%} of the range, as {alike} positions "
            "mirror",
            {"lower": own[0], "upper": own[1], "other_lower": its[0], "other_upper": its[1]},
            odd.joint.limit.source if odd.joint.limit else odd.joint.source,
            joint=True,
        )


def _sizes_of_limits(body: Body) -> Matrix | None:
    ends = body.joint.range if body.joint else None
    return None if ends is None else np.sort(np.abs(ends))


def _written(ends: tuple[float, float]) -> str:
    return f"{ends[0]:.5g} to {ends[1]:.5g}"


@rule("SYM005", "strength-differs", "warning")
def strength_differs(robot: Facts) -> Iterator[Violation]:
    """The effort or the velocity of a joint differs from its twin's.

    The two are the same motor. The weaker one saturates first, and the robot veers to one side.

    Fix:
        Give both the numbers of the motor.

    Source:
        Sound robots that were tried agree to the last digit.
    """
    told = _Told(robot, placeholder_limit)
    for _, left, right in twins(robot):
        for name, of in (
            ("effort", effort_of),
            ("velocity", _velocity_of),
        ):
            a, b = of(robot, left.joint), of(robot, right.joint)
            if a is None or b is None or min(a, b) <= 0 or not _apart(a, b, _STRENGTH):
                continue
            if told.any_of(left, right):
                continue

            def value(body: Body, of: _Strength = of) -> Matrix | None:
                number = of(robot, body.joint) if body.joint else None
                return None if number is None else np.array([number])

            odd, other = odd_one_first(robot, left, right, value)
            own, its = (b, a) if odd is right else (a, b)
            unit = odd.joint.effort_unit if name == "effort" else odd.joint.speed_unit
            yield _differ(
                odd,
                other,
                f"has {name} {own:g} {unit}, {{other}} {its:g} {unit}: {_share(a, b):.1%} apart; "
                f"wanted {_STRENGTH:.0%} at most",
                {name: own, "other": its},
                odd.joint.limit.source if odd.joint.limit else odd.joint.source,
                joint=True,
            )


_Strength = Callable[[Facts, Joint], float | None]


def _velocity_of(_: Facts, joint: Joint) -> float | None:
    return joint.limit.velocity if joint.limit else None


@rule("SYM006", "joint-origin-differs", "warning")
def joint_origin_differs(robot: Facts) -> Iterator[Violation]:
    """A joint is not where the mirror image of its twin is, or its frame is turned.

    One leg is longer, further out or bent at zero. It stands on three legs, or leans, and what is
    learned for one side is wrong for the other.

    Fix:
        Mirror the origin of the joint: the sideways coordinate changes its sign, and so do two of
        the angles.

    Source:
        Sound robots that were tried agree to 0.1 mm.
    """
    _need_the_tree(robot)
    for slip in slips(robot)[0]:
        if not slip.axis:
            yield _slip_defect(robot, slip)


@rule("SYM007", "joint-axis-differs", "warning")
def joint_axis_differs(robot: Facts) -> Iterator[Violation]:
    """The axis of a joint is not mirrored by that of its twin, or points the other way.

    A joint that turns about another line than its twin does makes the leg walk sideways. One that
    turns the other way does the opposite of what it is told; the limits, which are still those of
    the other three legs or of the twin, give it away.

    Fix:
        Give the axis the same numbers as that of the twin, if their frames are parallel.

    Source:
        Robots that were tried have either the same axis on all legs, or mirrored ones on all.
    """
    _need_the_tree(robot)
    for slip in slips(robot)[0]:
        if slip.axis:
            yield _slip_defect(robot, slip)
    told = {defect.subject for defect in zero_axis(robot)}
    for stray in against_the_rest(robot):
        joint = stray.joint
        if joint.name in told:
            continue
        told.add(joint.name)
        yield Violation(
            subject=joint.name,
            source=joint.axis_source or joint.source,
            certainty="likely",
            message=f"the axis of joint {joint.name} is {_axis(stray.axis)} in the frame of the "
            f"trunk, and points the other way than those of the same joint of all {stray.others} "
            f"other legs, such as {_axis(stray.usual)}; wanted the same way, or mirrored on each "
            "side",
            measured={"others": stray.others},
        )
    for pair, left, right in twins(robot):
        a, b = left.joint.range, right.joint.range
        if pair.sign == 0 or a is None or b is None or {left.joint.name, right.joint.name} & told:
            continue
        flipped = not limits_match(a, b, pair.sign) and limits_match(a, b, -pair.sign)
        if flipped and opposed(left, right):
            told.add(right.joint.name)
            yield _differ(
                right,
                left,
                f"turns about {_axis(right.axis)}, the other way than {{other}}, which turns about "
                f"{_axis(left.axis)} in the frame of the trunk, and yet its limits are "
                f"{_written(b)} {right.joint.unit}, those of the other {_written(a)}; "
                "wanted its axis or its limits turned around",
                {"lower": b[0], "upper": b[1], "other_lower": a[0], "other_upper": a[1]},
                right.joint.axis_source or right.joint.source,
                joint=True,
            )
    for left, right, others in against_its_kind(robot):
        if right.joint.name not in told:
            yield _differ(
                right,
                left,
                f"turns about {_axis(right.axis)}, the other way than {{other}}, which turns about "
                f"{_axis(left.axis)} in the frame of the trunk, unlike the {others} other pairs "
                "with such an axis; wanted one way for all",
                {"others": others},
                right.joint.axis_source or right.joint.source,
                joint=True,
            )


def _axis(axis: Matrix) -> str:
    return "(" + ", ".join(f"{x:.3g}" for x in np.round(axis, 3) + 0.0) + ")"


def _slip_defect(robot: Facts, slip: Slip) -> Violation:
    def offset(body: Body) -> Matrix:
        return body.mount[:3, 3]

    def axis(body: Body) -> Matrix | None:
        return body.joint.direction if body.joint else None

    def turn(body: Body) -> Matrix:
        return body.mount[:3, :3].ravel()

    value = axis if slip.axis else offset if slip.gap else turn
    odd, other = odd_one_first(robot, slip.left, slip.right, value)
    if slip.gap:
        what = (
            f"is at {_millimeters(odd.offset)} mm from the joint above it, {{other}} at "
            f"{_millimeters(other.offset)} mm, in the frame of the trunk: {1000 * slip.gap:.3g} mm "
            "from mirrored"
        )
        wanted = f"{1000 * PLACE:g} mm and {PLACE_SHARE:.0%} of the distance at most"
    else:
        thing = "an axis" if slip.axis else "a frame"
        what = (
            f"has {thing} that is turned by {math.degrees(slip.angle):.3g} degrees from {{other}}"
        )
        wanted = f"{math.degrees(TURNED):.0f} degree at most"
    return _differ(
        odd,
        other,
        f"{what}; wanted {wanted}",
        {"gap": slip.gap, "angle": slip.angle},
        (odd.joint.axis_source if slip.axis else None) or odd.joint.source,
        joint=True,
    )


def _need_the_tree(robot: Facts) -> None:
    """Raise an error if a joint counts as fixed that may not be: bodies then are not what they are.

    Raises:
        CannotCheckError: if there is one.
    """
    for defect in unknown_type(robot):
        raise CannotCheckError(f"joint {defect.subject} is of no type that is known")


class _Told:
    """What other rules have told of; how it differs from its twin is then their matter."""

    def __init__(self, robot: Facts, *checks: Check) -> None:
        self._robot = robot
        self._checks = checks

    def any_of(self, *twins: Twin) -> bool:
        """Return whether one of the links or joints was told of."""
        names = {link.name for twin in twins for link in twin.body.links}
        return not self._subjects.isdisjoint(names | {twin.joint.name for twin in twins})

    @cached_property
    def _subjects(self) -> set[str]:
        found = (defect for check in self._checks for defect in check(self._robot))
        return {defect.subject for defect in found if defect.severity != "info"}

"""Rules on the symmetry of position, effort and velocity limits."""

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.symmetry.asymmetry import (
    MAX_LIMIT_ERROR,
    MAX_RELATIVE_LIMIT_ERROR,
    limits_match,
)
from terrainkit_robots.analysis.symmetry.mirror_pairs import outlier_first
from terrainkit_robots.lint.compare.body_mass import relative_difference
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule
from terrainkit_robots.lint.rules.sym.mimic import same_way_follower
from terrainkit_robots.lint.rules.sym.other_rules import OtherRules
from terrainkit_robots.text import contrast, numbers
from terrainkit_robots.transforms import Matrix

# The 4 published files that exceed it have differences such as 100 N m and 160 N m.
_MAX_LIMIT_DIFFERENCE = 0.01
"""Allowed relative difference of effort and velocity limits."""


@rule("SYM004", "limit-asymmetry", "warning")
def limit_asymmetry(robot: Facts) -> Violations:
    """The limits of a joint do not match its mirror image.

    If equal positions mirror each other, the limits must be equal. If opposite positions do, as for
    most roll and yaw joints, lower and upper must be swapped and negated. Otherwise one leg cannot
    reach the poses of the other.

    Fix:
        Copy the limits of the mirror image, or swap lower and upper and negate both.

    Source:
        The limits of tested robots without defects agree exactly.
    """
    other_rules = OtherRules(robot, "JNT008")
    for pair in robot.uncopied_pairs:
        left, right = pair.left, pair.right
        a, b = left.joint.range, right.joint.range
        if pair.sign == 0 or a is None or b is None or limits_match(a, b, pair.sign):
            continue
        if other_rules.report(pair) or same_way_follower(robot, pair) is not None:
            continue
        if pair.has_flipped_axes and limits_match(a, b, -pair.sign):
            continue  # SYM007 reports the axis
        odd, other, reason = outlier_first(robot, pair, _limit_sizes)
        own, mirror = (a, b) if odd is left else (b, a)
        expected = mirror if pair.sign > 0 else (-mirror[1], -mirror[0])
        unit, name = odd.joint.unit, other.joint.name
        yield Violation(
            element=Part(odd.joint.name, (odd.joint.limit or odd.joint).source),
            message=f"limits of joint {odd.joint.name}: got {numbers(own, '.5g', ' to ')} {unit}; "
            f"expected {numbers(expected, '.5g', ' to ')} {unit}, mirrored from {name}, "
            f"within {MAX_LIMIT_ERROR:g} {unit} plus {MAX_RELATIVE_LIMIT_ERROR:.0%} of the range; "
            f"{reason}",
            measured={
                "lower": own[0],
                "upper": own[1],
                "other_lower": mirror[0],
                "other_upper": mirror[1],
                "mirror_image": name,
            },
        )


def _limit_sizes(body: Body) -> Matrix | None:
    limits = body.joint.range if body.joint else None
    return None if limits is None else np.sort(np.abs(limits))


@rule("SYM005", "effort-asymmetry", "warning")
def effort_asymmetry(robot: Facts) -> Violations:
    """The effort or velocity limit of a joint differs from its mirror image.

    Both joints have the same motor. The weaker one saturates first, and the robot veers to one
    side.

    Fix:
        Give both joints the limits of the motor.

    Source:
        The limits of tested robots without defects agree exactly.
    """
    other_rules = OtherRules(robot, "JNT011")
    for pair in robot.uncopied_pairs:
        left, right = pair.left, pair.right
        differences: dict[str, tuple[float, float, float]] = {}
        for name in ("effort", "velocity"):
            a, b = (getattr(side.joint, name) for side in (left, right))
            if a is None or b is None or min(a, b) <= 0:
                continue
            difference = relative_difference(a, b)
            if difference > _MAX_LIMIT_DIFFERENCE:
                differences[name] = (a, b, difference)
        if not differences or other_rules.report(pair):
            continue

        def value(body: Body, name: str = next(iter(differences))) -> Matrix | None:
            limit = getattr(body.joint, name, None)
            return None if limit is None else np.array([limit])

        odd, other, reason = outlier_first(robot, pair, value)
        joint = odd.joint
        parts = list[str]()
        measured: dict[str, float | int | str] = {}
        for name, (a, b, difference) in differences.items():
            own, mirror = (b, a) if odd is right else (a, b)
            unit = getattr(joint.units, name)
            share, _ = contrast(difference, _MAX_LIMIT_DIFFERENCE, ".1%")
            parts.append(f"{own:g} {unit}, {share} from the {mirror:g} {unit}")
            measured[name], measured[f"other_{name}"] = own, mirror
        yield Violation(
            element=Part(joint.name, (joint.limit or joint).source),
            message=f"{' and '.join(differences)} limit of joint {joint.name}: got "
            f"{' and '.join(parts)} of its mirror image {other.joint.name}; expected at "
            f"most {_MAX_LIMIT_DIFFERENCE:.0%}; {reason}",
            measured={**measured, "mirror_image": other.joint.name},
        )

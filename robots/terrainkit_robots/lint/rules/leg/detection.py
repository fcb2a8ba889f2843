"""Rules on the number of legs and joints that were detected."""

from collections import Counter

import numpy as np

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.limbs import Limb
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule
from terrainkit_robots.text import names

_LEG_COUNTS = (2, 4, 6, 8)

_MAX_MASS_DIFFERENCE = 0.02
"""Allowed relative difference between the masses of two equal limbs."""

_MAX_RISE = 0.3
"""A leg points up if its end is higher than its start by this share of the distance."""


def _inverted_legs(robot: Facts) -> list[Limb]:
    """Return the limbs that have the joints of a leg, but end above their start."""
    legs = [leg.limb for leg in robot.legs]
    leg_types = {_joint_types(limb) for limb in legs}
    inverted = []
    for limb in robot.limbs:
        start = limb.points[0]
        rise = float(limb.tip[2] - start[2])
        if limb in legs or rise < _MAX_RISE * float(np.linalg.norm(limb.tip - start)):
            continue
        at_leg_height = any(abs(float(leg.points[0][2] - start[2])) < rise / 2 for leg in legs)
        if limb.has_leg_names and _joint_types(limb) in leg_types and at_leg_height:
            inverted.append(limb)
    return inverted


def _joint_types(limb: Limb) -> tuple[str, ...]:
    return tuple(joint.kind for joint in limb.joints)


@rule("LEG002", "leg-count", "warning", onboarding="warns")
def leg_count(robot: Facts) -> Violations:
    """The number of legs is not 2, 4, 6 or 8.

    A leg that is not detected usually has a joint that is misnamed or fixed, or ends at another
    height than the other legs. Limbs that equal the legs but are not counted are reported as well:
    a robot whose z axis does not point up stands on two of its four legs. A robot with a single
    limb is a hopper.

    Fix:
        Compare the missing leg with the others, from the trunk to the foot.

    Source:
        All legged robots in simulation suites have an even number of legs.
    """
    count = len(robot.legs)
    uncounted = _uncounted_legs(robot)
    measured = {"legs": count}
    expected = "2, 4, 6 or 8"
    if uncounted:
        measured["uncounted"] = len(uncounted)
        expected = (
            f"{count + len(uncounted)}, since {names(uncounted)} have the joints and masses of a "
            "leg, but do not end near the ground; check that z points up"
        )
    elif len(robot.limbs) <= 1 or count + len(_inverted_legs(robot)) in _LEG_COUNTS:
        return
    feet = ", ".join(leg.foot for leg in robot.legs)
    yield Violation(
        message=f"number of legs: got {count} ({feet}); expected {expected}", measured=measured
    )


def _uncounted_legs(robot: Facts) -> list[str]:
    """Return the last bodies of limbs that have the joints and the masses of a leg."""
    legs = [leg.limb for leg in robot.legs]
    used = robot.leg_bodies
    inverted = _inverted_legs(robot)
    return [
        robot.bodies[limb.chain[-1]].name
        for limb in robot.limbs
        if limb not in inverted and used.isdisjoint(limb.chain)
        if any(_is_equal_limb(robot, limb, leg) for leg in legs)
    ]


def _is_equal_limb(robot: Facts, limb: Limb, leg: Limb) -> bool:
    if _joint_types(limb) != _joint_types(leg) or len(limb.chain) != len(leg.chain):
        return False
    own, other = ([robot.bodies[index].mass for index in part.chain] for part in (limb, leg))
    return min(own) > 0 and bool(np.allclose(own, other, rtol=_MAX_MASS_DIFFERENCE))


@rule("LEG003", "missing-leg-joint", "warning")
def missing_leg_joint(robot: Facts) -> Violations:
    """A leg has fewer joints than the others.

    A joint that is fixed or missing makes the leg stiff. The policy learns to limp, and one motor
    of the real robot has no joint.

    Fix:
        Give the leg the joints of the other legs; look for a joint of type fixed.

    Source:
        Comparison with the number of joints that most legs have.
    """
    legs_of = Counter(joint.name for leg in robot.legs for joint in leg.joints)
    # A joint of the spine carries several legs and belongs to none.
    counts = [sum(legs_of[joint.name] == 1 for joint in leg.joints) for leg in robot.legs]
    usual, _ = max(Counter(counts).items(), key=lambda item: (item[1], item[0]))
    for leg, count in zip(robot.legs, counts, strict=True):
        if count < usual:
            yield Violation(
                element=robot.tree.links[leg.foot],
                message=f"moving joints of the leg with foot {leg.foot}: got {count}; "
                f"expected {usual}, as in the other legs",
                measured={"joints": count, "usual": usual},
            )


@rule("LEG007", "leg-points-up", "error", needs=("length-unit", "angle-unit"))
def leg_points_up(robot: Facts) -> Violations:
    """A leg points up, unlike the others.

    A sign or a rotation in the origin of one of its joints is wrong, and the robot stands on the
    other legs.

    Fix:
        Compare the origins of the first joints of this leg and the other legs.

    Source:
        Comparison of the ends of limbs with the same joint types, all joints at zero.
    """
    for limb in _inverted_legs(robot):
        start, first = limb.points[0], limb.joints[0]
        leaf = robot.bodies[limb.chain[-1]]
        rise = float(limb.tip[2] - start[2])
        reach = float(np.linalg.norm(limb.tip - start))
        yield Violation(
            element=Part(leaf.name, first.source),
            message=f"height of the end of leg {leaf.name} above joint {first.name}, all joints at "
            f"zero: got {rise:.3f} m, {rise / reach:.0%} of their distance of {reach:.3f} m; "
            f"expected less than {_MAX_RISE:.0%}, and below 0 as for the other legs",
            measured={"rise": round(rise, 4), "reach": round(reach, 4)},
        )

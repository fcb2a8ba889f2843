"""Rule on the support polygon of the standing pose."""

import math

from terrainkit_robots.analysis.bodies.contact import margin
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.stance import is_statically_stable
from terrainkit_robots.lint.rule import Violation, Violations, rule
from terrainkit_robots.text import contrast

_MIN_MARGIN = 0.01
"""Required distance of the center of mass from the edge of the support polygon [m]."""

# The margin at the mean of the contacts is taken as the largest possible one.
_MIN_MARGIN_SHARE = 0.25
"""The same as a share of the largest possible distance, for small feet."""


@rule("LEG006", "com-outside-support", "error", needs=("length-unit", "angle-unit"))
def com_outside_support(robot: Facts) -> Violations:
    """The center of mass is outside of the support polygon of the standing pose.

    The search for a standing pose moves the feet below the center of mass as far as the joints
    allow. If the center of mass is still outside, the robot falls before the policy acts. Robots on
    two wheels balance by driving and are not checked. A small distance from the edge is only a note
    for bipeds, which a policy has to balance anyway.

    Fix:
        Check the center of mass of the heaviest links and the limits of the hips.

    Source:
        Static balance: the weight must act inside the convex hull of the contacts.
    """
    stance = robot.stance
    assert stance is not None
    if math.isnan(stance.margin):
        raise CannotCheckError("MuJoCo computes a mass from a mesh")
    if robot.wheels and not is_statically_stable(robot.legs):
        raise CannotCheckError("it balances on its wheels")
    if len(stance.support) < 3:
        raise CannotCheckError("the contacts of the feet are points or a line without area")
    max_margin = margin(stance.support.mean(axis=0), stance.support)
    limit = min(_MIN_MARGIN, _MIN_MARGIN_SHARE * max_margin)
    if stance.margin >= limit:
        return
    trunk = robot.bodies[0]
    outside = stance.margin < 0
    got, expected = contrast(1000 * abs(stance.margin), 1000 * limit, ".0f")
    yield Violation(
        element=robot.tree.links[trunk.name],
        message="distance of the center of mass from the edge of the support polygon at the "
        f"standing pose: got {got} mm {'outside' if outside else 'inside'}; expected at least "
        f"{expected} mm inside",
        severity="error" if outside else "warning" if is_statically_stable(robot.legs) else "note",
        measured={"margin": round(stance.margin, 5)},
    )

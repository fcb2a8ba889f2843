"""Rules on the symmetry of inertias."""

from decimal import Decimal

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.inertia.inertial import inertia_part
from terrainkit_robots.analysis.symmetry.mirror_pairs import (
    MAX_MASS_DIFFERENCE,
    MirrorPair,
    outlier_first,
)
from terrainkit_robots.lint.compare.body_mass import relative_difference
from terrainkit_robots.lint.rule import Violation, Violations, rule
from terrainkit_robots.lint.rules.sym.other_rules import OtherRules, check_joint_types
from terrainkit_robots.text import contrast, numbers
from terrainkit_robots.transforms import Matrix

# The 20 published files that exceed it are 7 % to 62 % apart; tested robots without defects agree
# to 0.1 %.
_MAX_MOMENT_DIFFERENCE = 0.05
"""Allowed difference of principal moments, as a share of the largest one."""

_INERTIA_RULES = ("INR003", "INR005", "INR004", "INR006", "INR007", "INR010")
"""Rules whose violations explain a difference of inertias."""

_MAX_PRODUCT_ERROR = 0.1
"""Allowed difference of inertias in the same axes, as a share of the largest moment."""

_MAX_MOMENT_ERROR = 0.05
"""Difference of principal moments above which SYM003 reports the pair, as the same share."""


@rule("SYM003", "inertia-asymmetry", "warning")
def inertia_asymmetry(robot: Facts) -> Violations:
    """The principal moments of a body differ from its mirror image.

    A reflection changes the signs of products of inertia, but not the principal moments. If they
    differ, a number was mistyped or changed on one side only.

    Fix:
        Copy the inertia from the correct side, and negate the two products that contain the
        mirrored axis.

    Source:
        The principal moments of tested robots without defects agree to 0.1 %.
    """
    check_joint_types(robot)
    other_rules = OtherRules(robot, *_INERTIA_RULES)
    for pair in robot.uncopied_pairs:
        left, right = pair.left, pair.right
        if not pair.has_valid_masses or not _has_same_parts(robot, pair):
            continue
        a, b = left.body.principal, right.body.principal
        scaled = b * (left.body.mass / right.body.mass)  # SYM001 reports the difference of masses
        difference = min(relative_difference(a, b), relative_difference(a, scaled))
        harmless = difference <= _MAX_MOMENT_DIFFERENCE or pair.is_negligible(robot.total_mass)
        if harmless or other_rules.report(pair):
            continue
        digit = max(_precision(left.body), _precision(right.body))
        if digit >= (difference - _MAX_MOMENT_DIFFERENCE) * float(max(a[2], b[2])):
            continue  # rounding explains the difference
        odd, other, reason = outlier_first(robot, pair, lambda body: body.principal)
        moments = [numbers(side.body.principal, ".4g", ", ") for side in (odd, other)]
        yield Violation(
            element=inertia_part(odd.body.main_link),
            message=f"principal moments of body {odd.body.name}: got {moments[0]} kg m2, and "
            f"{moments[1]} kg m2 for its mirror image {other.body.name}: "
            f"{contrast(difference, _MAX_MOMENT_DIFFERENCE, '.1%')[0]} of the largest apart; "
            f"expected at most {_MAX_MOMENT_DIFFERENCE:.0%}; {reason}",
            measured={"gap": difference, "mirror_image": other.body.name},
        )


def _has_same_parts(robot: Facts, pair: MirrorPair) -> bool:
    """Return whether merged bodies agree in mass and center of mass; else moments must differ."""
    if not pair.is_merged:
        return True
    difference = relative_difference(pair.left.body.mass, pair.right.body.mass)
    close = pair.com_error(robot.mirror) <= pair.max_com_error
    return close and difference <= MAX_MASS_DIFFERENCE


def _precision(body: Body) -> float:
    """Return the value of the last decimal digit of a body's inertia [kg m2]."""
    inertial = body.main_link.inertial
    if inertial is None or inertial.inertia is None:
        return 0.0
    decimals = [Decimal(repr(float(x))) for x in inertial.inertia.flat if x]
    exponents = [e for x in decimals if isinstance(e := x.as_tuple().exponent, int)]
    return float(10.0 ** min(exponents, default=0))


@rule("SYM011", "product-asymmetry", "warning")
def product_asymmetry(robot: Facts) -> Violations:
    """The principal axes of a body's inertia differ from its mirror image.

    The principal moments agree, but their axes do not: a product of inertia has the wrong sign, or
    two moments are exchanged. Exporters differ in the sign of the products, and a side that was
    copied from the other one has the wrong signs. The trunk is its own mirror image, so its
    products with the mirrored axis are small.

    Fix:
        Negate the two products that contain the mirrored axis: ixy and iyz for left and right.

    Source:
        Pull request 160 of mujoco_menagerie and pull request 511 of jsk_aerial_robot. Bodies that
        both sides share without mirroring them are not checked. The trunks of 141 of 143 published
        legged robots have products of 2 % at most.
    """
    # The frames of bodies behind a misaligned joint are turned; SYM006 reports the joint.
    _, displaced = robot.misalignments
    for pair in robot.uncopied_pairs:
        left, right = pair.left, pair.right
        if displaced & pair.indices:
            continue
        a, b = _inertia(left.body), _inertia(right.body)
        if a is None or b is None:
            continue
        if np.abs(left.body.inertia - right.body.inertia).max() < 1e-3 * np.abs(a).max():
            if not _has_products(left.body.inertia):
                continue
            # With the same center of mass, they are the same part.
            if float(np.abs(left.body.center - right.body.center).max()) < 0.002:
                continue
        largest = max(float(left.body.principal[2]), float(right.body.principal[2]))
        moments = np.abs(left.body.principal - right.body.principal).max() / largest
        reflection = robot.mirror.reflection
        error = float(np.abs(reflection @ a @ reflection - b).max()) / largest
        if error <= _MAX_PRODUCT_ERROR or moments > _MAX_MOMENT_ERROR:
            continue
        odd, other, reason = outlier_first(robot, pair, lambda body: body.inertia)
        yield Violation(
            element=inertia_part(odd.body.main_link),
            message=f"inertia of body {odd.body.name} in the axes of the trunk: got {error:.0%} "
            f"of its largest moment between it and the mirrored one of {other.body.name}; "
            f"expected at most {_MAX_PRODUCT_ERROR:.0%}; {reason}",
            measured={"difference": error, "mirror_image": other.body.name},
        )
    if len(robot.legs) > 1 and robot.uncopied_pairs:
        yield from _turned_trunk(robot)


def _turned_trunk(robot: Facts) -> Violations:
    """Yield a violation if the trunk has large products of inertia with the mirrored axis."""
    trunk, normal = robot.bodies[0], robot.mirror.normal
    inertia, inertial = _inertia(trunk), trunk.main_link.inertial
    if inertia is None or inertial is None or inertial.inertia is None:
        return
    if not inertial.inertia.any():
        return  # reported by INR003
    row = inertia @ normal
    share = float(np.linalg.norm(row - (row @ normal) * normal) / trunk.principal[2])
    if share > _MAX_PRODUCT_ERROR:
        yield Violation(
            element=inertia_part(trunk.main_link),
            message=f"products of inertia of trunk {trunk.name} with the mirrored axis: got "
            f"{share:.0%} of its largest moment; expected at most {_MAX_PRODUCT_ERROR:.0%}",
            measured={"share": share},
        )


def _inertia(body: Body) -> Matrix | None:
    """Return the inertia of a body in the axes of the trunk; None if it is not physical."""
    if body.mass <= 0 or not np.isfinite(body.inertia).all() or body.principal[0] <= 0:
        return None
    rotation = body.zero_pose[:3, :3]
    return np.asarray(rotation @ body.inertia @ rotation.T)


def _has_products(inertia: Matrix) -> bool:
    products = inertia - np.diag(np.diag(inertia))
    return float(np.abs(products).max()) > _MAX_PRODUCT_ERROR / 2 * float(np.abs(inertia).max())

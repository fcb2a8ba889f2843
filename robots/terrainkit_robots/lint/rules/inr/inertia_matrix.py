"""Rules on the values of inertia matrices."""

from collections.abc import Container, Mapping

import numpy as np

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.inertia.inertial import inertia_part
from terrainkit_robots.analysis.inertia.physical import (
    MAX_INERTIA,
    MIN_INERTIA,
    is_in_range,
    is_zero,
    principal_moments,
    triangle_ratio,
)
from terrainkit_robots.analysis.inertia.placeholder import is_identity, placeholder_inertias
from terrainkit_robots.description.model import Link
from terrainkit_robots.lint.rule import Severity, Violation, Violations, rule
from terrainkit_robots.lint.rules.inr.gyration_radius import is_far_too_large
from terrainkit_robots.text import names, numbers
from terrainkit_robots.transforms import Matrix

# Of 536 published files, 33 are below it, and 7 between it and the next limit; MuJoCo rejects all
# of them (benchmarks/results/check_robot_precision.md).
_MIN_TRIANGLE_RATIO = 0.99
"""Ratio (I1 + I2) / I3 of the principal moments below which rounding cannot explain the
violation."""

# Errors of 1/2000 in I1 + I2 and in I3 change the ratio of a flat part, which is 1, by 1/1000.
_MIN_ROUNDED_RATIO = 0.999
"""The same ratio for a flat part whose moments are rounded to four digits, each with an error of at
most 1/2000."""

_MIN_EXACT_RATIO = 1 - 1e-12
"""The same ratio below which floating-point errors cannot explain the violation."""

_INERTIA_ATTRIBUTES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz", "diaginertia", "fullinertia")
"""Attributes of URDF and MJCF that hold an inertia."""


@rule("INR003", "not-positive-definite", "error", fixes="unsafe", onboarding="repairs")
def not_positive_definite(robot: Facts) -> Violations:
    """An inertia is missing, zero, or not positive definite.

    All principal moments of a rigid body are positive. If one of them is not, MuJoCo rejects the
    file; in other simulators, the rotation of the body is unstable and its state becomes NaN. The
    usual cause is that the products ixy, ixz, iyz are too large compared with ixx, iyy, izz. A zero
    inertia is allowed on a small link that is fixed to a body with an inertia. It is a warning if
    `dont_collapse` keeps such a link as a separate body.

    Fix:
        Take the six numbers from CAD, about the center of mass, in kg m2. The unsafe fix writes the
        nearest physically valid inertia, or the inertia of a solid box as large as the body.

    Source:
        MuJoCo 4.0: "inertia must have positive eigenvalues", "missing element: 'inertia'".
    """
    main = {id(body.main_link) for body in robot.bodies}
    kept = {joint.child for joint in robot.fixed_joints if joint.dont_collapse}
    for link in robot.model.links:
        if not _has_finite_mass(link) or robot.unparsed.has(link.name, *_INERTIA_ATTRIBUTES):
            continue
        assert link.inertial is not None
        inertia = link.inertial.inertia
        if inertia is None:
            if robot.model.kind != "mjcf" or _needs_inertia(robot, link, main):
                yield _missing_inertia(robot, link)
            continue
        zero, needs_inertia = is_zero(inertia), _needs_inertia(robot, link, main)
        is_kept = link.name in kept and not needs_inertia and bool(link.inertial.mass)
        if not is_in_range(inertia) or (zero and not (needs_inertia or is_kept)):
            continue
        moments = principal_moments(inertia)
        if zero or moments[0] <= MIN_INERTIA:
            yield Violation(
                element=inertia_part(link),
                severity="warning" if zero and is_kept else None,
                message=f"principal moments of link {link.name}: got "
                f"{numbers(moments, '.4g', ', ')} kg m2 "
                f"({'zero' if zero else 'not positive definite'}); expected all above 0 kg m2"
                + (", since dont_collapse keeps it as a body" if zero and is_kept else ""),
                measured=_measured(moments),
                fix=robot.inertia_repair.fix(link),
            )


def _missing_inertia(robot: Facts, link: Link) -> Violation:
    assert link.inertial is not None
    got, expected = "no <inertia>", "<inertia>"
    if robot.model.kind == "mjcf":
        got, expected = "neither diaginertia nor fullinertia", "one of them"
    elif link.inertial.inertia_source is not None:
        got = f"<inertia> without {', '.join(link.inertial.missing) or 'numbers'}"
        expected = "ixx, iyy and izz"
    return Violation(
        element=inertia_part(link),
        message=f"inertia of link {link.name} (mass {link.inertial.mass:.4g} kg): got {got}; "
        f"expected {expected}",
    )


def _needs_inertia(robot: Facts, link: Link, main: Container[int]) -> bool:
    """Return whether a link is the main link of a moving body.

    In URDF, the inertias of small parts fixed to the link do not replace its own. In MJCF, a link
    without an inertia is assumed to be part of its parent on purpose.
    """
    body = robot.body_of.get(link.name) if id(link) in main else None
    if body is None or body.virtual or body.mass <= MIN_INERTIA:
        return False
    moving = body.parent is not None or bool(robot.legs)
    return moving and (robot.model.kind != "mjcf" or float(body.principal[0]) <= MIN_INERTIA)


@rule("INR004", "triangle-inequality", "error", fixes="unsafe", onboarding="repairs")
def triangle_inequality(robot: Facts) -> Violations:
    """The principal moments violate the triangle inequality.

    The sum of the two smaller principal moments equals the largest one for a flat plate and exceeds
    it for every other body. A smaller sum means that a number was mistyped, or that the inertia was
    taken about the wrong point or in the wrong frame. MuJoCo rejects the file; in other simulators,
    the simulated body gains energy.

    Fix:
        Take the inertia from CAD about the center of mass. The unsafe fix writes the nearest
        physically valid inertia; MuJoCo's balanceinertia uses a sphere's inertia instead.

    Source:
        MuJoCo 4.0: "inertia must satisfy A + B >= C", without a tolerance. Rounding to four digits
        can reduce the ratio (A + B) / C of a flat part to 0.999. A ratio from 0.99 to 0.999 is
        therefore a warning, and a larger ratio is a note.
    """
    for link in robot.model.links:
        inertia = link.inertial.inertia if link.inertial else None
        if inertia is None or not _has_finite_mass(link) or not is_in_range(inertia):
            continue
        moments = principal_moments(inertia)
        if moments[0] <= MIN_INERTIA or triangle_ratio(moments) >= _MIN_EXACT_RATIO:
            continue
        ratio = triangle_ratio(moments)
        severity: Severity = "warning" if ratio < _MIN_ROUNDED_RATIO else "note"
        text = f"1 - {1 - ratio:.1g}" if ratio > 0.9999 else f"{ratio:.4g}"
        yield Violation(
            element=inertia_part(link),
            severity="error" if ratio < _MIN_TRIANGLE_RATIO else severity,
            message=f"principal moments of link {link.name}: got "
            f"{numbers(moments, '.4g', ', ')} kg m2 with (I1 + I2) / I3 = {text}; expected "
            "at least 1",
            measured={"ratio": ratio, **_measured(moments)},
            fix=robot.inertia_repair.fix(link),
        )


@rule("INR005", "placeholder-inertia", "warning", onboarding="blocks")
def placeholder_inertia(robot: Facts) -> Violations:
    """An inertia is the identity matrix, or the same for at least half of the links.

    A mass of 1 kg with an inertia of 1 kg m2 has a radius of gyration of 1 m. Such a link resists
    rotation like a flywheel, and gains tuned on it fail on the real robot. Identical parts, such as
    four wheels, may have the same inertia; a thigh and a shank do not. It is an error, which
    prevents onboarding, if INR006 would be one, which it replaces.

    Fix:
        Take the inertia from CAD, or compute it from the mesh at a uniform density.

    Source:
        Exporters and tutorials use the identity matrix or 0.001 as defaults.
    """
    massive = sum(body.mass > MIN_INERTIA for body in robot.bodies)
    for inertia, links in placeholder_inertias(robot.bodies):
        first = links[0]
        got, expected = "the identity matrix", "the inertia of the part"
        if not is_identity(inertia):
            got = f"the same diagonal {numbers(np.diag(inertia), '.4g', ', ')} kg m2"
            expected = "an inertia for each of these different parts"
        listed = names(link.name for link in links)
        bodies = f"{len(links)} of {massive} bodies ({listed})"
        parts = [body for body in robot.bodies if any(body.main_link is link for link in links)]
        yield Violation(
            element=inertia_part(first),
            severity="error" if any(is_far_too_large(robot, part) for part in parts) else "warning",
            message=f"inertia of {bodies if len(links) > 1 else f'body {listed}'}: got {got}; "
            f"expected {expected}",
            measured={"links": len(links)},
        )


def _has_finite_mass(link: Link) -> bool:
    mass = link.inertial.mass if link.inertial else None
    return mass is not None and 0 <= mass < MAX_INERTIA


def _measured(moments: Matrix) -> Mapping[str, float]:
    return {f"e{k}": float(moment) for k, moment in enumerate(moments)}

"""Rules on inertias that do not fit the size of the body."""

from collections.abc import Iterator
from dataclasses import replace

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.bounds import half_diagonal
from terrainkit_robots.analysis.facts import Facts, cached_fact
from terrainkit_robots.analysis.inertia.inertial import (
    because_of,
    bodies_with_mass,
    inertia_part,
    main_cause,
    max_inertia,
)
from terrainkit_robots.analysis.inertia.physical import (
    MAX_INERTIA,
    MIN_INERTIA,
    gyration_radius,
    is_in_range,
)
from terrainkit_robots.analysis.inertia.placeholder import placeholder_inertias
from terrainkit_robots.analysis.simulator_conventions.fixed_joints import kept_bodies
from terrainkit_robots.export.canonical import has_floating_base
from terrainkit_robots.lint.rule import Severity, Violation, Violations, findings_of, rule
from terrainkit_robots.transforms import Matrix

# Of 536 published files, 58 exceed the first limit, all with real defects, and 38 the second, 6 of
# them on purpose (benchmarks/results/check_robot_precision.md).
_MAX_GYRATION, _MAX_GYRATION_ERROR = 1.05, 3.0
"""Radius of gyration divided by half the diagonal of the body: limits of the warning and the error.
Mass inside a box cannot exceed 1; the margin is for shapes that omit a small part of the body."""

_MIN_GYRATION = 0.05
"""The same ratio for a body that is nearly a point mass. Solid parts have 0.3 to 0.6; a heavy motor
in a light shell five times as long has 0.1."""

_MIN_KEPT_MASS = 0.01
"""Mass of a link that dont_collapse keeps as a body, below which it is a placeholder [kg]. The
published Go2 has a head of 1 g."""


@rule(
    "INR006",
    "inertia-too-large",
    "warning",
    needs=("mass-unit", "length-unit", "inertia-unit"),
    onboarding="blocks",
)
def inertia_too_large(robot: Facts) -> Violations:
    """An inertia is larger than the size of the body allows.

    Mass inside a body is at most half the body's diagonal away from its center, which limits the
    radius of gyration sqrt(I / m). A larger value is usually a wrong unit (g mm2) or a wrong
    reference point (the origin of the robot). The joint then moves an inertia that the real robot
    does not have. It is a note for a base that is fixed to the ground.

    Fix:
        Give the inertia in kg m2 about the center of mass, and the mass in kg.

    Source:
        I <= m r^2 if all mass is within r of the center of mass. A ratio above 3 is an
        error, which prevents onboarding; it occurs in a published UR5 (wrists) and Baxter
        (fingers), whose values belong to other parts or have other units.
    """
    for link in robot.model.links:
        inertia = max_inertia(link)
        if inertia >= MAX_INERTIA:
            yield Violation(
                element=inertia_part(link),
                severity="error",
                message=f"inertia of link {link.name}: got {inertia:.3g} kg m2; expected less than "
                f"{MAX_INERTIA:.0e} kg m2",
                measured={"inertia": inertia},
            )
    candidates = list(oversized_bodies(robot))
    reported = _invalid_bodies(robot) if candidates else set()
    for body, radius, box in candidates:
        if body.name not in reported:
            is_error = radius > _MAX_GYRATION_ERROR * half_diagonal(box)
            is_fixed = body.index == 0 and not has_floating_base(robot)
            severity: Severity = "note" if is_fixed else "error" if is_error else "warning"
            limit = f"at most {_MAX_GYRATION:g}"
            yield _report_radius(body, radius, box, limit, severity)


def oversized_bodies(robot: Facts) -> Iterator[tuple[Body, float, Matrix]]:
    """Yield the bodies with too large a radius of gyration: the radius [m], and the box [m]."""
    body_bounds = robot.body_bounds
    for body, radius in _body_radii(robot):

        def is_invalid(box: Matrix, radius: float = radius) -> bool:
            return radius > _MAX_GYRATION * half_diagonal(box)

        box = body_bounds.box_if(body, is_invalid)
        if box is not None:
            yield body, radius, box
        for part, radius in _kept_radii(robot, body):

            def needs_mesh(length: float, radius: float = radius) -> bool:
                return radius > _MAX_GYRATION * length

            box = body_bounds.shape_box(part, needs_mesh)
            if box is not None and radius > _MAX_GYRATION * half_diagonal(box):
                yield part, radius, box


@rule("INR007", "inertia-too-small", "warning", needs=("mass-unit", "length-unit", "inertia-unit"))
def inertia_too_small(robot: Facts) -> Violations:
    """An inertia is much smaller than the size of the body suggests.

    The radius of gyration is below 5 % of half the body's diagonal, as if the body were a point
    mass. Small torques then cause large accelerations: the simulation becomes stiff or unstable,
    and the torques that a policy learns are too small for the real robot. The usual
    causes are wrong units and placeholders.

    Fix:
        Give the inertia in kg m2 about the center of mass, and the mass in kg.

    Source:
        The ratio is 0.58 for a rod, 0.47 for a cube, and 0.36 for a sphere.
    """
    body_bounds = robot.body_bounds
    candidates = []
    for whole, _ in _body_radii(robot):
        index = next(k for k, link in enumerate(whole.links) if link.name == whole.name)
        part = slice(index, index + 1)
        main = replace(whole, links=whole.links[part], poses=whole.poses[part])
        kept = (body for body, _ in _kept_radii(robot, whole))
        for body in (whole, main, *kept):
            radius = gyration_radius(body.principal, body.mass)

            def needs_mesh(length: float, radius: float = radius) -> bool:
                return radius < _MIN_GYRATION * length

            box = body_bounds.shape_box(body, needs_mesh) if radius > 0 else None
            if box is not None and radius < _MIN_GYRATION * half_diagonal(box):
                candidates.append((body, radius, box))
                break
    reported = _invalid_bodies(robot) if candidates else set()
    for body, radius, box in candidates:
        if body.name not in reported:
            limit = f"at least {_MIN_GYRATION:g}"
            yield _report_radius(body, radius, box, limit, "warning")


def is_far_too_large(robot: Facts, body: Body) -> bool:
    """Return whether the inertia of a body is an error, for rules on why it is too large."""
    radius = gyration_radius(body.principal, body.mass)
    invalid = robot.body_bounds.box_if(
        body, lambda box: radius > _MAX_GYRATION_ERROR * half_diagonal(box)
    )
    return invalid is not None and (body.index > 0 or has_floating_base(robot))


def _report_radius(
    body: Body, radius: float, box: Matrix, limit: str, severity: Severity
) -> Violation:
    half = half_diagonal(box)
    cause = main_cause(body)
    return Violation(
        element=inertia_part(cause),
        severity=severity,
        message=f"radius of gyration of body {body.name}: got {radius:.3g} m (mass "
        f"{body.mass:.4g} kg, largest principal moment {body.principal[2]:.3g} kg m2); expected "
        f"{limit} times half the diagonal of the body, which is {half:.3g} m"
        + because_of(cause, body),
        measured={"radius": radius, "half_diagonal": half},
    )


@cached_fact
def _invalid_bodies(robot: Facts) -> set[str]:
    """Return the bodies whose mass or inertia is reported by another rule."""
    reported = {link.name for _, links in placeholder_inertias(robot.bodies) for link in links}
    reported |= {f.subject for f in findings_of(robot, "INR003", "INR004") if f.severity == "error"}
    return reported | {finding.subject for finding in findings_of(robot, "INR010", "INR008")}


def _kept_radii(robot: Facts, body: Body) -> Iterator[tuple[Body, float]]:
    """Yield the parts of a body that stay bodies, and their radii of gyration [m]."""
    for part in bodies_with_mass(kept_bodies(robot.tree, body)):
        if part.mass >= _MIN_KEPT_MASS and part.principal[0] > MIN_INERTIA:
            yield part, gyration_radius(part.principal, part.mass)


def _body_radii(robot: Facts) -> Iterator[tuple[Body, float]]:
    """Yield each body with a valid inertia, and its radius of gyration [m]."""
    for body in bodies_with_mass(robot.bodies):
        main = body.main_link.inertial
        if main is None or main.inertia is None or not is_in_range(main.inertia):
            continue
        if body.principal[0] > MIN_INERTIA:
            yield body, gyration_radius(body.principal, body.mass)

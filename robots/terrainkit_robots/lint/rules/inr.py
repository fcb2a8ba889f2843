"""Rules on masses and inertias (INR)."""

from collections.abc import Container, Iterator, Mapping
from dataclasses import replace

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.bounds import half_diagonal
from terrainkit_robots.analysis.bodies.link_source import inertia_source, mass_source
from terrainkit_robots.analysis.cached_fact import cached_fact
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.inertia.density import (
    check_max_density,
    check_min_density,
    has_derived_mass,
    shape_volume,
)
from terrainkit_robots.analysis.inertia.physical import (
    MAX_INERTIA,
    MIN_INERTIA,
    gyration_radius,
    is_in_range,
    is_zero,
    principal_moments,
    triangle_ratio,
)
from terrainkit_robots.analysis.inertia.placeholder import is_identity, placeholder_inertias
from terrainkit_robots.description.model import Link
from terrainkit_robots.description.xml.unparsed import UnparsedNumbers
from terrainkit_robots.export.canonical import has_floating_base
from terrainkit_robots.lint.rule import Severity, Violation, rule
from terrainkit_robots.text import contrast, names
from terrainkit_robots.transforms import Matrix

_MIN_TRIANGLE_RATIO = 0.99
"""Ratio (I1 + I2) / I3 of the principal moments below which rounding cannot explain the
violation."""

_MIN_ROUNDED_RATIO = 0.999
"""The same ratio for a flat part whose moments are rounded to four digits, each with an error of at
most 1/2000."""

_MIN_EXACT_RATIO = 1 - 1e-12
"""The same ratio below which floating-point errors cannot explain the violation."""

_MAX_GYRATION, _MAX_GYRATION_ERROR = 1.05, 3.0
"""Radius of gyration divided by half the diagonal of the body: limits of the warning and the error.
Mass inside a box cannot exceed 1; the margin is for shapes that omit a small part of the body."""

_MIN_GYRATION = 0.05
"""The same ratio for a body that is nearly a point mass. Solid parts have 0.3 to 0.6; a heavy motor
in a light shell five times as long has 0.1."""

_COM_SHARE, _COM_MARGIN, _COM_ERROR = 0.10, 0.005, 3.0
"""Allowed distance of a center of mass from the bounding box of its body: a fraction of the
diagonal plus a margin [m]. The last value is the multiple of that distance that is an error."""

_MAX_MASS_RATIO = 1000.0
"""Mass ratio of neighboring bodies above which solvers become stiff at common time steps, such as
10 kg on 10 g."""

_MAX_INFERRED, _MAX_INFERRED_ERROR = 0.01, 0.05
"""Inferred mass divided by the declared mass: limits of the warning and the error."""

_DEFAULT_DENSITY = 1000.0
"""Density that MuJoCo assigns to the collision shapes of links without <inertial> [kg/m3]."""

_INERTIA_ATTRIBUTES = (
    "ixx",
    "ixy",
    "ixz",
    "iyy",
    "iyz",
    "izz",
    "diaginertia",
    "fullinertia",
)
"""Attributes of URDF and MJCF that hold an inertia."""


@rule("INR001", "massless-body", "error")
def massless_body(robot: Facts) -> Iterator[Violation]:
    """A moving body has no mass.

    The acceleration of a body without mass is undefined. MuJoCo rejects the file, PhysX assigns a
    default mass, and other simulators divide by zero. A massless link that is fixed to a body with
    mass is part of that body: this is a note if the link is only a frame, and a warning if it has
    shapes or an inertia. A fixed base never moves and needs no mass.

    Fix:
        Give the body a mass and an inertia, make the joint above it fixed, or remove the link if
        it only separates two joints. An <inertial> needs both <mass> and <inertia>.

    Source:
        MuJoCo 4.0: "mass and inertia of moving bodies must be larger than mjMINVAL", and
        "missing element: 'mass'".
    """
    unparsed = UnparsedNumbers(robot.model)
    for link in robot.model.links:
        inertial = link.inertial
        if inertial and inertial.mass is None and not unparsed.has(link.name, "value", "mass"):
            yield Violation(
                subject=link.name,
                source=inertial.source,
                message=f"<inertial> of link {link.name}: got no <mass>; expected <mass> and "
                "<inertia>",
            )
    trunk = {link.name for body in robot.bodies[:1] for link in body.links}
    floating = any(j.kind == "floating" and j.child in trunk for j in robot.model.joints)
    for body in robot.bodies:
        if body.virtual or not _has_valid_mass(body) or body.mass > MIN_INERTIA:
            continue
        if body.parent is not None or robot.legs or floating:
            declared = [link for link in body.links if link.inertial is not None]
            mass = f"{body.mass:.3g} kg" if declared else "no <inertial> on any of its links"
            parent = f"joint {body.joint.name} moves it" if body.joint else "it is the trunk"
            yield Violation(
                subject=body.name,
                source=mass_source(declared[0]) if declared else body.top.source,
                message=f"mass of body {body.name} ({parent}): got {mass}; expected more than 0 kg",
                measured={"mass": body.mass},
            )
    yield from _links_without_mass(robot)


def _links_without_mass(robot: Facts) -> Iterator[Violation]:
    """Yield violations of massless links that are fixed to a body with mass."""
    massless = [
        (link, _max_inertia(link))
        for body in robot.bodies
        if body.mass > MIN_INERTIA
        for link in body.links
        if link.inertial is not None and link.inertial.mass == 0
    ]
    for link, inertia in massless:
        if inertia > MIN_INERTIA:
            yield Violation(
                subject=link.name,
                source=mass_source(link),
                severity="warning",
                message=f"mass of link {link.name}: got 0 kg with an inertia of up to "
                f"{inertia:.3g} kg m2; expected a mass above 0 kg, or no inertia",
                measured={"mass": 0.0, "inertia": inertia},
            )
    links = [link for link, inertia in massless if inertia <= MIN_INERTIA]
    # A frame has no mass on purpose; the mass of a link with shapes was probably forgotten.
    parts = [link for link in links if link.visuals or link.collisions]
    frames = [link for link in links if link not in parts]
    groups: tuple[tuple[list[Link], Severity], ...] = ((parts, "warning"), (frames, "info"))
    for group, severity in groups:
        if group:
            yield Violation(
                subject=group[0].name,
                source=mass_source(group[0]),
                severity=severity,
                message=f"mass of {names(link.name for link in group)}: got 0 kg; simulators that "
                "do not merge fixed joints reject or replace it",
                measured={"links": len(group)},
            )


def _max_inertia(link: Link) -> float:
    """Return the largest absolute element of an inertia [kg m2]; 0 if there is none."""
    inertia = link.inertial.inertia if link.inertial else None
    return 0.0 if inertia is None else float(np.abs(inertia).max())


def _has_valid_mass(body: Body) -> bool:
    """Return whether all masses of the body are declared, nonnegative and below the limit."""
    masses = [link.inertial.mass for link in body.links if link.inertial is not None]
    return all(mass is not None and 0 <= mass < MAX_INERTIA for mass in masses)


@rule("INR002", "negative-mass", "error")
def negative_mass(robot: Facts) -> Iterator[Violation]:
    """A mass is negative.

    A negative mass reduces the mass of the body that the link is fixed to. MuJoCo silently ignores
    it if the link is merged into another one, and rejects the file otherwise.

    Fix:
        Enter the mass of the part.

    Source:
        Tested with MuJoCo 4.0; see also INR001.
    """
    for link in robot.model.links:
        mass = link.inertial.mass if link.inertial else None
        if mass is not None and mass < 0:
            yield Violation(
                subject=link.name,
                source=mass_source(link),
                message=f"mass of link {link.name}: got {mass:.6g} kg; expected 0 kg or more",
                measured={"mass": mass},
            )


@rule("INR003", "not-positive-definite", "error", fixes="unsafe")
def not_positive_definite(robot: Facts) -> Iterator[Violation]:
    """An inertia is missing, zero, or not positive definite.

    All principal moments of a rigid body are positive. If one of them is not, MuJoCo rejects the
    file; in other simulators, the rotation of the body is unstable and its state becomes NaN. The
    usual cause is that the products ixy, ixz, iyz are too large compared with ixx, iyy, izz. A zero
    inertia is allowed on a small link that is fixed to a body with an inertia.

    Fix:
        Take the six numbers from CAD, about the center of mass, in kg m2. The unsafe fix writes the
        nearest physically valid inertia, or that of a solid box of the size of the body.

    Source:
        MuJoCo 4.0: "inertia must have positive eigenvalues", "missing element: 'inertia'".
    """
    unparsed = UnparsedNumbers(robot.model)
    main = {id(body.main_link) for body in robot.bodies}
    for link in robot.model.links:
        if not _has_finite_mass(link) or unparsed.has(link.name, *_INERTIA_ATTRIBUTES):
            continue
        assert link.inertial is not None
        inertia = link.inertial.inertia
        if inertia is None:
            if robot.model.kind != "mjcf" or _needs_inertia(robot, link, main):
                yield _missing_inertia(robot, link)
            continue
        zero = is_zero(inertia)
        if not is_in_range(inertia) or (zero and not _needs_inertia(robot, link, main)):
            continue
        moments = principal_moments(inertia)
        if zero or moments[0] <= MIN_INERTIA:
            yield Violation(
                subject=link.name,
                source=inertia_source(link),
                message=f"principal moments of link {link.name}: got {_format(moments)} kg m2 "
                f"({'zero' if zero else 'not positive definite'}); expected all above 0 kg m2",
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
        subject=link.name,
        source=inertia_source(link),
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


@rule("INR004", "triangle-inequality", "error", fixes="unsafe")
def triangle_inequality(robot: Facts) -> Iterator[Violation]:
    """The principal moments violate the triangle inequality.

    The sum of the two smaller principal moments equals the largest one for a flat plate and exceeds
    it for every other body. A smaller sum means that a number was mistyped, or that the inertia was
    taken about the wrong point or in the wrong frame. MuJoCo rejects the file; in other simulators,
    the simulated body gains energy.

    Fix:
        Take the inertia from CAD about the center of mass. The unsafe fix writes the nearest
        physically valid inertia; MuJoCo's balanceinertia uses that of a sphere instead.

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
        severity: Severity = "warning" if ratio < _MIN_ROUNDED_RATIO else "info"
        text = f"1 - {1 - ratio:.1g}" if ratio > 0.9999 else f"{ratio:.4g}"
        yield Violation(
            subject=link.name,
            source=inertia_source(link),
            severity="error" if ratio < _MIN_TRIANGLE_RATIO else severity,
            message=f"principal moments of link {link.name}: got {_format(moments)} kg m2 with "
            f"(I1 + I2) / I3 = {text}; expected at least 1",
            measured={"ratio": ratio, **_measured(moments)},
            fix=robot.inertia_repair.fix(link),
        )


@rule("INR005", "placeholder-inertia", "warning")
def placeholder_inertia(robot: Facts) -> Iterator[Violation]:
    """An inertia is the identity matrix, or the same for at least half of the links.

    A mass of 1 kg with an inertia of 1 kg m2 has a radius of gyration of 1 m. Such a link resists
    rotation like a flywheel, and gains tuned on it fail on the real robot. Identical parts, such as
    four wheels, may have the same inertia; a thigh and a shank do not.

    Fix:
        Take the inertia from CAD, or compute it from the mesh at a uniform density.

    Source:
        Exporters and tutorials use the identity matrix or 0.001 as defaults.
    """
    massive = sum(body.mass > MIN_INERTIA for body in robot.bodies)
    for links in placeholder_inertias(robot.bodies):
        first = links[0]
        assert first.inertial is not None
        assert first.inertial.inertia is not None
        got, expected = "the identity matrix", "the inertia of the part"
        if not is_identity(first):
            got = f"the same diagonal {_format(np.diag(first.inertial.inertia))} kg m2"
            expected = "an inertia for each of these different parts"
        listed = names(link.name for link in links)
        bodies = f"{len(links)} of {massive} bodies ({listed})"
        yield Violation(
            subject=first.name,
            source=inertia_source(first),
            message=f"inertia of {bodies if len(links) > 1 else f'body {listed}'}: got {got}; "
            f"expected {expected}",
            measured={"links": len(links)},
        )


@rule("INR006", "inertia-too-large", "warning")
def inertia_too_large(robot: Facts) -> Iterator[Violation]:
    """An inertia is larger than the size of the body allows.

    Mass inside a body is at most half the body's diagonal away from its center, which limits the
    radius of gyration sqrt(I / m). A larger value is usually a wrong unit (g mm2) or a wrong
    reference point (the origin of the robot). The joint then moves an inertia that the real robot
    does not have. It is a note for a base that is fixed to the ground.

    Fix:
        Give the inertia in kg m2 about the center of mass, and the mass in kg.

    Source:
        I <= m r^2 if all mass is within r of the center of mass. A ratio above 3 is an error; it
        occurs in a published UR5 (wrists) and Baxter (fingers), whose values are those of other
        parts or in other units.
    """
    for link in robot.model.links:
        inertia = _max_inertia(link)
        if inertia >= MAX_INERTIA:
            yield Violation(
                subject=link.name,
                source=inertia_source(link),
                severity="error",
                message=f"inertia of link {link.name}: got {inertia:.3g} kg m2; expected less than "
                f"{MAX_INERTIA:.0e} kg m2",
                measured={"inertia": inertia},
            )
    body_bounds, candidates = robot.body_bounds, []
    for body, radius in _body_radii(robot):

        def is_invalid(box: Matrix, radius: float = radius) -> bool:
            return radius > _MAX_GYRATION * half_diagonal(box)

        box = body_bounds.box_if(body, is_invalid)
        if box is not None:
            candidates.append((body, radius, box))
    reported = _invalid_bodies(robot) if candidates else set()
    for body, radius, box in candidates:
        if body.name not in reported:
            is_error = radius > _MAX_GYRATION_ERROR * half_diagonal(box)
            is_fixed = body.index == 0 and not has_floating_base(robot)
            severity: Severity = "info" if is_fixed else "error" if is_error else "warning"
            limit = f"at most {_MAX_GYRATION:g}"
            yield _report_radius(body, radius, box, limit, severity)


@rule("INR007", "inertia-too-small", "warning")
def inertia_too_small(robot: Facts) -> Iterator[Violation]:
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
    body_bounds, candidates = robot.body_bounds, []
    for whole, _ in _body_radii(robot):
        index = next(k for k, link in enumerate(whole.links) if link.name == whole.name)
        part = slice(index, index + 1)
        main = replace(whole, links=whole.links[part], poses=whole.poses[part])
        for body in (whole, main):
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


def _report_radius(
    body: Body, radius: float, box: Matrix, limit: str, severity: Severity
) -> Violation:
    half = half_diagonal(box)
    return Violation(
        subject=body.name,
        source=inertia_source(body.main_link),
        severity=severity,
        message=f"radius of gyration of body {body.name}: got {radius:.3g} m (mass "
        f"{body.mass:.4g} kg, largest principal moment {body.principal[2]:.3g} kg m2); expected "
        f"{limit} times half the diagonal of the body, which is {half:.3g} m",
        measured={"radius": radius, "half_diagonal": half},
    )


@cached_fact
def _invalid_bodies(robot: Facts) -> set[str]:
    """Return the bodies whose mass or inertia is reported by another rule."""
    reported = {link.name for links in placeholder_inertias(robot.bodies) for link in links}
    for check in (not_positive_definite, triangle_inequality):
        reported |= {v.subject for v in check(robot) if v.severity in (None, "error")}
    for check in (implausible_density, com_outside_body):
        reported |= {violation.subject for violation in check(robot)}
    return reported


def _body_radii(robot: Facts) -> Iterator[tuple[Body, float]]:
    """Yield each body with a valid inertia, and its radius of gyration [m]."""
    for body in robot.bodies:
        if body.virtual or not _has_valid_mass(body) or body.mass <= MIN_INERTIA:
            continue
        main = body.main_link.inertial
        if main is None or main.inertia is None or not is_in_range(main.inertia):
            continue
        if body.principal[0] > MIN_INERTIA:
            yield body, gyration_radius(body.principal, body.mass)


@rule("INR008", "com-outside-body", "warning")
def com_outside_body(robot: Facts) -> Iterator[Violation]:
    """A center of mass lies outside of its body.

    The origin of an <inertial> is given in the frame of its link. If it was given in the frame of
    the robot or the CAD file, in millimeters, or with the sign of the part on the other side, the
    simulated robot tips over or needs torques that the real one does not need.

    Fix:
        Give the center of mass in the frame of the link, in meters.

    Source:
        The center of mass of a convex body lies inside it. The margin of 10 % of the diagonal is
        for shapes that omit parts of the body; three times the margin is an error.
    """
    body_bounds = robot.body_bounds
    for body in robot.bodies:
        if body.virtual or not _has_valid_mass(body) or body.mass <= MIN_INERTIA:
            continue

        def is_invalid(box: Matrix, center: Matrix = body.center) -> bool:
            return _distance(center, box) > _max_distance(box)

        box = body_bounds.box_if(body, is_invalid)
        if box is None:
            continue
        distance, limit = _distance(body.center, box), _max_distance(box)
        got, expected = contrast(distance, limit, ".3g")
        yield Violation(
            subject=body.name,
            source=mass_source(body.main_link),
            severity="error" if distance > _COM_ERROR * limit else "warning",
            message=f"center of mass of body {body.name}: got {got} m outside of the "
            f"bounding box, whose diagonal is {2 * half_diagonal(box):.3g} m; expected at most "
            f"{expected} m",
            measured={"outside": distance, "allowed": limit},
        )


def _distance(point: Matrix, box: Matrix) -> float:
    """Return the distance of a point from a box [m]; 0 inside."""
    return float(np.linalg.norm(np.maximum(0, np.maximum(box[0] - point, point - box[1]))))


def _max_distance(box: Matrix) -> float:
    return _COM_SHARE * 2 * half_diagonal(box) + _COM_MARGIN


@rule("INR009", "mass-ratio", "warning")
def mass_ratio(robot: Facts) -> Iterator[Violation]:
    """The masses of neighboring bodies differ by more than a factor of 1000.

    The joint between them is numerically stiff: it needs a much smaller time step, or the light
    body becomes unstable. In PhysX, the two bodies drift apart.

    Fix:
        Merge the light body into its neighbor, or give it its real mass and an armature.

    Source:
        The guides of PhysX and Bullet recommend ratios below 10 to 100.
    """
    candidates = []
    for body in robot.bodies:
        parent = robot.physical_parent(body)
        if body.virtual or parent is None:
            continue
        if not (_has_valid_mass(body) and _has_valid_mass(parent)):
            continue
        light, heavy = sorted((body, parent), key=lambda b: b.mass)
        if light.mass > MIN_INERTIA and heavy.mass > _MAX_MASS_RATIO * light.mass:
            candidates.append((light, heavy))
    reported = {v.subject for v in implausible_density(robot)} if candidates else set()
    for light, heavy in candidates:
        if reported & {light.name, heavy.name}:
            continue
        ratio = heavy.mass / light.mass
        yield Violation(
            subject=light.name,
            source=mass_source(light.main_link),
            message=f"mass ratio of {heavy.name} ({heavy.mass:.4g} kg) and its neighbor "
            f"{light.name} ({light.mass:.3g} kg): got "
            f"{contrast(ratio, _MAX_MASS_RATIO, '.0f')[0]}; expected at most {_MAX_MASS_RATIO:.0f}",
            measured={"ratio": ratio, "mass": light.mass, "neighbor": heavy.mass},
        )


@rule("INR010", "implausible-density", "warning")
def implausible_density(robot: Facts) -> Iterator[Violation]:
    """A mass is implausible for the size of its body.

    No part of a robot is lighter than packing foam or denser than gold. Common causes are a mass in
    grams or pounds, a shifted decimal point, or a mesh in millimeters.

    Fix:
        Give the mass in kg, and check the scale of the shapes.

    Source:
        Densities: foam 10 to 30 kg/m3, aluminum 2700, steel 7850, gold 19,300. The upper limit is
        applied to the bounding box of all shapes, the lower limit to the largest shape.
    """
    for link in robot.model.links:
        mass = link.inertial.mass if link.inertial else None
        if mass is not None and mass >= MAX_INERTIA:
            yield Violation(
                subject=link.name,
                source=mass_source(link),
                severity="error",
                message=f"mass of link {link.name}: got {mass:.3g} kg; expected less than "
                f"{MAX_INERTIA:.0e} kg",
                measured={"mass": mass},
            )
    body_bounds = robot.body_bounds
    for body in robot.bodies:
        if (
            body.virtual
            or not _has_valid_mass(body)
            or body.mass <= MIN_INERTIA
            or has_derived_mass(body)
        ):
            continue
        result = check_max_density(body, body_bounds) or check_min_density(
            body, body_bounds, robot.meshes
        )
        if result:
            volume, limit = result
            density = body.mass / volume
            got, expected = ("at least", "at most") if density > limit else ("at most", "at least")
            yield Violation(
                subject=body.name,
                source=mass_source(body.main_link),
                message=f"density of body {body.name}: got {got} {density:.3g} kg/m3 "
                f"({body.mass:.3g} kg in {volume:.3g} m3); expected {expected} {limit:,.0f} kg/m3",
                measured={"mass": body.mass, "volume": volume, "density": density},
            )


@rule("INR011", "inferred-mass", "warning")
def inferred_mass(robot: Facts) -> Iterator[Violation]:
    """A simulator adds mass for links without an <inertial>.

    MuJoCo infers the mass of a link with collision shapes but without <inertial> from the volume of
    the shapes and the density of water; overlapping shapes count twice. Other simulators do the
    same or treat the link as massless, so the mass of the robot depends on the simulator.

    Fix:
        Give each of these links an <inertial> with its mass, or move its collision shapes to
        the link that it is fixed to.

    Source:
        Tested with MuJoCo 4.0: a fixed link with a box of 1 m3 adds 1000 kg.
    """
    if robot.model.kind == "mjcf" or robot.total_mass <= MIN_INERTIA:
        return
    inferred = {
        link: _DEFAULT_DENSITY * sum(shape_volume(shape, robot.meshes) for shape in link.collisions)
        for body in robot.bodies
        if body.mass > MIN_INERTIA
        for link in body.links
        if link.inertial is None
    }
    total = sum(inferred.values())
    share = total / robot.total_mass
    if share <= _MAX_INFERRED:
        return
    links = sorted((link for link in inferred if inferred[link] > 0), key=lambda x: -inferred[x])
    yield Violation(
        subject=links[0].name,
        source=links[0].source,
        severity="error" if share > _MAX_INFERRED_ERROR else "warning",
        message=f"mass that MuJoCo infers for links without <inertial> "
        f"({names(link.name for link in links)}): got {total:.3g} kg, {share:.1%} of the declared "
        f"{robot.total_mass:.4g} kg; expected at most {_MAX_INFERRED:.0%}",
        measured={"added": total, "declared": robot.total_mass, "share": share},
    )


def _has_finite_mass(link: Link) -> bool:
    mass = link.inertial.mass if link.inertial else None
    return mass is not None and 0 <= mass < MAX_INERTIA


def _format(moments: Matrix) -> str:
    return ", ".join(f"{moment:.4g}" for moment in moments)


def _measured(moments: Matrix) -> Mapping[str, float]:
    return {f"e{k}": float(moment) for k, moment in enumerate(moments)}

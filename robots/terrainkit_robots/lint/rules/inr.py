"""INR: masses and inertias."""

from collections.abc import Container, Iterator, Mapping
from dataclasses import replace

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.bounds import extents_of, half_diagonal
from terrainkit_robots.analysis.bodies.main_link import inertia_source, main_link, mass_source
from terrainkit_robots.analysis.cached_fact import per_robot
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.inertia.density import (
    is_derived,
    too_dense,
    too_light,
    volume_of,
)
from terrainkit_robots.analysis.inertia.physical import (
    LARGEST,
    NOTHING,
    gyration_radius,
    in_reach,
    is_zero,
    principal_moments,
    triangle_ratio,
)
from terrainkit_robots.analysis.inertia.placeholder import is_identity, placeholders
from terrainkit_robots.analysis.inertia.repair import repair
from terrainkit_robots.description.model import Inertial, Link
from terrainkit_robots.description.xml.unparsed import Unread
from terrainkit_robots.lint.rule import Severity, Violation, rule
from terrainkit_robots.text import names
from terrainkit_robots.transforms import Matrix

_IMPOSSIBLE = 0.99
"""Ratio (e0 + e1) / e2 below which no rounding explains that a body cannot exist."""

_ROUNDED = 0.999
"""Ratio (e0 + e1) / e2 that a flat part can get from numbers rounded to four digits: at worst
1/2000 off in e2, and as much in e0 + e1."""

_EXACT = 1 - 1e-12
"""Ratio (e0 + e1) / e2 below which it is not this program's own rounding."""

_SPREAD, _SPREAD_FAR = 1.05, 3.0
"""Radius of gyration over the half diagonal of a body. Nothing inside a box can exceed 1; the rest
is for shapes that leave out a little of the body."""

_CONCENTRATED = 0.05
"""The same ratio below which a body would be a point: solid parts have 0.3 to 0.6, and a heavy
motor in a light shell that is five times as long has 0.1."""

_ASIDE, _SLACK, _ASIDE_FAR = 0.10, 0.005, 3.0
"""How far a centre of mass may be outside the box around a body: a share of the box's diagonal
plus some metres; and how many times that is an error."""

_RATIO = 1000.0
"""Mass ratio of neighbours from which solvers at usual time steps get stiff: 10 kg on 10 g."""

_DRIFT, _DRIFT_FAR = 0.01, 0.05
"""Share of the declared mass that a simulator may add before it matters."""

_DENSITY = 1000.0
"""Density that MuJoCo gives to collision shapes of links without an <inertial> [kg/m3]."""


@rule("INR001", "massless-body", "error")
def massless_body(robot: Facts) -> Iterator[Violation]:
    """A body that a joint moves has no mass.

    A force on nothing has no finite answer. MuJoCo refuses the file, PhysX puts a mass of its own
    in, others divide by zero. Links that are fixed to a body with mass are part of it and need
    none, which is only told as information; and a fixed base may go without, as it never moves.

    Fix:
        Give the body its mass and inertia, or make the joint above it fixed, or take a link away
        that only stands between two joints. An <inertial> needs both <mass> and <inertia>.

    Source:
        MuJoCo 4.0: "mass and inertia of moving bodies must be larger than mjMINVAL", and
        "missing element: 'mass'".
    """
    unread = Unread(robot.model)
    for link in robot.model.links:
        if (
            link.inertial
            and link.inertial.mass is None
            and not unread.has(link.name, "value", "mass")
        ):
            yield Violation(
                subject=link.name,
                source=link.inertial.source,
                message=f"link {link.name} has an <inertial> without a mass; wanted both or none",
            )
    for body in robot.bodies:
        if body.virtual or _mass_unknown(body) or body.mass > NOTHING:
            continue
        if body.parent is not None or robot.legs or _floats(robot):
            yield _massless(body)
    yield from _empty_links(robot)


def _empty_links(robot: Facts) -> Iterator[Violation]:
    """Yield what is to be said of links without mass that are parts of bodies with mass."""
    empty = [
        link
        for body in robot.bodies
        if body.mass > NOTHING
        for link in body.links
        if link.inertial is not None and link.inertial.mass == 0
    ]
    yield from (_mass_missing(link) for link in empty if _inertia_of(link) > NOTHING)
    empty = [link for link in empty if _inertia_of(link) <= NOTHING]
    # A frame weighs nothing; of a part that is drawn it was forgotten.
    parts = [link for link in empty if link.visuals or link.collisions]
    frames = [link for link in empty if link not in parts]
    told: tuple[tuple[list[Link], Severity], ...] = ((parts, "warning"), (frames, "info"))
    for links, severity in told:
        if links:
            yield Violation(
                subject=links[0].name,
                source=mass_source(links[0]),
                severity=severity,
                message=f"the mass of {names(link.name for link in links)} is 0 kg; that is fine "
                "where fixed joints are merged, and refused or replaced by simulators that keep "
                "such links as bodies",
                measured={"links": len(links)},
            )


def _inertia_of(link: Link) -> float:
    """Return the largest number of an inertia [kg m2]; 0 without one."""
    inertia = link.inertial.inertia if link.inertial else None
    return 0.0 if inertia is None else float(np.abs(inertia).max())


def _mass_missing(link: Link) -> Violation:
    return Violation(
        subject=link.name,
        source=mass_source(link),
        severity="warning",
        message=f"link {link.name} has a mass of 0 kg, but an inertia of up to "
        f"{_inertia_of(link):.3g} kg m2; wanted a mass, too, or no inertia",
        measured={"mass": 0.0, "inertia": _inertia_of(link)},
    )


def _massless(body: Body) -> Violation:
    declared = [link for link in body.links if link.inertial is not None]
    what = f"body {body.name} has a mass of {body.mass:.3g} kg"
    if not declared:
        what = f"body {body.name} has no mass: no link of it has an <inertial>"
    mover = f"joint {body.joint.name} moves it" if body.joint else "it is the trunk"
    return Violation(
        subject=body.name,
        source=mass_source(declared[0]) if declared else body.top.source,
        message=f"{what}, and {mover}; wanted a mass above 0",
        measured={"mass": body.mass},
    )


def _mass_unknown(body: Body) -> bool:
    """Return whether a mass of the body is missing, negative or beyond reckoning."""
    masses = [link.inertial.mass for link in body.links if link.inertial is not None]
    return any(mass is None or not 0 <= mass < LARGEST for mass in masses)


def _floats(robot: Facts) -> bool:
    """Return whether a joint of the file sets the trunk free."""
    trunk = {link.name for link in robot.bodies[0].links}
    return any(j.kind == "floating" and j.child in trunk for j in robot.model.joints)


@rule("INR002", "negative-mass", "error")
def negative_mass(robot: Facts) -> Iterator[Violation]:
    """A mass is negative.

    It falls up, and takes from the mass of what it is fixed to. MuJoCo skips it without a word
    where the link is merged into another, and refuses the file where it is not.

    Fix:
        Write the mass that the part has.

    Source:
        MuJoCo 4.0, tried; see also INR001.
    """
    for link in robot.model.links:
        mass = link.inertial.mass if link.inertial else None
        if mass is not None and mass < 0:
            yield Violation(
                subject=link.name,
                source=mass_source(link),
                message=f"the mass of link {link.name} is {mass:.6g} kg; wanted 0 or more",
                measured={"mass": mass},
            )


@rule("INR003", "not-positive-definite", "error", fixes="unsafe")
def not_positive_definite(robot: Facts) -> Iterator[Violation]:
    """An inertia is missing or zero, or negative about some axis.

    Turning a body about any axis takes work, so all principal moments are above zero. With one that
    is not, the body spins up by itself and the simulation ends in NaN; MuJoCo refuses the file.
    Large products ixy, ixz, iyz beside small ixx, iyy, izz do that, too. A zero inertia is fine
    on a small link that fixed joints make part of a body with an inertia.

    Fix:
        Take the six numbers from CAD, about the centre of mass, in kg m2. The unsafe fix puts the
        nearest inertia that a body can have, or that of a solid box of the body's size.

    Source:
        MuJoCo 4.0: "inertia must have positive eigenvalues", "missing element: 'inertia'".
    """
    unread = Unread(robot.model)
    main = {id(main_link(body)) for body in robot.bodies}
    for link in robot.model.links:
        if not _mass_in_reach(link) or unread.has(link.name, *_SIX):
            continue
        assert link.inertial is not None
        inertia = link.inertial.inertia
        if inertia is None:
            if robot.model.kind != "mjcf" or _spins_freely(robot, link, main):
                yield _incomplete(robot, link, link.inertial)
        elif is_zero(inertia):
            if _spins_freely(robot, link, main):
                yield _indefinite(robot, link, "is zero")
        elif in_reach(inertia) and principal_moments(inertia)[0] <= NOTHING:
            yield _indefinite(robot, link, "is not positive definite")


_SIX = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz", "diaginertia", "fullinertia")
"""Attributes that hold an inertia, in URDF and MJCF."""


def _incomplete(robot: Facts, link: Link, inertial: Inertial) -> Violation:
    lacks, wanted = "no <inertia>", "an <inertia>"
    if robot.model.kind == "mjcf":
        lacks, wanted = "neither diaginertia nor fullinertia", "one of them"
    elif inertial.inertia_source is not None:
        lacks = f"an <inertia> without {', '.join(inertial.missing) or 'numbers'}"
        wanted = "all of ixx, iyy and izz"
    return Violation(
        subject=link.name,
        source=inertia_source(link),
        message=f"link {link.name} has a mass of {inertial.mass:.4g} kg, but {lacks}; wanted "
        f"{wanted}",
    )


def _indefinite(robot: Facts, link: Link, what: str) -> Violation:
    assert link.inertial is not None
    assert link.inertial.inertia is not None
    moments = principal_moments(link.inertial.inertia)
    return Violation(
        subject=link.name,
        source=inertia_source(link),
        message=f"the inertia of link {link.name} {what}: principal moments "
        f"{_listed(moments)} kg m2; wanted all above 0",
        measured=_named(moments),
        fix=repair(robot, link),
    )


def _spins_freely(robot: Facts, link: Link, main: Container[int]) -> bool:
    """Return whether the link is the main one of a body that is moved.

    In URDF, small parts that are fixed to it would hide that its inertia was forgotten, but not
    make it up; in MJCF a body is a part of another on purpose.
    """
    body = robot.body_of.get(link.name) if id(link) in main else None
    if body is None or body.virtual or body.mass <= NOTHING:
        return False
    moved = body.parent is not None or bool(robot.legs)
    return moved and (robot.model.kind != "mjcf" or float(body.principal[0]) <= NOTHING)


@rule("INR004", "triangle-inequality", "error", fixes="unsafe")
def triangle_inequality(robot: Facts) -> Iterator[Violation]:
    """Principal moments break the triangle inequality: no body has such an inertia.

    The two smaller principal moments sum to the largest for a flat plate, and to more for anything
    else. Less means that numbers were mistyped, taken about the wrong point or given in the wrong
    frame. MuJoCo refuses the file; other simulators integrate it and gain energy.

    Fix:
        Take the inertia from CAD about the centre of mass. The unsafe fix puts the nearest inertia
        that a body can have; MuJoCo's balanceinertia makes a ball of it instead.

    Source:
        MuJoCo 4.0: "inertia must satisfy A + B >= C", without any tolerance. Numbers of four digits
        may round a flat part to 0.999, which is only told as information.
    """
    for link in robot.model.links:
        inertia = link.inertial.inertia if link.inertial else None
        if inertia is None or not _mass_in_reach(link) or not in_reach(inertia):
            continue
        moments = principal_moments(inertia)
        if moments[0] <= NOTHING or triangle_ratio(moments) >= _EXACT:
            continue
        ratio = triangle_ratio(moments)
        assert link.inertial is not None
        yield Violation(
            subject=link.name,
            source=link.inertial.inertia_source or link.inertial.source,
            severity="error" if ratio < _IMPOSSIBLE else "warning" if ratio < _ROUNDED else "info",
            message=f"the principal moments of link {link.name} are {_listed(moments)} kg m2: the "
            f"two smaller ones are {_near_one(ratio)} times the largest; wanted 1 or more",
            measured={"ratio": ratio, **_named(moments)},
            fix=repair(robot, link),
        )


@rule("INR005", "placeholder-inertia", "warning")
def placeholder_inertia(robot: Facts) -> Iterator[Violation]:
    """An inertia is a placeholder: the identity, or one and the same for half of the links.

    A kilogram whose inertia is 1 kg m2 reaches out a metre to all sides. Motors that move such a
    link feel a flywheel, and gains that were tuned on it fail on the robot. Parts that are the same
    part, such as four wheels, may have the same inertia; a thigh and its shank do not.

    Fix:
        Take the inertia from CAD, or from the mesh at an even density.

    Source:
        Exporters and tutorials that fill in the identity or 0.001.
    """
    for links in placeholders(robot):
        first = links[0]
        assert first.inertial is not None
        assert first.inertial.inertia is not None
        if is_identity(first):
            value, wanted = "the identity matrix", "that of the part"
        else:
            value = f"{_listed(np.diag(first.inertial.inertia))} kg m2"
            wanted = "each its own, as they are not the same part"
        listed = names(link.name for link in links)
        whose = f"{len(links)} of {_count_massive(robot)} bodies ({listed})"
        if len(links) == 1:
            whose = f"body {listed}"
        yield Violation(
            subject=first.name,
            source=first.inertial.inertia_source or first.inertial.source,
            message=f"the inertia of {whose} is {value}; wanted {wanted}",
            measured={"links": len(links)},
        )


@rule("INR006", "too-spread-inertia", "warning")
def too_spread_inertia(robot: Facts) -> Iterator[Violation]:
    """An inertia is larger than the size of the body allows.

    Mass inside a body is at most half of the body's diagonal away from its middle, so the radius of
    gyration sqrt(I / m) is less than that. A larger one is a matter of units (g mm2, or taken about
    the origin of the robot) far more often than of shape; the joint then moves a flywheel.

    Fix:
        Give the inertia in kg m2 about the centre of mass, and the mass in kg.

    Source:
        I <= m r2 for all mass within r of the centre of mass. Over 3 are the wrists of a published
        UR5 and the fingers of a Baxter: numbers of other parts, or in other units.
    """
    for link in robot.model.links:
        largest = _inertia_of(link)
        if largest >= LARGEST:
            yield Violation(
                subject=link.name,
                source=inertia_source(link),
                severity="error",
                message=f"the inertia of link {link.name} is {largest:.3g} kg m2; wanted less than "
                f"{LARGEST:.0e}, which no robot has",
                measured={"inertia": largest},
            )
    extents, odd = extents_of(robot), []
    for body, radius in _radii(robot):

        def wrong(box: Matrix, radius: float = radius) -> bool:
            return radius > _SPREAD * half_diagonal(box)

        box = extents.still(body, wrong)
        if box is not None:
            odd.append((body, radius, box))
    blamed = _blamed(robot) if odd else set()
    for body, radius, box in odd:
        if body.name not in blamed:
            far = radius > _SPREAD_FAR * half_diagonal(box)
            severity: Severity = "error" if far else "warning"
            yield _odd_radius(body, radius, box, severity, f"wanted {_SPREAD:g} of that at most")


@rule("INR007", "too-concentrated-inertia", "warning")
def too_concentrated_inertia(robot: Facts) -> Iterator[Violation]:
    """An inertia is far smaller than the size of the body suggests.

    All the mass would sit within a twentieth of the way to the body's ends. Such a body turns at
    the slightest torque: the simulation gets stiff or explodes, and torques that were learned on
    it do not move the robot. Mostly the numbers are in other units, or a placeholder.

    Fix:
        Give the inertia in kg m2 about the centre of mass, and the mass in kg.

    Source:
        A rod has a ratio of 0.58, a cube 0.47, a ball 0.36.
    """
    extents, odd = extents_of(robot), []
    for whole, _ in _radii(robot):
        for body in (whole, _main_part(whole)):
            radius = gyration_radius(body.principal, body.mass)

            def doubtful(length: float, radius: float = radius) -> bool:
                return radius < _CONCENTRATED * length

            box = extents.own(body, doubtful) if radius > 0 else None
            if box is not None and radius < _CONCENTRATED * half_diagonal(box):
                odd.append((body, radius, box))
                break
    blamed = _blamed(robot) if odd else set()
    wanted = f"wanted {_CONCENTRATED:g} of that at least"
    for body, radius, box in odd:
        if body.name not in blamed:
            yield _odd_radius(body, radius, box, "warning", wanted)


def _main_part(body: Body) -> Body:
    """Return the link that stands for a body, as a body of its own."""
    place = next(k for k, link in enumerate(body.links) if link.name == body.name)
    return replace(body, links=body.links[place : place + 1], poses=body.poses[place : place + 1])


def _odd_radius(
    body: Body, radius: float, box: Matrix, severity: Severity, wanted: str
) -> Violation:
    half = half_diagonal(box)
    return Violation(
        subject=body.name,
        source=inertia_source(main_link(body)),
        severity=severity,
        message=f"the radius of gyration of body {body.name} is {radius:.3g} m (mass "
        f"{body.mass:.4g} kg, largest principal moment {body.principal[2]:.3g} kg m2), and half "
        f"the body's diagonal {half:.3g} m; {wanted}",
        measured={"radius": radius, "half_diagonal": half},
    )


@per_robot
def _blamed(robot: Facts) -> set[str]:
    """Return the bodies whose mass or inertia other rules find fault with."""
    blamed = {link.name for links in placeholders(robot) for link in links}
    for check in (not_positive_definite, triangle_inequality):
        blamed |= {defect.subject for defect in check(robot) if defect.severity in (None, "error")}
    for check in (implausible_density, center_of_mass_outside):
        blamed |= {defect.subject for defect in check(robot)}
    return blamed


def _radii(robot: Facts) -> Iterator[tuple[Body, float]]:
    """Yield bodies and their radius of gyration [m]."""
    for body in robot.bodies:
        if body.virtual or _mass_unknown(body) or body.mass <= NOTHING:
            continue
        main = main_link(body).inertial
        if main is None or main.inertia is None or not in_reach(main.inertia):
            continue
        if body.principal[0] > NOTHING:
            yield body, gyration_radius(body.principal, body.mass)


@rule("INR008", "center-of-mass-outside", "warning")
def center_of_mass_outside(robot: Facts) -> Iterator[Violation]:
    """A centre of mass lies outside of its body.

    The origin of an <inertial> is in the frame of its link. Given in the frame of the robot or of
    the CAD file, in millimetres, or with a sign lost in mirroring, it ends up in the air, and the
    robot tips over or holds torques that the real one does not feel.

    Fix:
        Give the centre of mass in the frame of the link, in metres.

    Source:
        A convex body has its centre of mass inside; the margin is for shapes that leave parts out.
    """
    extents = extents_of(robot)
    for body in robot.bodies:
        if body.virtual or _mass_unknown(body) or body.mass <= NOTHING:
            continue

        def wrong(box: Matrix, center: Matrix = body.center) -> bool:
            return _outside(center, box) > _allowed(box)

        box = extents.still(body, wrong)
        if box is None:
            continue
        aside, allowed = _outside(body.center, box), _allowed(box)
        around = f"the box around it, whose diagonal is {2 * half_diagonal(box):.3g} m"
        link = main_link(body)
        yield Violation(
            subject=body.name,
            source=mass_source(link),
            severity="error" if aside > _ASIDE_FAR * allowed else "warning",
            message=f"the centre of mass of body {body.name} is {aside:.3g} m outside "
            f"{around}; wanted {allowed:.3g} m at most",
            measured={"outside": aside, "allowed": allowed},
        )


def _outside(point: Matrix, box: Matrix) -> float:
    return float(np.linalg.norm(np.maximum(0, np.maximum(box[0] - point, point - box[1]))))


def _allowed(box: Matrix) -> float:
    return _ASIDE * 2 * half_diagonal(box) + _SLACK


@rule("INR009", "mass-ratio", "warning")
def mass_ratio(robot: Facts) -> Iterator[Violation]:
    """Neighbouring bodies differ in mass by more than a factor of 1000.

    The joint between them is then stiff to the solver: it needs far smaller time steps, or the
    light one is thrown about. PhysX in particular lets such joints drift apart.

    Fix:
        Merge the light body into its neighbour, or give it its real mass and some armature.

    Source:
        PhysX's and Bullet's guides advise ratios below 10 to 100; 1000 is past doubt.
    """
    apart = []
    for body in robot.bodies:
        parent = robot.carrier_of(body)
        if body.virtual or parent is None or _mass_unknown(body) or _mass_unknown(parent):
            continue
        light, heavy = sorted((body, parent), key=lambda b: b.mass)
        if light.mass > NOTHING and heavy.mass > _RATIO * light.mass:
            apart.append((light, heavy))
    blamed = {odd.subject for odd in implausible_density(robot)} if apart else set()
    for light, heavy in apart:
        if blamed & {light.name, heavy.name}:
            continue
        ratio = heavy.mass / light.mass
        yield Violation(
            subject=light.name,
            source=mass_source(main_link(light)),
            message=f"body {light.name} has {light.mass:.3g} kg and its neighbour {heavy.name} "
            f"{heavy.mass:.4g} kg: a ratio of {ratio:.0f}; wanted {_RATIO:.0f} at most",
            measured={"ratio": ratio, "mass": light.mass, "neighbor": heavy.mass},
        )


@rule("INR010", "implausible-density", "warning")
def implausible_density(robot: Facts) -> Iterator[Violation]:
    """A mass does not fit the size of the body.

    Nothing on a robot is lighter than packing foam or denser than gold. A mass in grams or pounds,
    a slipped decimal point or a mesh in millimetres is.

    Fix:
        Give the mass in kg, and check the scale of the shapes.

    Source:
        Densities: foam 10 to 30 kg/m3, aluminium 2700, steel 7850, gold 19,300. Too dense is judged
        by the box around all that the body has, too light by its largest single shape.
    """
    for link in robot.model.links:
        mass = link.inertial.mass if link.inertial else None
        if mass is not None and mass >= LARGEST:
            yield Violation(
                subject=link.name,
                source=mass_source(link),
                severity="error",
                message=f"the mass of link {link.name} is {mass:.3g} kg; wanted less than "
                f"{LARGEST:.0e}, which no robot has",
                measured={"mass": mass},
            )
    extents = extents_of(robot)
    for body in robot.bodies:
        if body.virtual or _mass_unknown(body) or body.mass <= NOTHING or is_derived(body):
            continue
        found = too_dense(extents, body) or too_light(robot, extents, body)
        if found:
            space, limit = found
            density = body.mass / space
            least = density > limit
            yield Violation(
                subject=body.name,
                source=mass_source(main_link(body)),
                message=f"body {body.name} has {body.mass:.3g} kg in {space:.3g} m3: "
                f"{'at least' if least else 'at most'} {density:.3g} kg/m3; wanted "
                f"{limit:,.0f} {'or less' if least else 'or more'}",
                measured={"mass": body.mass, "volume": space, "density": density},
            )


@rule("INR011", "mass-drift", "warning")
def mass_drift(robot: Facts) -> Iterator[Violation]:
    """The robot that a simulator makes of the file is heavier than the file says.

    A link that has collision shapes but no <inertial> gets a mass from MuJoCo, at the density of
    water, and so does each shape where two overlap; other simulators take the link as massless, or
    do the same. The robot then weighs something else in each of them.

    Fix:
        Give each such link an <inertial> with its mass, or move its collision shapes to the link
        that it is fixed to.

    Source:
        MuJoCo 4.0, tried on a fixed link with a box of 1 m3: it adds 1000 kg.
    """
    if robot.model.kind == "mjcf" or robot.total_mass <= NOTHING:
        return
    added = {
        link: _DENSITY * sum(volume_of(robot, shape) for shape in link.collisions)
        for body in robot.bodies
        if body.mass > NOTHING
        for link in body.links
        if link.inertial is None
    }
    total = sum(added.values())
    share = total / robot.total_mass
    if share <= _DRIFT:
        return
    added_to = sorted((link for link in added if added[link] > 0), key=lambda link: -added[link])
    yield Violation(
        subject=added_to[0].name,
        source=added_to[0].source,
        severity="error" if share > _DRIFT_FAR else "warning",
        message=f"MuJoCo adds {total:.3g} kg for the collision shapes of links without <inertial> "
        f"({names(link.name for link in added_to)}): {share:.1%} of the declared "
        f"{robot.total_mass:.4g} kg; wanted {_DRIFT:.0%} at most",
        measured={"added": total, "declared": robot.total_mass, "share": share},
    )


def _mass_in_reach(link: Link) -> bool:
    mass = link.inertial.mass if link.inertial else None
    return mass is not None and 0 <= mass < LARGEST


def _near_one(ratio: float) -> str:
    return f"1 - {1 - ratio:.1g}" if ratio > 0.9999 else f"{ratio:.4g}"


def _listed(moments: Matrix) -> str:
    return ", ".join(f"{moment:.4g}" for moment in moments)


def _named(moments: Matrix) -> Mapping[str, float]:
    return {f"e{k}": float(moment) for k, moment in enumerate(moments)}


def _count_massive(robot: Facts) -> int:
    return sum(body.mass > NOTHING for body in robot.bodies)

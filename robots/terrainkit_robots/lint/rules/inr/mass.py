"""Rules on masses."""

from typing import TYPE_CHECKING

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.inertia.density import default_mass
from terrainkit_robots.analysis.inertia.inertial import has_valid_mass, mass_part, max_inertia
from terrainkit_robots.analysis.inertia.physical import MIN_INERTIA
from terrainkit_robots.lint.rule import Part, Severity, Violation, Violations, findings_of, rule
from terrainkit_robots.text import contrast, names

if TYPE_CHECKING:
    from terrainkit_robots.description.model import Link

# 9 of 536 published files exceed it, all of them with placeholders of 10 g and less beside
# kilograms.
_MAX_MASS_RATIO = 1000.0
"""Mass ratio of neighboring bodies above which solvers become stiff at common time steps, such as
10 kg on 10 g."""

# The 7 published files with an error have 6 % to 305 %.
_MAX_INFERRED, _MAX_INFERRED_ERROR = 0.01, 0.05
"""Inferred mass divided by the declared mass: limits of the warning and the error."""


@rule("INR001", "massless-body", "error", needs=("all-files",), onboarding="blocks")
def massless_body(robot: Facts) -> Violations:
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
    for link in robot.model.links:
        inertial = link.inertial
        has_no_mass = inertial is not None and inertial.mass is None
        if has_no_mass and not robot.unparsed.has(link.name, "value", "mass"):
            yield Violation(
                element=mass_part(link),
                message=f"<inertial> of link {link.name}: got no <mass>; expected <mass> and "
                "<inertia>",
            )
    trunk = {link.name for body in robot.bodies[:1] for link in body.links}
    floating = any(j.kind == "floating" and j.child in trunk for j in robot.model.joints)
    for body in robot.bodies:
        if body.virtual or not has_valid_mass(body) or body.mass > MIN_INERTIA:
            continue
        if body.parent is not None or robot.legs or floating:
            declared = [link for link in body.links if link.inertial is not None]
            mass = f"{body.mass:.3g} kg" if declared else "no <inertial> on any of its links"
            parent = f"joint {body.joint.name} moves it" if body.joint else "it is the trunk"
            yield Violation(
                element=Part(body.name, (mass_part(declared[0]) if declared else body.top).source),
                message=f"mass of body {body.name} ({parent}): got {mass}; expected more than 0 kg",
                measured={"mass": body.mass},
            )
    yield from _links_without_mass(robot)


def _links_without_mass(robot: Facts) -> Violations:
    """Yield violations of massless links that are fixed to a body with mass."""
    massless = [
        (link, max_inertia(link))
        for body in robot.bodies
        if body.mass > MIN_INERTIA
        for link in body.links
        if link.inertial is not None and link.inertial.mass == 0
    ]
    for link, inertia in massless:
        if inertia > MIN_INERTIA:
            yield Violation(
                element=mass_part(link),
                severity="warning",
                message=f"mass of link {link.name}: got 0 kg with an inertia of up to "
                f"{inertia:.3g} kg m2; expected a mass above 0 kg, or no inertia",
                measured={"mass": 0.0, "inertia": inertia},
            )
    links = [link for link, inertia in massless if inertia <= MIN_INERTIA]
    # A frame has no mass on purpose; the mass of a link with shapes was probably forgotten.
    parts = [link for link in links if link.visuals or link.collisions]
    frames = [link for link in links if link not in parts]
    groups: tuple[tuple[list[Link], Severity], ...] = ((parts, "warning"), (frames, "note"))
    for group, severity in groups:
        if group:
            yield Violation(
                element=mass_part(group[0]),
                severity=severity,
                message=f"mass of {names(link.name for link in group)}: got 0 kg; simulators that "
                "do not merge fixed joints reject or replace it",
                measured={"links": len(group)},
            )


@rule("INR002", "negative-mass", "error", onboarding="blocks")
def negative_mass(robot: Facts) -> Violations:
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
                element=mass_part(link),
                message=f"mass of link {link.name}: got {mass:.6g} kg; expected 0 kg or more",
                measured={"mass": mass},
            )


@rule("INR009", "mass-ratio", "warning", needs=("mass-unit",))
def mass_ratio(robot: Facts) -> Violations:
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
        if not (has_valid_mass(body) and has_valid_mass(parent)):
            continue
        light, heavy = sorted((body, parent), key=lambda b: b.mass)
        if light.mass > MIN_INERTIA and heavy.mass > _MAX_MASS_RATIO * light.mass:
            candidates.append((light, heavy))
    reported = {f.subject for f in findings_of(robot, "INR010")} if candidates else set()
    for light, heavy in candidates:
        if reported & {light.name, heavy.name}:
            continue
        ratio = heavy.mass / light.mass
        yield Violation(
            element=mass_part(light.main_link),
            message=f"mass ratio of {heavy.name} ({heavy.mass:.4g} kg) and its neighbor "
            f"{light.name} ({light.mass:.3g} kg): got "
            f"{contrast(ratio, _MAX_MASS_RATIO, '.0f')[0]}; expected at most {_MAX_MASS_RATIO:.0f}",
            measured={"ratio": ratio, "mass": light.mass, "neighbor": heavy.mass},
        )


@rule(
    "INR011", "inferred-mass", "warning", onboarding="converts", needs=("mass-unit", "length-unit")
)
def inferred_mass(robot: Facts) -> Violations:
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
        link: default_mass(link, robot.meshes)
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
        element=links[0],
        severity="error" if share > _MAX_INFERRED_ERROR else "warning",
        message=f"mass that MuJoCo infers for links without <inertial> "
        f"({names(link.name for link in links)}): got {total:.3g} kg, {share:.1%} of the declared "
        f"{robot.total_mass:.4g} kg; expected at most {_MAX_INFERRED:.0%}",
        measured={"added": total, "declared": robot.total_mass, "share": share},
    )

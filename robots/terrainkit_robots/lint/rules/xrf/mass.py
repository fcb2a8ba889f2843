"""Rules that compare masses and inertias."""

import math

from terrainkit.settings.text import truncate
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.inertia.inertial import mass_part
from terrainkit_robots.analysis.simulator_conventions.loaded_robot import dropped_mass
from terrainkit_robots.lint.compare.body_mass import (
    body_difference,
    has_valid_inertial,
    relative_difference,
)
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule
from terrainkit_robots.lint.rules.xrf.other_robot import other_name, other_robot, robot_pairs
from terrainkit_robots.text import names, numbers

_MAX_MASS_DIFFERENCE, _MAX_MASS_ERROR = 0.01, 0.05
"""Relative difference of masses: limits of the warning (cables and screws) and the error (a payload
or a missing part)."""

_MAX_COM_DISTANCE = 0.002
"""Allowed distance of centers of mass [m]; rounding causes less than 0.1 mm."""

_MAX_INERTIA_DIFFERENCE = 0.05
"""Allowed difference of inertias, as a share of the largest element."""

_MIN_MASS = 1e-3
"""Bodies lighter than this are placeholders whose inertia has no meaning [kg]."""

_MAX_LISTED_BODIES = 3
"""Number of bodies listed as the main causes of a mass difference."""


@rule("XRF007", "total-mass-differs", "warning", needs=("against",))
def compare_total_mass(robot: Facts) -> Violations:
    """The total mass of the robot differs between the files.

    A part is missing in one file, or counted twice. A policy adapts its forces to the weight of the
    robot.

    Fix:
        Check the bodies listed in the message: a mass may have been mistyped, or lost or replaced
        by the density of water during a conversion.

    Source:
        Declared masses; in MJCF also masses that MuJoCo computes from shapes. MuJoCo 4.0 drops the
        mass of the trunk of a URDF without a floating joint, since it welds the trunk to the world.
    """
    pairs, other, there = robot_pairs(robot), other_robot(robot), other_name(robot)
    a, b = robot.total_mass, other.total_mass
    for facts, mass in ((robot, a), (other, b)):
        if math.isnan(mass):
            file = truncate(facts.model.file.name)
            raise CannotCheckError(f"masses of {file} are computed from mesh files")
    difference = relative_difference(a, b)
    if difference > _MAX_MASS_DIFFERENCE:
        bodies = sorted(pairs.bodies, key=lambda pair: -abs(pair[0].mass - pair[1].mass))
        causes = [
            f"{truncate(one.name)} {one.mass:.4g} and {two.mass:.4g} kg"
            for one, two in bodies[:_MAX_LISTED_BODIES]
            if relative_difference(one.mass, two.mass) > _MAX_MASS_DIFFERENCE
        ]
        yield Violation(
            severity="error" if difference > _MAX_MASS_ERROR else None,
            message=f"total mass: got {a:.5g} kg here and {b:.5g} kg in {there}, {difference:.1%} "
            f"apart; expected at most {_MAX_MASS_DIFFERENCE:.0%}"
            f"{f'; largest differences: {names(causes)}' if causes else ''}",
            measured={"here": a, "there": b, "share": difference},
        )
    yield from _missing_mass(robot, other)


def _missing_mass(robot: Facts, other: Facts) -> Violations:
    """Yield the mass that MuJoCo drops from a URDF whose MJCF has a floating base."""
    for urdf, mjcf in ((robot, other), (other, robot)):
        floating = any(joint.kind == "floating" for joint in mjcf.model.joints)
        dropped = dropped_mass(urdf) if mjcf.model.kind == "mjcf" and floating else 0.0
        if dropped > _MAX_MASS_DIFFERENCE * urdf.total_mass:
            root = urdf.bodies[0].top.name
            file = truncate(urdf.model.file.name)
            yield Violation(
                element=Part(root, robot.model.source),
                severity="note",
                message=f"mass that MuJoCo drops when it loads {file}: got {dropped:.5g} of "
                f"{urdf.total_mass:.5g} kg; expected 0 kg, as for {truncate(mjcf.model.file.name)} "
                f"with {mjcf.total_mass:.5g} kg; the URDF has no floating joint, so that {root} is "
                "welded to the world with all links fixed to it",
                hint="Load the MJCF, or add a floating joint above the base of the URDF.",
                measured={"dropped": dropped, "declared": urdf.total_mass},
            )


@rule("XRF009", "inertia-differs", "warning", needs=("against",))
def compare_inertia(robot: Facts) -> Violations:
    """The mass, center of mass or inertia of a body differs between the files.

    Robots with equal total mass can still differ, such as in the height of the center of mass or
    the inertia of the feet. A typical cause is a conversion that replaced an inertia by a
    placeholder.

    Fix:
        Use the numbers that come from CAD. Round or equal numbers are placeholders.

    Source:
        Links that are connected by fixed joints count as one body, as simulators merge them. Only
        bodies with the same joints in both files are compared.
    """
    pairs, other, there = robot_pairs(robot), other_robot(robot), other_name(robot)
    total_differs = relative_difference(robot.total_mass, other.total_mass) > _MAX_MASS_DIFFERENCE
    for one, two in pairs.bodies:
        if min(one.mass, two.mass) < _MIN_MASS:
            continue
        if not (has_valid_inertial(one) and has_valid_inertial(two)):
            continue
        gap = body_difference(robot, other, pairs, one, two)
        body = truncate(one.name)
        message = ""
        if gap.mass > _MAX_MASS_DIFFERENCE:
            if not total_differs:  # else reported by XRF007
                message = (
                    f"mass of body {body}: got {one.mass:.4g} kg here and {two.mass:.4g} kg in "
                    f"{there}; expected a difference of at most {_MAX_MASS_DIFFERENCE:.0%}"
                )
        elif gap.center > _MAX_COM_DISTANCE:
            message = (
                f"center of mass of body {body}: got a distance of {1000 * gap.center:.3g} mm from "
                f"that in {there}; expected at most {1000 * _MAX_COM_DISTANCE:g} mm"
            )
        elif gap.inertia > _MAX_INERTIA_DIFFERENCE:
            message = (
                f"principal moments of body {body}: got "
                f"({numbers(one.principal, '.3g', ', ')}) kg m2 here and "
                f"({numbers(two.principal, '.3g', ', ')}) kg m2 in {there}, an inertia "
                f"{gap.inertia:.0%} apart; expected at most {_MAX_INERTIA_DIFFERENCE:.0%}"
            )
        if message:
            yield Violation(
                element=mass_part(one.main_link),
                message=message,
                measured={"mass": gap.mass, "center": gap.center, "inertia": gap.inertia},
            )

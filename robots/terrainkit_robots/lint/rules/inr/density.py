"""Rule on densities."""

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.inertia.density import (
    check_max_density,
    check_min_density,
    has_derived_mass,
)
from terrainkit_robots.analysis.inertia.inertial import bodies_with_mass, mass_part
from terrainkit_robots.analysis.inertia.physical import MAX_INERTIA
from terrainkit_robots.export.canonical import has_floating_base
from terrainkit_robots.lint.rule import Violation, Violations, rule


@rule("INR010", "implausible-density", "warning", needs=("mass-unit", "length-unit"))
def implausible_density(robot: Facts) -> Violations:
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
                element=mass_part(link),
                severity="error",
                message=f"mass of link {link.name}: got {mass:.3g} kg; expected less than "
                f"{MAX_INERTIA:.0e} kg",
                measured={"mass": mass},
            )
    body_bounds = robot.body_bounds
    for body in bodies_with_mass(robot.bodies):
        if has_derived_mass(body):
            continue
        result = check_max_density(body, body_bounds) or check_min_density(
            body, body_bounds, robot.meshes
        )
        if result:
            volume, limit = result
            density = body.mass / volume
            is_fixed = body.index == 0 and not has_floating_base(robot)
            got, expected = ("at least", "at most") if density > limit else ("at most", "at least")
            yield Violation(
                element=mass_part(body.main_link),
                message=f"density of body {body.name}: got {got} {density:.3g} kg/m3 "
                f"({body.mass:.3g} kg in {volume:.3g} m3); expected {expected} {limit:,.0f} kg/m3",
                severity="note" if is_fixed else None,  # its mass has no effect
                measured={"mass": body.mass, "volume": volume, "density": density},
            )

"""Rule on the sizes of shapes."""

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule


@rule("COL004", "invalid-size", "error")
def invalid_size(robot: Facts) -> Violations:
    """The size of a shape is zero or negative.

    MuJoCo rejects the shape; PhysX treats it as a point or drops it, so that the part has no
    contacts.

    Fix:
        Give the shape the size of the part, or remove it.

    Source:
        MuJoCo: `size 0 must be positive in geom`.
    """
    for link in robot.links:
        for kind, shapes in (("collision", link.collisions), ("visual", link.visuals)):
            for shape in shapes:
                invalid = [size for size in shape.size if size <= 0]
                if invalid and shape.shape not in ("mesh", "plane"):
                    yield Violation(
                        element=Part(link.name, shape.size_source or shape.source),
                        message=f"size of a {kind} {shape.shape} of link {link.name}: got "
                        f"{invalid[0]:g} m; expected more than 0 m",
                        severity="error" if kind == "collision" else "warning",
                        measured={"size": invalid[0]},
                    )

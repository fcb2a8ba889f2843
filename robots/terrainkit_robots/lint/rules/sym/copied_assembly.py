"""Rule on assemblies that are mounted twice instead of mirrored."""

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.symmetry.asymmetry import limits_match
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule


@rule("SYM008", "copied-assembly", "note")
def copied_assembly(robot: Facts) -> Violations:
    """The left and the right side are the same assembly, mounted twice.

    Two arms of one product are equal in their own frames, and are not mirror images of each other.
    The other rules on symmetry do not apply to them, and a policy cannot be mirrored by swapping
    joints with a sign.

    Fix:
        No action if the real robot is built like this. Otherwise mirror one side: centers of mass,
        products of inertia, origins and limits.

    Source:
        Both sides have the same meshes, inertials, joint axes, origins and limits, and at least one
        center of mass or range is not mirrored.
    """
    copied = robot.copied_pairs
    differing = [
        pair
        for pair in copied
        if (pair.has_valid_masses and pair.com_error(robot.mirror) > pair.max_com_error)
        or (
            pair.sign != 0
            and (a := pair.left.joint.range) is not None
            and (b := pair.right.joint.range) is not None
            and not limits_match(a, b, pair.sign)
        )
    ]
    if differing:
        first = copied[0]
        yield Violation(
            element=Part(first.left.body.name, first.left.body.top.source),
            message=f"assemblies on both sides: got {len(copied)} equal pairs of bodies, from "
            f"{first.left.body.name} and {first.right.body.name} on; {len(differing)} of them are "
            "not mirror images",
            measured={
                "pairs": len(copied),
                "differing": len(differing),
                "mirror_image": first.right.body.name,
            },
        )

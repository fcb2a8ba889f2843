"""Rule on feet that Isaac Gym merges."""

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.fix import SetAttribute, make_fix
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule
from terrainkit_robots.text import names


@rule("LEG004", "foot-collapsed", "note", fixes="safe")
def foot_collapsed(robot: Facts) -> Violations:
    """Isaac Gym merges the feet into their shanks.

    Isaac Gym collapses fixed joints by default. A foot is then not a rigid body: a search for feet
    by name finds nothing, and their contact forces belong to the shank.

    Fix:
        Add dont_collapse="true" to the fixed joints above the feet. Other simulators ignore it.

    Source:
        Isaac Gym's asset option collapse_fixed_joints; the descriptions of Unitree and ANYbotics
        for legged_gym use the attribute.
    """
    if robot.model.kind == "mjcf":
        raise CannotCheckError("Isaac Gym's URDF importer does not read MJCF")
    merged = []
    for leg in robot.legs:
        joint = robot.tree.parent_joint.get(leg.foot)
        has_shapes = bool(robot.tree.links[leg.foot].collisions)
        if joint is not None and joint.kind == "fixed" and not joint.dont_collapse and has_shapes:
            merged.append((leg.foot, joint))
    if not merged:
        return
    foot, first = merged[0]
    joints = names(joint.name for _, joint in merged)
    edits = [
        SetAttribute(source=joint.source, name="dont_collapse", value="true") for _, joint in merged
    ]
    yield Violation(
        element=Part(foot, first.source),
        message=f"fixed joints above the feet ({joints}): got no dont_collapse; expected "
        'dont_collapse="true", or Isaac Gym merges the feet into their parents',
        measured={"feet": len(merged)},
        fix=make_fix("safe", f'Add dont_collapse="true" to {joints}.', edits),
    )

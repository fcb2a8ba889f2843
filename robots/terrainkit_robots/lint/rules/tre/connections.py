"""Rules on the joints that connect the links to a tree."""

import re
from collections.abc import Sequence

from terrainkit.settings.text import closest, truncate
from terrainkit_robots.analysis.bodies.tree import Tree
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.symmetry.mirror import side_words
from terrainkit_robots.lint.rule import Part, Violation, Violations, get_rule, rule
from terrainkit_robots.text import group, names

MAX_SUGGESTIONS = 20
"""Maximum number of unknown names for which a similar name is suggested. Generated files may have
thousands."""

_MIN_SIMILARITY = 0.6
"""Minimum share of common letters for a suggestion, as in difflib."""

MAX_COMPARED = 20_000
"""Maximum number of links to search for a suggestion. More would take seconds."""


def _nearest(name: str, others: Sequence[str]) -> str:
    """Return the most similar name, or an empty text if none is similar."""
    return "" if len(others) > MAX_COMPARED else closest(name, others, _MIN_SIMILARITY)


@rule("TRE002", "unknown-link", "error")
def unknown_link(robot: Facts) -> Violations:
    """A joint refers to a link that does not exist.

    The joint and everything below it are not part of the tree. Some readers reject the file, others
    continue without the leg.

    Fix:
        Correct the name, or add the link. Names are case-sensitive.

    Source:
        urdfdom: `child link [...] of joint [...] not found`; MuJoCo: `URDF joint parent or child
        missing`.
    """
    links = robot.tree.links
    missing = group(
        (name, (role, joint))
        for joint, reason in robot.tree.rejected
        for role, name in (("parent", joint.parent), ("child", joint.child))
        # XML013 reports a missing name.
        if reason == "unknown-link" and name and name not in links
    )
    for index, (name, uses) in enumerate(missing.items()):
        joints = names(f"{role} of joint {joint.name}" for role, joint in uses)
        yield Violation(
            element=uses[0][1],
            message=f"link {truncate(name)}: does not exist, but is the {joints}; expected a "
            "link in the file",
            hint=_suggestion(robot, name, uses[0][0]) if index < MAX_SUGGESTIONS else "",
        )


def _suggestion(robot: Facts, name: str, role: str) -> str:
    """Return a hint with the link of the most similar name, if there is one."""
    nearest = _nearest(name, robot.tree.roots[1:])
    if not nearest and role == "parent":  # another joint holds the links that have a parent
        nearest = _nearest(name, list(robot.tree.links))
    return f"Did you mean {nearest}? Names are case-sensitive." if nearest else ""


@rule("TRE003", "multiple-parents", "error")
def multiple_parents(robot: Facts) -> Violations:
    """A link is the child of two joints.

    A URDF describes a tree and cannot describe a closed kinematic loop. Readers reject the file, or
    drop one of the joints.

    Fix:
        Remove all but one of these joints, and close the loop with a <gazebo><joint>, or with
        [[loops]] in the file of --spec.

    Source:
        wiki.ros.org/urdf/XML: a URDF describes a tree; MuJoCo: `URDF body has multiple parents`.
    """
    rejected = robot.tree.rejected
    extra = group((joint.child, joint) for joint, why in rejected if why == "second-parent")
    first = {joint.child: joint for joint in reversed(robot.model.joints)}
    for child, joints in extra.items():
        listed = names(joint.name for joint in (first[child], *joints))
        yield Violation(
            element=Part(child, joints[0].source),
            message=f"link {truncate(child)}: child of {len(joints) + 1} joints ({listed}); "
            "expected 1",
            measured={"joints": len(joints) + 1},
        )


@rule("TRE004", "cycle", "error")
def cycle(robot: Facts) -> Violations:
    """Joints form a cycle.

    Each link in the cycle is both parent and child of the others, so none of them is connected to
    the robot. Readers reject the file, loop forever, or drop the links.

    Fix:
        Look for a joint with parent and child swapped.

    Source:
        urdfdom: `No root link found. The robot xml is not a valid tree.`; MuJoCo: `URDF body not
        found`.
    """
    # TRE003 reports the joint that closes a cycle if its child has another parent.
    with_two_parents = {j.child for j, reason in robot.tree.rejected if reason == "second-parent"}
    closing = {joint.child: joint for joint, reason in robot.tree.rejected if reason == "cycle"}
    for links in robot.tree.cycles:
        if with_two_parents.isdisjoint(links):
            path = names([links[0], *links[:0:-1], links[0]], sep=" > ")
            size = f"{len(links)} links" if links[1:] else "1 link"
            yield Violation(
                element=Part(links[0], closing[links[0]].source),
                message=f"cycle of {size}: {path}; expected a tree",
                measured={"links": len(links)},
            )


@rule("TRE005", "multiple-roots", "error")
def multiple_roots(robot: Facts) -> Violations:
    """The robot has more than one root link.

    urdfdom rejects a file with two roots. MuJoCo silently welds the second root to the world, where
    it stays behind when the robot moves.

    Fix:
        Add the joint that connects the link to the robot, or remove the link.

    Source:
        urdfdom: `Two root links found`; observed in MuJoCo 4.0.
    """
    if robot.model.kind == "mjcf":
        return  # other bodies belong to the scene
    root, others = _roots(robot.tree)
    for name in others:
        yield Violation(
            element=robot.tree.links[name],
            message=f"link {truncate(name)}: has no parent joint, in addition to the root link "
            f"{truncate(root)}; expected 1 root",
        )


def _roots(tree: Tree) -> tuple[str, list[str]]:
    """Return the root, and the other roots that no other finding explains."""
    components = _components(tree)
    explained = {
        components[joint.child]
        for joint, reason in tree.rejected
        if reason in ("unknown-link", "cycle") and joint.child in components
    }
    roots = [n for n in tree.roots if components[n] == n and n not in explained]
    root, *others = roots or [""]
    # A joint with an unknown child link was probably meant to hold one of these.
    unknown = [joint.child for joint, _ in tree.rejected if joint.child not in tree.links]
    for child in unknown[:MAX_SUGGESTIONS]:
        if others:
            others.remove(_nearest(child, others) or others[0])
    return root, others[len(unknown[MAX_SUGGESTIONS:]) :]


def _components(tree: Tree) -> dict[str, str]:
    """Return for each link the first root of its connected component.

    Joints that are not part of the tree count as connections, because other rules report them.
    """
    neighbors: dict[str, list[str]] = {name: [] for name in tree.links}
    for joint in (*tree.parent_joint.values(), *(joint for joint, _ in tree.rejected)):
        if joint.parent in neighbors and joint.child in neighbors:
            neighbors[joint.parent].append(joint.child)
            neighbors[joint.child].append(joint.parent)
    component: dict[str, str] = {}
    for root in tree.roots:
        stack = [root]
        while stack:
            name = stack.pop()
            if name not in component:
                component[name] = root
                stack += neighbors[name]
    return component


@rule("TRE006", "no-links", "error", needs=("all-files",))
def no_links(robot: Facts) -> Violations:
    """The robot has no links.

    MuJoCo loads such a file as an empty world without an error.

    Fix:
        Check that this is the correct file, and that links are children of <robot>, or bodies
        children of <worldbody>.

    Source:
        urdfdom: `No link elements found in urdf file`; observed in MuJoCo 4.0.
    """
    model = robot.model
    if model.links:
        return
    if any(get_rule(problem.code).severity == "error" for problem in model.problems):
        raise CannotCheckError("the file could not be read")
    what = "bodies" if model.kind == "mjcf" else "links"
    yield Violation(
        message=f"number of {what}: got 0, with {len(model.joints)} joints; expected at least 1",
    )


@rule("TRE012", "single-link", "warning", certainty="likely")
def single_link(robot: Facts) -> Violations:
    """A URDF has one link with a mass, and no joints.

    Exporters of CAD programs lose all joints of an assembly that they do not understand, and the
    rest of the robot with them. Every other rule then has nothing to check. A loose object, such as
    a box, is such a file as well.

    Fix:
        Export the robot again. In Fusion 360 and Onshape, each moving part must be a component of
        its own that a joint connects to another one.

    Source:
        Reports on fusion2urdf, whose exports keep only base_link.
    """
    links, kind = robot.model.links, robot.model.kind
    if kind == "mjcf" or len(links) != 1 or robot.model.joints or not robot.total_mass > 0:
        return
    yield Violation(
        element=links[0],
        message=f"links and joints: got the link {links[0].name} and no joints; expected the links "
        "of a robot, connected by joints",
    )


@rule("TRE011", "parent-of-another-leg", "warning", certainty="likely")
def parent_of_another_leg(robot: Facts) -> Violations:
    """A link is attached to the link of another leg or side.

    The names of the link and of its parent say different sides, while the parent on the link's own
    side has no such child. The parent was not changed after copying the joint.

    Fix:
        Attach the joint to the link of its own side.

    Source:
        Sides are words such as FL, RR, left and r in the names of the links. Fixed joints are not
        checked.
    """
    tree = robot.tree
    for joint in tree.parent_joint.values():
        own, other = side_words(joint.child), side_words(joint.parent)
        is_paired = len(own) == len(other) == 1 and own[0].lower() != other[0].lower()
        if not is_paired or not joint.moves:
            continue  # a stereo camera has a left and a right frame
        expected = re.sub(rf"(?<![A-Za-z]){other[0]}(?![a-z])", own[0], joint.parent, count=1)
        lacks_child = expected in tree.links and len(tree.child_joints.get(expected, ())) < len(
            tree.child_joints[joint.parent]
        )
        if lacks_child and expected != joint.parent:
            yield Violation(
                element=joint,
                message=f"parent of link {truncate(joint.child)} in joint {truncate(joint.name)}: "
                f"got {truncate(joint.parent)}; expected {truncate(expected)}, which lacks a child",
            )

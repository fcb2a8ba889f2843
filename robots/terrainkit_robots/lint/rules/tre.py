"""TRE: rules on the kinematic tree of links and joints."""

import re
from collections.abc import Iterator, Mapping, Sequence

from terrainkit.settings.text import closest, truncate
from terrainkit_robots.analysis.bodies.tree import Tree
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.symmetry.mirror import side_words
from terrainkit_robots.description.fix import Fix, InsertChild
from terrainkit_robots.description.model import Joint, Link
from terrainkit_robots.lint.rule import Violation, get_rule, rule
from terrainkit_robots.text import names

_MAX_SUGGESTIONS = 20
"""Maximum number of unknown names for which a similar name is suggested. Generated files may have
thousands."""

_MIN_SIMILARITY = 0.6
"""Minimum share of common letters for a suggestion, as in difflib."""

_MAX_COMPARED = 20_000
"""Maximum number of links to search for a suggestion. More would take seconds."""


def _nearest(name: str, others: Sequence[str]) -> str:
    """Return the most similar name, or an empty text if none is similar."""
    return "" if len(others) > _MAX_COMPARED else closest(name, others, _MIN_SIMILARITY)


def _duplicates(items: Sequence[Link] | Sequence[Joint]) -> Mapping[str, list[Link | Joint]]:
    """Return the items that share a name. XML013 reports missing names."""
    by_name: dict[str, list[Link | Joint]] = {}
    for item in items:
        if item.name:
            by_name.setdefault(item.name, []).append(item)
    return {name: same for name, same in by_name.items() if len(same) > 1}


@rule("TRE001", "duplicate-name", "error")
def duplicate_name(robot: Facts) -> Iterator[Violation]:
    """Two links or two joints have the same name.

    Names identify links and joints. urdfdom rejects the file. MuJoCo accepts a second joint of the
    same name, but silently drops its limits. The rest of this report uses the first one.

    Fix:
        Give each a unique name and update the references to the second one.

    Source:
        urdfdom: `joint '...' is not unique`; MuJoCo: `repeated URDF name`, for links only.
    """
    model = robot.model
    for problem in model.problems:
        if problem.code == "TRE001":
            yield Violation(subject=problem.subject, source=problem.source, message=problem.message)
    for what, items in (
        ("links", [link for link in model.links if not link.virtual]),
        ("joints", model.joints),
    ):
        for name, same in _duplicates(items).items():
            lines = names(str(item.source.line) for item in same)
            yield Violation(
                subject=name,
                source=same[1].source,
                message=f"name {truncate(name)}: used by {len(same)} {what}, on lines {lines}; "
                "expected unique names",
                measured={"count": len(same)},
            )


@rule("TRE002", "unknown-link", "error")
def unknown_link(robot: Facts) -> Iterator[Violation]:
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
    missing: dict[str, list[tuple[str, Joint]]] = {}
    for joint, reason in robot.tree.rejected:
        for role, name in (("parent", joint.parent), ("child", joint.child)):
            # XML013 reports a missing name.
            if reason == "unknown-link" and name and name not in links:
                missing.setdefault(name, []).append((role, joint))
    for index, (name, uses) in enumerate(missing.items()):
        joints = names(f"{role} of joint {joint.name}" for role, joint in uses)
        yield Violation(
            subject=uses[0][1].name,
            source=uses[0][1].source,
            message=f"link {truncate(name)}: does not exist, but is the {joints}; expected a "
            "link in the file",
            hint=_suggestion(robot, name) if index < _MAX_SUGGESTIONS else "",
        )


def _suggestion(robot: Facts, name: str) -> str:
    """Return a hint with the link of the most similar name, if there is one."""
    detached = _nearest(name, robot.tree.roots[1:])
    nearest = detached or _nearest(name, list(robot.tree.links))
    return f"Did you mean {nearest}? Names are case-sensitive." if nearest else ""


@rule("TRE003", "multiple-parents", "error")
def multiple_parents(robot: Facts) -> Iterator[Violation]:
    """A link is the child of two joints.

    A URDF describes a tree and cannot describe a closed kinematic loop. Readers reject the file, or
    drop one of the joints.

    Fix:
        Remove all but one of these joints. Close a loop in MJCF with <equality><connect>, in SDF,
        or in the simulator.

    Source:
        wiki.ros.org/urdf/XML: a URDF describes a tree; MuJoCo: `URDF body has multiple parents`.
    """
    extra: dict[str, list[Joint]] = {}
    for joint, reason in robot.tree.rejected:
        if reason == "second-parent":
            extra.setdefault(joint.child, []).append(joint)
    first = {joint.child: joint for joint in reversed(robot.model.joints)}
    for child, joints in extra.items():
        listed = names(joint.name for joint in (first[child], *joints))
        yield Violation(
            subject=child,
            source=joints[0].source,
            message=f"link {truncate(child)}: child of {len(joints) + 1} joints ({listed}); "
            "expected 1",
            measured={"joints": len(joints) + 1},
        )


@rule("TRE004", "cycle", "error")
def cycle(robot: Facts) -> Iterator[Violation]:
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
                subject=links[0],
                source=closing[links[0]].source,
                message=f"cycle of {size}: {path}; expected a tree",
                measured={"links": len(links)},
            )


@rule("TRE005", "multiple-roots", "error")
def multiple_roots(robot: Facts) -> Iterator[Violation]:
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
            subject=name,
            source=robot.tree.links[name].source,
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
    for child in unknown[:_MAX_SUGGESTIONS]:
        if others:
            others.remove(_nearest(child, others) or others[0])
    return root, others[len(unknown[_MAX_SUGGESTIONS:]) :]


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


@rule("TRE006", "no-links", "error")
def no_links(robot: Facts) -> Iterator[Violation]:
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
        subject=model.title,
        source=model.source,
        message=f"number of {what}: got 0, with {len(model.joints)} joints; expected at least 1",
    )


@rule("TRE007", "no-free-joint", "error", fixes="safe", needs=("legs",))
def no_free_joint(robot: Facts) -> Iterator[Violation]:
    """A legged MJCF robot has no free joint.

    MuJoCo welds a body without joints to its parent. The trunk is then fixed to the world, and the
    robot cannot move.

    Fix:
        Add <freejoint/> as the first element of the trunk's body, and insert its 7 values at the
        front of qpos in every keyframe.

    Source:
        MuJoCo's XML reference, body/freejoint.
    """
    model, tree = robot.model, robot.tree
    if model.kind != "mjcf" or not tree.order:
        return
    root = tree.links[tree.order[0]]
    if any(
        joint.parent == "world" and joint.child == root.name and joint.kind != "fixed"
        for joint in model.joints
    ):
        return
    fix = None
    if root.source.element is not None and not model.keyframe:
        edit = InsertChild(source=root.source, xml="<freejoint/>", first=True)
        fix = Fix(safety="safe", description=f"Add <freejoint/> to {root.name}.", edits=(edit,))
    yield Violation(
        subject=root.name,
        source=root.source,
        message=f"body {root.name}: is welded to the world, but the robot has {len(robot.legs)} "
        "legs; expected a free joint",
        certainty="likely",
        measured={"legs": len(robot.legs)},
        fix=fix,
    )


@rule("TRE008", "inner-floating-joint", "error")
def inner_floating_joint(robot: Facts) -> Iterator[Violation]:
    """A floating or planar joint is inside the robot.

    The links below such a joint are not attached to the robot: they fall off or drift away. MuJoCo
    rejects a free joint inside the tree, and other simulators replace it by a fixed joint.

    Fix:
        Use the joint type of the real robot. A floating joint belongs between the world (an empty
        root link) and the trunk.

    Source:
        wiki.ros.org/urdf/XML/joint; MuJoCo: `free joint can only be used on top level`.
    """
    tree = robot.tree
    for joint in tree.parent_joint.values():
        if joint.kind in ("floating", "planar") and not _is_world(robot, joint.parent):
            yield Violation(
                subject=joint.name,
                source=joint.source,
                message=f"type of joint {truncate(joint.name)} between links "
                f"{truncate(joint.parent)} and {truncate(joint.child)}: got {joint.kind}; expected "
                "fixed, revolute, continuous or prismatic",
            )


def _is_world(robot: Facts, name: str) -> bool:
    """Return whether a link is a root that represents the world."""
    return name not in robot.tree.parent_joint and (
        name == "world" or _is_empty(robot.tree.links[name])
    )


def _is_empty(link: Link) -> bool:
    """Return whether a link has neither mass nor collision shapes. It may have visuals."""
    return link.inertial is None and not link.collisions


@rule("TRE009", "dummy-root", "info")
def dummy_root(robot: Facts) -> Iterator[Violation]:
    """The root link is empty and has the trunk as its fixed child.

    Such a dummy root is common, because KDL does not support a root link with inertia. But the
    trunk then has two names: simulators that merge fixed joints use the name of the root, others
    use the name of the trunk. A configuration with the other name matches nothing. If the root is
    called `world`, MuJoCo and Gazebo fix the robot to the ground, which is a warning.

    Fix:
        Nothing, if your configuration uses the same name as your simulator. If a legged robot is
        attached to a link called `world` by a fixed joint, remove both, or make the joint floating.

    Source:
        KDL's warning about a root link with inertia; Isaac Gym: collapse_fixed_joints.
    """
    tree, bodies = robot.tree, robot.bodies
    if not tree.order or not bodies or bodies[0].top.name != tree.order[0]:
        return
    root, trunk = bodies[0].top, bodies[0].name
    if root.virtual or not _is_empty(root) or bodies[0].mass <= 0:
        return
    joint = tree.parent_joint[trunk]
    while joint.parent != root.name:
        joint = tree.parent_joint[joint.parent]
    is_welded = root.name == "world" and robot.model.kind != "mjcf" and bool(robot.legs)
    yield Violation(
        subject=root.name,
        source=root.source,
        message=f"root link {truncate(root.name)}: has no mass and no collision shape; the trunk "
        f"is {truncate(trunk)}, attached by the fixed joint {truncate(joint.name)}"
        + (", which welds it to the world; expected a floating joint" if is_welded else ""),
        severity="warning" if is_welded else None,
    )


@rule("TRE010", "invalid-reference", "warning")
def invalid_reference(robot: Facts) -> Iterator[Violation]:
    """A tag for another tool, or the SRDF, names a link or joint that does not exist.

    The names in <gazebo>, <transmission>, <sensor>, <ros2_control> and the SRDF were not changed
    when a link or joint was renamed, removed or copied. A sensor, the friction of a foot or a motor
    is then missing in that tool, or its controllers do not start. Two simple transmissions of one
    joint are reported as well: another joint lacks its own.

    Fix:
        Correct the name, or remove the element.

    Source:
        wiki.ros.org/urdf/XML: gazebo, transmission and sensor; wiki.ros.org/srdf. An SRDF belongs
        to the URDF of the same file name, beside it or in srdf/ or config/ of the package.
    """
    for problem in robot.model.problems:
        if problem.code == "TRE010":
            yield Violation(
                subject=problem.subject or problem.source.file.name,
                source=problem.source,
                message=problem.message,
            )


@rule("TRE011", "parent-of-another-leg", "warning")
def parent_of_another_leg(robot: Facts) -> Iterator[Violation]:
    """A link is attached to the link of another leg or side.

    Its name says one side and that of its parent another one, while the parent of its own side has
    no such child. The parent was not changed after copying the joint.

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
                subject=joint.name,
                source=joint.source,
                certainty="likely",
                message=f"parent of link {truncate(joint.child)} in joint {truncate(joint.name)}: "
                f"got {truncate(joint.parent)}; expected {truncate(expected)}, which lacks a child",
            )

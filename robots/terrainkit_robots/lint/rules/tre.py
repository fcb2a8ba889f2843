"""The tree: whether the joints hang the links into one."""

from collections.abc import Iterator, Mapping, Sequence

from terrainkit_robots.analysis.bodies.tree import Tree
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.fix import Fix, InsertChild
from terrainkit_robots.description.model import Joint, Link
from terrainkit_robots.lint.rule import Violation, get_rule, rule
from terrainkit_robots.text import closest, names, short

_MOST_MEANT = 20
"""Of so many names that are not there it is looked up which one was meant; a generated file may
have thousands."""

_ALIKE = 0.6
"""From this share of common letters on, a name is suggested for another; as difflib does."""

_MOST_COMPARED = 20_000
"""With more links than this a name is not compared: it would take seconds."""


def _most_alike(name: str, others: Sequence[str]) -> str:
    """Return the one of `others` that is the most like `name`, if any is."""
    return "" if len(others) > _MOST_COMPARED else closest(name, others, _ALIKE)


def _repeated(items: Sequence[Link] | Sequence[Joint]) -> Mapping[str, list[Link | Joint]]:
    """Return those of the same name; what has no name is told elsewhere."""
    named: dict[str, list[Link | Joint]] = {}
    for item in items:
        if item.name:
            named.setdefault(item.name, []).append(item)
    return {name: same for name, same in named.items() if len(same) > 1}


@rule("TRE001", "duplicate-name", "error")
def duplicate_name(robot: Facts) -> Iterator[Violation]:
    """Two links or two joints have the same name.

    A name is how everything else refers to a link or joint. urdfdom refuses the file; MuJoCo takes
    a second joint of the same name without a word, and gives it the limits of none. The rest of
    this report takes the first one.

    Fix:
        Give each a name of its own, and change what refers to the second one.

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
        for name, same in _repeated(items).items():
            lines = names(str(item.source.line) for item in same)
            yield Violation(
                subject=name,
                source=same[1].source,
                message=f"{len(same)} {what} are called {short(name)}, on lines {lines}; "
                "wanted a name of its own for each",
                measured={"count": len(same)},
            )


@rule("TRE002", "unknown-link", "error")
def unknown_link(robot: Facts) -> Iterator[Violation]:
    """A joint names a link that is not there.

    The joint has no place in the tree, and all that hangs below it comes off: some readers refuse
    the file, others go on without a leg.

    Fix:
        Correct the name, or add the link. Names are compared letter by letter, case included.

    Source:
        urdfdom: `child link [...] of joint [...] not found`; MuJoCo: `URDF joint parent or child
        missing`.
    """
    links = robot.tree.links
    missing: dict[str, list[tuple[str, Joint]]] = {}
    for joint, reason in robot.tree.left_out:
        for role, name in (("parent", joint.parent), ("child", joint.child)):
            # One without any name is told as an attribute that is missing.
            if reason == "unknown-link" and name and name not in links:
                missing.setdefault(name, []).append((role, joint))
    for place, (name, uses) in enumerate(missing.items()):
        joints = names(f"{role} of joint {joint.name}" for role, joint in uses)
        yield Violation(
            subject=uses[0][1].name,
            source=uses[0][1].source,
            message=f"link {short(name)} is not there, but is the {joints}; wanted a link of the "
            "file",
            hint=_suggestion(robot, name) if place < _MOST_MEANT else "",
        )


def _suggestion(robot: Facts, name: str) -> str:
    """Return a hint at the link that was meant, if there is one with a name like it."""
    loose = _most_alike(name, robot.tree.roots[1:])
    meant = loose or _most_alike(name, list(robot.tree.links))
    if not meant:
        return ""
    return f"Is link {meant} meant? Names are compared letter by letter, case included."


@rule("TRE003", "multiple-parents", "error")
def multiple_parents(robot: Facts) -> Iterator[Violation]:
    """A link is the child of two joints.

    A URDF is a tree. A linkage that closes a loop cannot be written in it, and readers refuse the
    file, or drop one of the joints.

    Fix:
        Keep the joint that carries the link. Close a loop in MJCF with <equality><connect>, in SDF,
        or in the simulator.

    Source:
        wiki.ros.org/urdf/XML: a URDF describes a tree; MuJoCo: `URDF body has multiple parents`.
    """
    extra: dict[str, list[Joint]] = {}
    for joint, reason in robot.tree.left_out:
        if reason == "second-parent":
            extra.setdefault(joint.child, []).append(joint)
    first = {joint.child: joint for joint in reversed(robot.model.joints)}
    for child, joints in extra.items():
        listed = names(joint.name for joint in (first[child], *joints))
        yield Violation(
            subject=child,
            source=joints[0].source,
            message=f"link {short(child)} is the child of {len(joints) + 1} joints, {listed}; "
            "wanted one",
            measured={"joints": len(joints) + 1},
        )


@rule("TRE004", "cycle", "error")
def cycle(robot: Facts) -> Iterator[Violation]:
    """Joints hang links in a circle.

    Each link of the circle is above all others and below them, so none of them is connected to the
    robot. Readers refuse the file, loop for ever, or lose the links.

    Fix:
        Look for the joint whose parent and child are exchanged.

    Source:
        urdfdom: `No root link found. The robot xml is not a valid tree.`; MuJoCo: `URDF body not
        found`.
    """
    # Where a link has a second parent, the joint that closes the circle is told as that.
    two_parents = {j.child for j, reason in robot.tree.left_out if reason == "second-parent"}
    closing = {joint.child: joint for joint, why in robot.tree.left_out if why == "cycle"}
    for circle in robot.tree.cycles:
        if two_parents.isdisjoint(circle):
            around = [circle[0], *circle[:0:-1], circle[0]]
            what = (
                f"{len(circle)} links hang in a circle" if circle[1:] else "a link hangs on itself"
            )
            yield Violation(
                subject=circle[0],
                source=closing[circle[0]].source,
                message=f"{what}: {names(around, separator=' > ')}; wanted a tree",
                measured={"links": len(circle)},
            )


@rule("TRE005", "multiple-roots", "error")
def multiple_roots(robot: Facts) -> Iterator[Violation]:
    """A link hangs on nothing, and is not the root.

    urdfdom refuses a file with two roots. MuJoCo welds the second one to the world without a word,
    where it floats in the air, and the robot walks away without it.

    Fix:
        Add the joint that holds it, or remove the link.

    Source:
        urdfdom: `Two root links found`; MuJoCo 4.0, tried.
    """
    if robot.model.kind == "mjcf":
        return  # bodies beside the robot are its surroundings
    root, loose = _roots(robot.tree)
    for name in loose:
        yield Violation(
            subject=name,
            source=robot.tree.links[name].source,
            message=f"link {short(name)} is the child of no joint, and is not the root either, "
            f"which is {short(root)}; wanted one root",
        )


def _roots(tree: Tree) -> tuple[str, list[str]]:
    """Return the root, and others that are not there because of a joint that is told of."""
    group = _groups(tree)
    told = {
        group[joint.child]
        for joint, why in tree.left_out
        if why in ("unknown-link", "cycle") and joint.child in group
    }
    root, *loose = [n for n in tree.roots if group[n] == n and n not in told] or [""]
    # A joint whose child is not there holds one of these, under another name.
    misnamed = [joint.child for joint, _ in tree.left_out if joint.child not in tree.links]
    for child in misnamed[:_MOST_MEANT]:
        if loose:
            loose.remove(_most_alike(child, loose) or loose[0])
    return root, loose[len(misnamed[_MOST_MEANT:]) :]


def _groups(tree: Tree) -> dict[str, str]:
    """Return for each link the first root of those that it is joined to, up or down.

    Joints that have no place in the tree count: each of them is told of already.
    """
    beside: dict[str, list[str]] = {name: [] for name in tree.links}
    for joint in (*tree.above.values(), *(joint for joint, _ in tree.left_out)):
        if joint.parent in beside and joint.child in beside:
            beside[joint.parent].append(joint.child)
            beside[joint.child].append(joint.parent)
    group: dict[str, str] = {}
    for root in tree.roots:
        stack = [root]
        while stack:
            name = stack.pop()
            if name not in group:
                group[name] = root
                stack += beside[name]
    return group


@rule("TRE006", "no-links", "error")
def no_links(robot: Facts) -> Iterator[Violation]:
    """The robot has no links.

    MuJoCo loads such a file as an empty world, and training goes on with nothing in it.

    Fix:
        Check that this is the file you meant, and that its links are directly in <robot>, or its
        bodies in <worldbody>.

    Source:
        urdfdom: `No link elements found in urdf file`; MuJoCo 4.0, tried.
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
        message=f"the robot has 0 {what} and {len(model.joints)} joints; wanted at least 1 of them",
    )


@rule("TRE007", "no-free-joint", "error", fixes="safe", needs=("legs",))
def no_free_joint(robot: Facts) -> Iterator[Violation]:
    """A MJCF robot with legs has no free joint: it is welded to the world.

    Without a joint MuJoCo makes the trunk a part of the world. The legs hang in the air, and
    whatever the policy does, the robot does not move.

    Fix:
        Put <freejoint/> into the body of the trunk, as its first element, and add its seven numbers
        to the front of qpos in every keyframe.

    Source:
        MuJoCo's documentation, XML reference, body/freejoint: a body without joints is welded to
        its parent.
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
    if root.source.element is not None and not model.home:
        edit = InsertChild(source=root.source, xml="<freejoint/>", first=True)
        fix = Fix(safety="safe", description=f"Put <freejoint/> into {root.name}.", edits=(edit,))
    yield Violation(
        subject=root.name,
        source=root.source,
        message=f"body {root.name} has no joint to the world, so it is welded there, but the robot "
        f"has {len(robot.legs)} legs; wanted a free joint",
        certainty="likely",
        measured={"legs": len(robot.legs)},
        fix=fix,
    )


@rule("TRE008", "inner-floating-joint", "error")
def inner_floating_joint(robot: Facts) -> Iterator[Violation]:
    """A floating or planar joint lies inside the robot.

    What hangs on it is connected to the rest by nothing: it falls off, or drifts away in a plane.
    MuJoCo refuses a free joint there, and other simulators take it for a fixed one.

    Fix:
        Give the joint the type that it has on the robot. A floating joint belongs between the world
        (an empty root link) and the trunk.

    Source:
        wiki.ros.org/urdf/XML/joint; MuJoCo: `free joint can only be used on top level`.
    """
    tree = robot.tree
    for joint in tree.above.values():
        if joint.kind in ("floating", "planar") and not _stands_for_world(robot, joint.parent):
            yield Violation(
                subject=joint.name,
                source=joint.source,
                message=f"joint {short(joint.name)} between {short(joint.parent)} and "
                f"{short(joint.child)} is {joint.kind}, which connects the two by nothing; wanted "
                "a fixed joint, or one with a single axis",
            )


def _stands_for_world(robot: Facts, name: str) -> bool:
    """Return whether a link is a root that only says where the robot is."""
    return name not in robot.tree.above and (name == "world" or _is_empty(robot.tree.links[name]))


def _is_empty(link: Link) -> bool:
    """Return whether a link is only a frame; some are drawn, so that they are seen."""
    return link.inertial is None and not link.collisions


@rule("TRE009", "dummy-root", "info")
def dummy_root(robot: Facts) -> Iterator[Violation]:
    """The root link is empty, and the trunk hangs on it by a fixed joint.

    That is common, for readers that want a root without inertia. But the trunk then has two names:
    a simulator that merges fixed joints calls it by the root's, others by its own, and what a
    configuration says of the one that is not there is never true. A root called world is worse:
    MuJoCo and Gazebo bolt what hangs on it to the ground.

    Fix:
        Nothing, if your configuration uses the name that your simulator does. A robot that walks
        should not hang on a fixed joint below a link called world: remove both, or make the joint
        floating.

    Source:
        KDL's warning about a root link with inertia, which is why people add one; Isaac Gym:
        collapse_fixed_joints.
    """
    tree, bodies = robot.tree, robot.bodies
    if not tree.order or not bodies or bodies[0].top.name != tree.order[0]:
        return
    root, trunk = bodies[0].top, bodies[0].name
    if root.virtual or not _is_empty(root) or bodies[0].mass <= 0:
        return
    joint = tree.above[trunk]
    while joint.parent != root.name:
        joint = tree.above[joint.parent]
    bolted = root.name == "world" and robot.model.kind != "mjcf" and bool(robot.legs)
    yield Violation(
        subject=root.name,
        source=root.source,
        message=f"root link {short(root.name)} has no mass and no collision shape; the trunk is "
        f"{short(trunk)}, on the fixed joint {short(joint.name)}"
        + (", and is bolted to the world; wanted a floating joint, or none" if bolted else ""),
        severity="warning" if bolted else None,
    )

"""Build the tree of links.

A file can refer to missing links, give a link two parents, or contain a cycle. The tree then keeps
the joints that fit, and records the rejected joints with the reason.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from terrainkit_robots.description.model import WORLD, Joint, Link, RobotModel

Reason = Literal["duplicate", "unknown-link", "second-parent", "cycle"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Tree:
    """A forest of links, and its main tree."""

    roots: tuple[str, ...]
    """Links without a parent. The first one is the root of the robot: of the links that never had a
    parent, the link with the most descendants."""

    links: Mapping[str, Link]
    """The first link of each name."""

    parent_joint: Mapping[str, Joint]
    """The joint above each link that has one."""

    child_joints: Mapping[str, tuple[Joint, ...]]
    """The joints below each link, in the order of the file."""

    order: tuple[str, ...]
    """Links of the main tree, depth first, each after its parent."""

    rejected: tuple[tuple[Joint, Reason], ...]
    """Joints that do not fit into a tree."""

    cycles: tuple[tuple[str, ...], ...]
    """Cycles of links."""


def build_tree(model: RobotModel, base: str | None = None) -> Tree:
    """Return the tree of a robot. The world body of MJCF is not part of it.

    Args:
        model: The robot.
        base: The root of the robot, if it is known.
    """
    links: dict[str, Link] = {}
    for link in model.links:
        links.setdefault(link.name, link)
    parent_joint, rejected = _parent_joints(model, links)
    cycles = _detect_cycles(parent_joint)
    for cycle in cycles:
        rejected.append((parent_joint.pop(cycle[0]), "cycle"))
    child_joints: dict[str, list[Joint]] = {name: [] for name in links}
    for joint in parent_joint.values():
        child_joints[joint.parent].append(joint)
    orders = {
        root: (root, *(joint.child for joint in depth_first(child_joints, root)))
        for root in links
        if root not in parent_joint
    }
    # A root whose joint was rejected is not the root of the robot; among others the first wins.
    orphans = {joint.child for joint, _ in rejected}
    roots = sorted(orders, key=lambda root: (root != base, root in orphans, -len(orders[root])))
    return Tree(
        roots=tuple(roots),
        links=links,
        parent_joint=parent_joint,
        child_joints={name: tuple(joints) for name, joints in child_joints.items()},
        order=orders[roots[0]] if roots else (),
        rejected=tuple(rejected),
        cycles=tuple(cycles),
    )


def _parent_joints(
    model: RobotModel, links: Mapping[str, Link]
) -> tuple[dict[str, Joint], list[tuple[Joint, Reason]]]:
    parent_joint: dict[str, Joint] = {}
    rejected: list[tuple[Joint, Reason]] = []
    seen: set[str] = set()
    for joint in model.joints:
        if joint.parent == WORLD and WORLD not in links and model.kind == "mjcf":
            continue  # connects a root to the world, not two links
        if joint.name in seen and joint.child in parent_joint:
            rejected.append((joint, "duplicate"))
        elif joint.parent not in links or joint.child not in links:
            rejected.append((joint, "unknown-link"))
        elif joint.child in parent_joint:
            rejected.append((joint, "second-parent"))
        else:
            parent_joint[joint.child] = joint
        seen.add(joint.name)
    return parent_joint, rejected


def _detect_cycles(parent_joint: Mapping[str, Joint]) -> list[tuple[str, ...]]:
    """Return the cycles, each from its first link in the file upwards."""
    seen: set[str] = set()
    cycles = []
    for start in parent_joint:
        path: dict[str, None] = {}
        link = start
        while link in parent_joint and link not in seen and link not in path:
            path[link] = None
            link = parent_joint[link].parent
        if link in path:
            names = list(path)
            cycles.append(tuple(names[names.index(link) :]))
        seen.update(path)
    return cycles


def depth_first(child_joints: Mapping[str, Sequence[Joint]], base: str) -> Iterator[Joint]:
    """Yield the joints below a link depth first, siblings in their order."""
    stack = list(reversed(child_joints[base]))
    while stack:
        joint = stack.pop()
        yield joint
        stack.extend(reversed(child_joints[joint.child]))

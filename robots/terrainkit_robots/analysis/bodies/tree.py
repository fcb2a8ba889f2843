"""The tree: links in the order in which joints hang them, whatever the file says.

A file can name links that are not there, hang one under two others, or close a circle. Of such a
file the tree keeps what makes sense, and says which joints it left out and why.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from terrainkit_robots.description.model import Joint, Link, RobotModel

Reason = Literal["duplicate", "unknown-link", "second-parent", "cycle"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Tree:
    """A forest of links, and its main tree."""

    roots: tuple[str, ...]
    """Links without a parent; the first is the robot. It is the one with the most descendants of
    those that never had a parent."""

    links: Mapping[str, Link]
    """The first link of each name."""

    above: Mapping[str, Joint]
    """The joint above each link that has one."""

    below: Mapping[str, tuple[Joint, ...]]
    """The joints below each link, in the order of the file."""

    order: tuple[str, ...]
    """Links of the main tree, each after its parent, depth first."""

    left_out: tuple[tuple[Joint, Reason], ...]
    """Joints that have no place in a tree."""

    cycles: tuple[tuple[str, ...], ...]
    """Circles of links."""


def build_tree(model: RobotModel) -> Tree:
    """Return the tree of a robot; the world of MJCF is not part of it."""
    links: dict[str, Link] = {}
    for link in model.links:
        links.setdefault(link.name, link)
    above, left_out = _parents(model, links)
    cycles = _cycles(above)
    for cycle in cycles:
        left_out.append((above.pop(cycle[0]), "cycle"))
    below: dict[str, list[Joint]] = {name: [] for name in links}
    for joint in above.values():
        below[joint.parent].append(joint)
    children = {name: [j.child for j in joints] for name, joints in below.items()}
    orders = {root: _depth_first(root, children) for root in links if root not in above}
    # A root that only lost its joint is not where the robot begins; of others the first wins.
    lost = {joint.child for joint, _ in left_out}
    roots = sorted(orders, key=lambda root: (root in lost, -len(orders[root])))
    return Tree(
        roots=tuple(roots),
        links=links,
        above=above,
        below={name: tuple(joints) for name, joints in below.items()},
        order=tuple(orders[roots[0]]) if roots else (),
        left_out=tuple(left_out),
        cycles=tuple(cycles),
    )


def _parents(
    model: RobotModel, links: Mapping[str, Link]
) -> tuple[dict[str, Joint], list[tuple[Joint, Reason]]]:
    above: dict[str, Joint] = {}
    left_out: list[tuple[Joint, Reason]] = []
    seen: set[str] = set()
    for joint in model.joints:
        if joint.parent == "world" and "world" not in links and model.kind == "mjcf":
            continue  # what holds a root is not between two links
        if joint.name in seen and joint.child in above:
            left_out.append((joint, "duplicate"))
        elif joint.parent not in links or joint.child not in links:
            left_out.append((joint, "unknown-link"))
        elif joint.child in above:
            left_out.append((joint, "second-parent"))
        else:
            above[joint.child] = joint
        seen.add(joint.name)
    return above, left_out


def _cycles(above: Mapping[str, Joint]) -> list[tuple[str, ...]]:
    """Return the circles, each from its first link in the file on, upwards."""
    done: set[str] = set()
    cycles = []
    for start in above:
        path: dict[str, None] = {}
        at = start
        while at in above and at not in done and at not in path:
            path[at] = None
            at = above[at].parent
        if at in path:
            walked = list(path)
            cycles.append(tuple(walked[walked.index(at) :]))
        done.update(path)
    return cycles


def _depth_first(root: str, children: Mapping[str, list[str]]) -> list[str]:
    order, stack = [], [root]
    while stack:
        link = stack.pop()
        order.append(link)
        stack.extend(reversed(children[link]))
    return order

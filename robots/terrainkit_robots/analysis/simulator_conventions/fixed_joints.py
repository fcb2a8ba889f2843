"""Compute which fixed joints each simulator merges, and which feet disappear by that.

Most importers merge a link on a fixed joint into its parent, because the two move as one. The
merged body has the name of the parent, and a contact force that is looked up by the name of the
merged link, such as a foot, does not exist.
"""

from collections.abc import Iterable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from typing import Literal, get_args

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.tree import Tree
from terrainkit_robots.description.model import Joint, Kind

Simulator = Literal["MuJoCo", "Isaac Gym", "Isaac Lab", "Genesis", "PyBullet"]

SIMULATORS: tuple[Simulator, ...] = get_args(Simulator)

_READS_DONT_COLLAPSE = frozenset({"Isaac Gym", "Isaac Lab"})


@dataclass(frozen=True, kw_only=True, eq=False)
class MergedTree:
    """The tree of links after fixed joints are merged."""

    base: str
    """Name of the root body."""

    body_of: Mapping[str, str]
    """Name of the body of each link, by name of the link. A body is named after its top link."""

    child_joints: Mapping[str, tuple[Joint, ...]]
    """The joints below each body. The joints of a merged link replace the joint above it."""


def merge_joints(tree: Tree, bodies: Sequence[Body], merged: AbstractSet[Joint]) -> MergedTree:
    """Return the main tree below the base with some joints merged.

    Args:
        tree: The tree of links.
        bodies: Its bodies, at least one.
        merged: The joints to merge.
    """
    base = bodies[0].top.name
    links = {link.name for body in bodies for link in body.links}
    body_of = {base: base}
    child_joints: dict[str, list[Joint]] = {base: []}
    for link in tree.order:  # depth first, each after its parent
        if link == base or link not in links:
            continue
        joint = tree.parent_joint[link]
        parent = body_of[joint.parent]
        if joint in merged:
            body_of[link] = parent
        else:
            body_of[link] = link
            child_joints[link] = []
            child_joints[parent].append(joint)
    return MergedTree(
        base=base,
        body_of=body_of,
        child_joints={body: tuple(joints) for body, joints in child_joints.items()},
    )


def fixed_joints(kind: Kind, tree: Tree, bodies: Sequence[Body]) -> tuple[Joint, ...]:
    """Return the joints inside the bodies of a URDF: fixed joints and joints of unknown type.

    Empty for MJCF, whose bodies no simulator merges.
    """
    if kind == "mjcf":
        return ()
    return tuple(tree.parent_joint[link.name] for body in bodies for link in body.links[1:])


def merged_joints(
    fixed: Iterable[Joint], simulator: Simulator, *, keeps_fixed_links: bool = False
) -> frozenset[Joint]:
    """Return the fixed joints that a simulator merges by default.

    MuJoCo, Isaac Lab and Genesis merge; Isaac Gym merges as configured by legged_gym and its forks;
    PyBullet does not merge.

    Args:
        fixed: The fixed joints of a robot.
        simulator: The simulator.
        keeps_fixed_links: Whether the file tells MuJoCo to merge none.
    """
    if simulator == "PyBullet" or (simulator == "MuJoCo" and keeps_fixed_links):
        return frozenset()
    reads_attribute = simulator in _READS_DONT_COLLAPSE
    return frozenset(joint for joint in fixed if not (joint.dont_collapse and reads_attribute))


def kept_bodies(tree: Tree, body: Body) -> tuple[Body, ...]:
    """Return the parts of a body that `dont_collapse` keeps as bodies of their own."""
    top_of: dict[str, str] = {}
    for link in body.links:  # each after its parent
        joint = tree.parent_joint.get(link.name)
        inner = joint is not None and joint.parent in top_of and not joint.dont_collapse
        top_of[link.name] = top_of[joint.parent] if joint and inner else link.name
    parts = []
    for top in list(dict.fromkeys(top_of.values()))[1:]:
        chosen = [k for k, link in enumerate(body.links) if top_of[link.name] == top]
        links = tuple(body.links[k] for k in chosen)
        parts.append(replace(body, links=links, poses=tuple(body.poses[k] for k in chosen)))
    return tuple(parts)

"""Compute which fixed joints each simulator merges, and which feet disappear by that.

Most importers merge a link on a fixed joint into its parent, because the two move as one. The
merged body has the name of the parent, and a contact force that is looked up by the name of the
merged link, such as a foot, does not exist.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, get_args

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.tree import Tree
from terrainkit_robots.description.model import Joint

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts

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


def merge_joints(robot: "Facts", merged: Collection[Joint]) -> MergedTree:
    """Return the main tree of a robot with bodies below its base, with some joints merged."""
    base, tree = robot.bodies[0].top.name, robot.tree
    body_of = {base: base}
    child_joints: dict[str, list[Joint]] = {base: []}
    for link in tree.order:  # depth first, each after its parent
        if link == base or link not in robot.body_of:
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


def merged_tree(robot: "Facts", simulator: Simulator) -> MergedTree:
    """Return the main tree with the fixed joints merged that a simulator merges by default.

    MuJoCo, Isaac Lab and Genesis merge, MuJoCo unless the file tells it not to; Isaac Gym merges as
    configured by legged_gym and its forks; PyBullet does not merge.
    """
    merged = set(robot.fixed_joints)
    if simulator == "PyBullet" or (simulator == "MuJoCo" and robot.model.keeps_fixed_links):
        merged = set()
    elif simulator in _READS_DONT_COLLAPSE:
        merged = {joint for joint in merged if not joint.dont_collapse}
    return merge_joints(robot, merged)


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

"""Compute which fixed joints each simulator merges, and which feet disappear by that.

Most importers merge a link on a fixed joint into its parent, because the two move as one. The
merged body has the name of the parent, and a contact force that is looked up by the name of the
merged link, such as a foot, does not exist.
"""

from collections.abc import Iterable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal, get_args

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.tree import Tree
from terrainkit_robots.analysis.legs.legs import Leg
from terrainkit_robots.description.model import Joint, Kind

Simulator = Literal["MuJoCo", "Isaac Gym", "Isaac Lab", "Genesis"]

SIMULATORS: tuple[Simulator, ...] = get_args(Simulator)

KEEP_LINK_OPTIONS: Mapping[Simulator, str] = MappingProxyType(
    {
        "MuJoCo": '<mujoco><compiler fusestatic="false"/></mujoco> in the URDF',
        "Isaac Gym": 'dont_collapse="true" on the joint, or collapse_fixed_joints = False',
        "Isaac Lab": 'dont_collapse="true" on the joint, or merge_fixed_joints=False',
        "Genesis": "links_to_keep=[...] of gs.morphs.URDF, or merge_fixed_links=False",
    }
)
"""How to keep a link on a fixed joint as a separate body. MuJoCo, Isaac Lab and Genesis merge by
default; Isaac Gym merges as configured by legged_gym and its forks."""

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


@dataclass(frozen=True, kw_only=True, eq=False)
class MergedFoot:
    """A foot that some simulators merge into its parent."""

    foot: str
    """Name of the link."""

    joint: Joint
    """The fixed joint above it."""

    merged_body: Mapping[Simulator, str]
    """Name of the merged body, by simulator that merges it."""


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


def merged_joints(fixed: Iterable[Joint], simulator: Simulator) -> frozenset[Joint]:
    """Return the fixed joints that a simulator merges by default."""
    reads_attribute = simulator in _READS_DONT_COLLAPSE
    return frozenset(joint for joint in fixed if not (joint.dont_collapse and reads_attribute))


def find_merged_feet(
    tree: Tree, bodies: Sequence[Body], legs: Sequence[Leg], fixed: Sequence[Joint]
) -> tuple[MergedFoot, ...]:
    """Return the feet with collision shapes that at least one simulator merges."""
    if not fixed or not legs:
        return ()
    trees = {
        simulator: merge_joints(tree, bodies, merged_joints(fixed, simulator))
        for simulator in SIMULATORS
    }
    found = []
    for leg in legs:
        joint = tree.parent_joint.get(leg.foot)
        if joint is None or joint not in fixed or not tree.links[leg.foot].collisions:
            continue
        merged_body = {
            simulator: merged.body_of[leg.foot]
            for simulator, merged in trees.items()
            if merged.body_of[leg.foot] != leg.foot
        }
        if merged_body:
            found.append(MergedFoot(foot=leg.foot, joint=joint, merged_body=merged_body))
    return tuple(found)

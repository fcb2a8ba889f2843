"""MergedRobot links: those that fixed joints hold together as one body, as importers make them.

What moves as one is one body in the MJCF and has the name of its top link, as in simulators that
merge fixed joints, and as in the spec: a contact of the trunk's shell is a contact of the base.
Feet stay bodies of their own. The frames of all other links are kept as sites.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from terrainkit_robots.analysis.inertia.merged_inertia import merged_inertia
from terrainkit_robots.description.model import Geometry, Joint, Link, RobotModel
from terrainkit_robots.transforms import Matrix


@dataclass(frozen=True, kw_only=True, eq=False)
class MergedRobot:
    """A robot without fixed joints but those above its feet."""

    model: RobotModel

    frames: Mapping[str, tuple[str, Matrix]]
    """Body and pose in it, shape (4, 4) [m], of each link: its own, or the one it is part of."""


def merge_fixed_joints(model: RobotModel, *, keep: Collection[str] = ()) -> MergedRobot:
    """Return a robot whose links are one body where they move as one.

    Args:
        model: The robot in its normal form: each link after its parent.
        keep: Links that stay bodies of their own.
    """
    above = {joint.child: joint for joint in model.joints}
    frames: dict[str, tuple[str, Matrix]] = {}
    members: dict[str, list[tuple[Link, Matrix]]] = {}
    for link in model.links:
        joint = above.get(link.name)
        if joint is None or joint.moves or link.name in keep:
            frames[link.name] = (link.name, np.eye(4))
        else:
            body, pose = frames[joint.parent]
            frames[link.name] = (body, pose @ joint.origin)
        body, pose = frames[link.name]
        members.setdefault(body, []).append((link, pose))
    made = replace(
        model,
        links=tuple(_body(parts) for parts in members.values()),
        joints=tuple(_hung(joint, frames) for joint in model.joints if joint.child in members),
        excluded=_apart(model.excluded, frames),
    )
    return MergedRobot(model=made, frames=frames)


def _body(parts: Sequence[tuple[Link, Matrix]]) -> Link:
    top, _ = parts[0]
    if len(parts) == 1:
        return top
    weights = [(link.inertial, pose) for link, pose in parts if link.inertial is not None]
    return replace(
        top,
        inertial=merged_inertia(weights),
        visuals=tuple(_placed(g, pose) for link, pose in parts for g in link.visuals),
        collisions=tuple(_placed(g, pose) for link, pose in parts for g in link.collisions),
    )


def _placed(shape: Geometry, pose: Matrix) -> Geometry:
    return replace(shape, origin=pose @ shape.origin)


def _hung(joint: Joint, frames: Mapping[str, tuple[str, Matrix]]) -> Joint:
    body, pose = frames[joint.parent]
    return replace(joint, parent=body, origin=pose @ joint.origin)


def _apart(
    pairs: Collection[frozenset[str]], frames: Mapping[str, tuple[str, Matrix]]
) -> frozenset[frozenset[str]]:
    """Return the pairs of bodies that pairs of links are."""
    bodies = (frozenset(frames[link][0] for link in pair) for pair in pairs)
    return frozenset(pair for pair in bodies if len(pair) == 2)

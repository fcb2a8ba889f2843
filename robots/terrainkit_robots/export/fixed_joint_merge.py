"""Merge links that are connected by fixed joints into one body, as importers do.

A body is named after its top link, as in simulators that merge fixed joints: a contact of the
trunk's shell is a contact of the base. Feet remain separate bodies. The frames of all other links
are kept as sites.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from terrainkit_robots.analysis.inertia.merged_inertia import merged_inertia
from terrainkit_robots.description.model import Geometry, Link, RobotModel
from terrainkit_robots.transforms import Matrix


@dataclass(frozen=True, kw_only=True, eq=False)
class MergedRobot:
    """A robot whose only fixed joints are at its feet."""

    model: RobotModel

    frames: Mapping[str, tuple[str, Matrix]]
    """Body of each link and the pose of the link in it, shape (4, 4) [m]."""


def merge_fixed_joints(model: RobotModel, *, keep: Collection[str] = ()) -> MergedRobot:
    """Merge the links that are connected by fixed joints.

    Args:
        model: The robot in canonical form, each link after its parent.
        keep: Links that remain separate bodies.
    """
    parent_joints = {joint.child: joint for joint in model.joints}
    frames: dict[str, tuple[str, Matrix]] = {}
    parts_of_body: dict[str, list[tuple[Link, Matrix]]] = {}
    for link in model.links:
        joint = parent_joints.get(link.name)
        if joint is None or joint.moves or link.name in keep:
            frames[link.name] = (link.name, np.eye(4))
        else:
            body, pose = frames[joint.parent]
            frames[link.name] = (body, pose @ joint.origin)
        body, pose = frames[link.name]
        parts_of_body.setdefault(body, []).append((link, pose))
    joints = []
    for joint in model.joints:
        if joint.child in parts_of_body:
            body, pose = frames[joint.parent]
            joints.append(replace(joint, parent=body, origin=pose @ joint.origin))

    def moved(link: str, pose: Matrix) -> tuple[str, Matrix]:
        body, origin = frames[link]
        return body, origin @ pose

    loops = []
    for loop in model.loops:
        ends = [moved(*end) for end in zip(loop.links, loop.origins, strict=True)]
        (first, origin), (second, other_origin) = ends
        if first != second:
            loops.append(replace(loop, links=(first, second), origins=(origin, other_origin)))
    tendons = (
        replace(
            tendon,
            points=tuple(moved(*p) if isinstance(p, tuple) else p for p in tendon.points),
        )
        for tendon in model.tendons
    )
    pairs = (frozenset(frames[link][0] for link in pair) for pair in model.excluded)
    merged_model = replace(
        model,
        links=tuple(_body(parts) for parts in parts_of_body.values()),
        joints=tuple(joints),
        excluded=frozenset(pair for pair in pairs if len(pair) == 2),
        loops=tuple(loops),
        tendons=tuple(tendons),
    )
    return MergedRobot(model=merged_model, frames=frames)


def _body(parts: Sequence[tuple[Link, Matrix]]) -> Link:
    top, _ = parts[0]
    if len(parts) == 1:
        return top
    weights = [(link.inertial, pose) for link, pose in parts if link.inertial is not None]
    return replace(
        top,
        inertial=merged_inertia(weights),
        visuals=tuple(_move_geometry(g, pose) for link, pose in parts for g in link.visuals),
        collisions=tuple(_move_geometry(g, pose) for link, pose in parts for g in link.collisions),
    )


def _move_geometry(shape: Geometry, pose: Matrix) -> Geometry:
    return replace(shape, origin=pose @ shape.origin)

"""Close loops of a tree of links, such as a URDF, which has none of its own."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from terrainkit.errors import ConfigError
from terrainkit.settings.text import expected_names, truncate
from terrainkit_robots.description.model import Joint, Loop, RobotModel
from terrainkit_robots.text import names
from terrainkit_robots.transforms import Matrix, invert_poses

MAX_LOOPS = 200
"""Most loops that are read: the time grows with their number times the length of the chains."""

_MIN_COSINE = 0.9998
"""Smallest cosine of the angle between axes that count as parallel: CAD files round them."""


def make_loop(
    robot: RobotModel,
    number: int,
    kind: Literal["connect", "weld"],
    links: tuple[str, str],
    frame: tuple[str, Matrix],
) -> Loop:
    """Return a loop whose ends are one frame of a link, with all joints at zero.

    Args:
        robot: The robot.
        number: Number of the loop, for its name.
        kind: The constraint.
        links: Names of the two links.
        frame: Name of the link that has the frame, and its pose in the link, shape (4, 4) [m].

    Raises:
        ConfigError: if a link does not exist, or no joint moves one relative to the other.
    """
    known = {link.name for link in robot.links}
    for name in (*links, frame[0]):
        if name not in known:
            expected = expected_names(name, sorted(known), "expected links of the robot")
            raise ConfigError(f"link: got {truncate(name) or 'nothing'}; {expected}")
    if not _joints_between(links, robot.joints):
        raise ConfigError(f"links: got {names(links)}; expected links that a joint moves apart")
    world = _pose_at_zero(frame[0], robot.joints) @ frame[1]
    first, second = (invert_poses(_pose_at_zero(link, robot.joints)) @ world for link in links)
    return Loop(name=f"loop_{number}", kind=kind, links=links, origins=(first, second))


def move_into_plane(loop: Loop, joints: Sequence[Joint]) -> None:
    """Move the second end of a loop along the axis of a planar linkage, to the plane of the first.

    A pin connects parts that lie beside each other, and no joint could close that distance.

    Args:
        loop: The loop; others than planar ones are not changed.
        joints: The joints of the robot.
    """
    axes = [
        _pose_at_zero(joint.child, joints)[:3, :3] @ joint.direction
        for joint in _joints_between(loop.links, joints)
        if joint.kind != "prismatic"
    ]
    if axes and min(abs(axis @ axes[0]) for axis in axes) > _MIN_COSINE:
        first, second = (_pose_at_zero(link, joints) for link in loop.links)
        gap = (first @ loop.origins[0] - second @ loop.origins[1])[:3, 3]
        loop.origins[1][:3, 3] += second[:3, :3].T @ axes[0] * (gap @ axes[0])


def with_loops(model: RobotModel, loops: Sequence[Loop]) -> RobotModel:
    """Return a robot with these loops in place of its own, which then move their joints."""
    moved = {joint.name for loop in loops for joint in _joints_between(loop.links, model.joints)}
    joints = (replace(joint, coupled=joint.name in moved) for joint in model.joints)
    return replace(model, loops=tuple(loops), joints=tuple(joints))


def _joints_between(links: tuple[str, str], joints: Sequence[Joint]) -> list[Joint]:
    """Return the joints that move one of two links relative to the other one."""
    first, second = (dict.fromkeys(_carriers(link, joints)) for link in links)
    return [j for j in first | second if j.moves and (j in first) != (j in second)]


def _carriers(link: str, joints: Sequence[Joint]) -> list[Joint]:
    """Return the joints that carry a link, the nearest first."""
    parent_joints = {joint.child: joint for joint in joints}
    found = []
    while (joint := parent_joints.pop(link, None)) is not None:  # ends if links form a circle
        found.append(joint)
        link = joint.parent
    return found


def _pose_at_zero(link: str, joints: Sequence[Joint]) -> Matrix:
    """Return the pose of a link in the root link with all joints at zero, shape (4, 4) [m]."""
    pose = np.eye(4)
    for joint in _carriers(link, joints):
        pose = joint.origin @ pose
    return pose

"""Forward kinematics of the bodies.

It does not use a simulator, because it must also work for robots that no simulator loads. The
tests compare it with MuJoCo and yourdfpy.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from terrainkit_robots.analysis.bodies.mimic_joints import mimic_positions
from terrainkit_robots.description.model import Joint
from terrainkit_robots.transforms import Matrix, axis_angle_to_matrix


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyFrame:
    """The frame of a body, and the joint that moves it."""

    parent: int | None
    """Index of the parent, which comes before its children. None for the trunk."""

    joint: Joint | None
    """The joint that connects it to its parent. None for the trunk."""

    origin: Matrix
    """Pose in the frame of the parent at the reference position of the joint, shape (4, 4) [m]."""


def body_poses(
    bodies: Sequence[BodyFrame], positions: Mapping[str, float] | Mapping[str, Matrix]
) -> list[Matrix]:
    """Return the pose of each body in the frame of the trunk, shape (..., 4, 4) [m].

    Args:
        bodies: The bodies, parents first.
        positions: Joint positions [rad] or [m] by name, all of shape (...). Joints without a
            position are at 0. Positions of mimic joints are computed.
    """
    joints = [body.joint for body in bodies if body.joint is not None and body.joint.moves]
    all_positions: Mapping[str, float | Matrix] = {
        **positions,
        **mimic_positions(joints, positions),
    }
    poses: list[Matrix] = []
    for body in bodies:
        if body.parent is None:
            poses.append(np.eye(4))
            continue
        local = body.origin
        if body.joint is not None and body.joint.moves:
            position = np.asarray(all_positions.get(body.joint.name, 0.0), dtype=float)
            local = local @ joint_motion(body, position)
        poses.append(poses[body.parent] @ local)
    return poses


def joint_motion(body: BodyFrame, position: Matrix | np.float64) -> Matrix:
    """Return the motion of a body by its joint.

    Args:
        body: A body with a joint.
        position: Joint position [rad] or [m], shape (...).

    Returns:
        Transforms that are applied in the frame of the body, shape (..., 4, 4) [m].
    """
    assert body.joint is not None
    joint = body.joint
    q = np.asarray(position) - body.joint.reference
    motion = np.broadcast_to(np.eye(4), (*q.shape, 4, 4)).copy()
    if joint.kind == "prismatic":
        motion[..., :3, 3] = q[..., None] * joint.direction
        return motion
    rotation = axis_angle_to_matrix(joint.direction, q)
    motion[..., :3, :3] = rotation
    motion[..., :3, 3] = joint.anchor - rotation @ joint.anchor
    return motion


def joint_axis(body: BodyFrame, pose: Matrix) -> tuple[Matrix, Matrix]:
    """Return the axis of a body's joint in the frame of the trunk.

    Args:
        body: A body with a joint.
        pose: Pose of the body in the frame of the trunk, shape (4, 4) [m].

    Returns:
        A point of the axis [m] and the direction of the axis, each of shape (3,).
    """
    assert body.joint is not None
    return pose[:3, :3] @ body.joint.anchor + pose[:3, 3], pose[:3, :3] @ body.joint.direction


def ancestors(bodies: Sequence[BodyFrame], index: int) -> list[int]:
    """Return the indices of the bodies from below the trunk down to `index`."""
    chain = []
    current: int | None = index
    while current is not None and current > 0:
        chain.append(current)
        current = bodies[current].parent
    return chain[::-1]

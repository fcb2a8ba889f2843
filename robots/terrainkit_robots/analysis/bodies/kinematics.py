"""Kinematics: where the bodies are when the joints are somewhere.

Written out here, rather than left to a simulator, because it must also work on robots that no
simulator loads; the tests hold it against MuJoCo and yourdfpy.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.mimic_joints import follower_positions
from terrainkit_robots.transforms import Matrix, axis_angle_to_matrix


def body_poses(
    bodies: Sequence[Body], positions: Mapping[str, float] | Mapping[str, Matrix]
) -> list[Matrix]:
    """Return the pose of each body in the trunk's frame, shape (..., 4, 4) [m].

    Args:
        bodies: The bodies, parents first.
        positions: Joint positions [rad] or [m], all of shape (...); joints that are not named are
            at 0, and those that follow another where that puts them.
    """
    joints = [body.joint for body in bodies if body.joint is not None and body.joint.moves]
    placed: Mapping[str, float | Matrix] = {**positions, **follower_positions(joints, positions)}
    poses: list[Matrix] = []
    for body in bodies:
        if body.parent is None:
            poses.append(np.eye(4))
            continue
        local = body.mount
        if body.joint is not None and body.joint.moves:
            q = np.asarray(placed.get(body.joint.name, 0.0), dtype=float)
            local = local @ joint_motion(body, q)
        poses.append(poses[body.parent] @ local)
    return poses


def joint_motion(body: Body, position: Matrix | np.float64) -> Matrix:
    """Return how the joint above `body` moves it, shape (..., 4, 4), at `position`, shape (...)."""
    assert body.joint is not None
    joint, q = body.joint, np.asarray(position) - body.joint.reference
    motion = np.broadcast_to(np.eye(4), (*q.shape, 4, 4)).copy()
    if joint.kind == "prismatic":
        motion[..., :3, 3] = q[..., None] * joint.direction
        return motion
    turn = axis_angle_to_matrix(joint.direction, q)
    motion[..., :3, :3] = turn
    motion[..., :3, 3] = joint.anchor - turn @ joint.anchor
    return motion


def axis_in_trunk(body: Body, pose: Matrix) -> tuple[Matrix, Matrix]:
    """Return a point of the joint's axis and its direction in the trunk's frame, shapes (3,).

    Args:
        body: A body with a joint.
        pose: The body's pose in the trunk's frame.
    """
    assert body.joint is not None
    return pose[:3, :3] @ body.joint.anchor + pose[:3, 3], pose[:3, :3] @ body.joint.direction


def ancestors(bodies: Sequence[Body], index: int) -> list[int]:
    """Return the bodies from the one below the trunk down to `index`, the trunk left out."""
    chain = []
    at: int | None = index
    while at is not None and at > 0:
        chain.append(at)
        at = bodies[at].parent
    return chain[::-1]

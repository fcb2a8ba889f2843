"""Compute the link poses of a robot at random joint positions."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.kinematics import body_poses
from terrainkit_robots.analysis.bodies.mimic_joints import mimic_positions
from terrainkit_robots.description.model import Joint
from terrainkit_robots.transforms import Matrix


def random_positions(
    ranges: Mapping[str, tuple[float, float]], joints: Iterable[Joint], *, count: int, seed: int
) -> dict[str, Matrix]:
    """Return random joint positions [rad] or [m] by joint name, shape (count,) each.

    Args:
        ranges: Smallest and largest position of each joint.
        joints: The joints; positions of mimic joints follow from the joints that they mimic.
        count: Number of positions.
        seed: Seed of the positions.
    """
    rng = np.random.default_rng(seed)
    positions = {name: rng.uniform(*limits, count) for name, limits in ranges.items()}
    return positions | mimic_positions(joints, positions)


def link_poses(
    bodies: Sequence[Body], positions: Mapping[str, Matrix], *, count: int
) -> dict[str, Matrix]:
    """Return the pose of each link in the frame of the trunk, shape (count, 4, 4) [m], by name.

    Args:
        bodies: The bodies, parents first.
        positions: Joint positions [rad] or [m], shape (count,) each. Other joints are at 0.
        count: Number of positions.
    """
    return {
        link.name: np.broadcast_to(pose @ local, (count, 4, 4))
        for body, pose in zip(bodies, body_poses(bodies, positions), strict=True)
        for link, local in zip(body.links, body.poses, strict=True)
    }

"""Compare the link poses of two descriptions of a robot.

Both robots are set to the same random joint positions, and moved by our kinematics. The frames of
an MJCF are compiled by MuJoCo when it is read.
"""

import math
from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from terrainkit_robots.analysis.bodies.link_poses import link_poses, random_positions
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import Joint
from terrainkit_robots.lint.compare.robot_pairs import RobotPairs, pair_robots
from terrainkit_robots.transforms import Matrix, invert_poses, pose_error

MAX_DISTANCE, MAX_ANGLE = 1e-3, math.radians(0.1)
"""Tolerances for equal poses [m], [rad]. Files round lengths to 0.1 mm, and angles to three
decimals."""

_MAX_ROTATION, _MAX_TRANSLATION = math.pi, 0.2
"""Largest positions of joints in both directions [rad], [m], within the limits of the joint."""


@dataclass(frozen=True, kw_only=True)
class LinkPoseDifference:
    """The largest difference of link poses between two descriptions, relative to the base."""

    distance: float
    """Largest distance between the origins of corresponding links [m]."""

    angle: float
    """Largest angle between their frames [rad]."""

    link: str
    """Link of the first robot with the largest distance, or with the largest angle if all distances
    are below `MAX_DISTANCE`."""

    first: str
    """First link of the tree with a difference, or empty if there is none."""

    pose: int
    """Index of the pose in which `link` differs most."""

    poses: int
    """Number of poses."""

    seed: int
    """Seed of the poses."""

    links: int
    """Number of compared links."""

    base: tuple[str, str]
    """Base link of each robot."""

    is_base_offset: bool
    """Whether all links have the same difference, because the frames of the base differ."""

    is_rotation_only: bool
    """Whether all origins agree, and the rotation of each frame is the same in every pose."""

    @property
    def is_within_tolerance(self) -> bool:
        """Whether no distance or angle exceeds the tolerances."""
        return self.distance <= MAX_DISTANCE and self.angle <= MAX_ANGLE


def compare_link_poses(
    robot: Facts,
    other: Facts,
    *,
    poses: int = 20,
    seed: int = 0,
    locked: Collection[str] = (),
) -> LinkPoseDifference:
    """Return the largest difference of link poses, over random poses within the joint limits.

    Links are compared if they have the same name, or are below matching joints. Joints that only
    one of the robots has are at 0.

    Args:
        robot: A robot.
        other: Another description of the robot.
        poses: Number of poses.
        seed: Seed of the poses.
        locked: Names of joints of `robot` that stay at 0.

    Raises:
        CannotCheckError: if no links match, joint names repeat, or poses are not finite.
    """
    pairs = pair_robots(robot, other)
    if len(pairs.links) < 2:
        raise CannotCheckError("the two robots have no links in common")
    positions, other_positions = sample_positions(pairs, poses=poses, seed=seed, locked=locked)
    with np.errstate(all="ignore"):
        ours = _link_poses(robot, positions, pairs.base[0], poses)
        theirs = _link_poses(other, other_positions, pairs.base[1], poses)
        a = np.array([ours[name] for name, _ in pairs.links])
        b = np.array([theirs[name] for _, name in pairs.links])
        return _difference(a, b, pairs, seed)


def sample_positions(
    pairs: RobotPairs, *, poses: int, seed: int, locked: Collection[str] = ()
) -> tuple[dict[str, Matrix], dict[str, Matrix]]:
    """Return random positions within the limits of both robots, shape (poses,) each.

    Returns:
        The positions by the joint names of the first and of the second robot.
    """
    ranges = {
        joint.name: (0.0, 0.0) if joint.name in locked else _bounds(joint, other)
        for joint, other in pairs.joints
    }
    joints = [replace(j, mimic=None) if j.name in locked else j for j, _ in pairs.joints]
    positions = random_positions(ranges, joints, count=poses, seed=seed)
    return positions, {other.name: positions[joint.name] for joint, other in pairs.joints}


def _bounds(joint: Joint, other: Joint) -> tuple[float, float]:
    """Return the range of positions of both joints."""
    most = _MAX_TRANSLATION if joint.kind == "prismatic" else _MAX_ROTATION
    limits = joint.range or other.range or (-most, most)
    other_limits = other.range or limits
    lower, upper = max(limits[0], other_limits[0]), min(limits[1], other_limits[1])
    if lower > upper:  # the ranges do not overlap
        lower, upper = limits
    lower, upper = (min(max(end, -most), most) for end in (lower, upper))
    return lower, upper


def _link_poses(
    robot: Facts, positions: Mapping[str, Matrix], base: str, count: int
) -> dict[str, Matrix]:
    """Return the pose of each link in the frame of the base, shape (count, 4, 4), by name."""
    for name, times in Counter(joint.name for joint in robot.joints).items():
        if times > 1:
            raise CannotCheckError(f"{robot.model.file.name} has {times} joints called {name}")
    # The positions of mimic joints are given: both robots get the positions of the first.
    free = [
        replace(body, joint=None if body.joint is None else replace(body.joint, mimic=None))
        for body in robot.bodies
    ]
    poses = link_poses(free, positions, count=count)
    inverse = invert_poses(poses[base])
    return {name: inverse @ pose for name, pose in poses.items()}


def _difference(a: Matrix, b: Matrix, pairs: RobotPairs, seed: int) -> LinkPoseDifference:
    """Return the difference of poses, shape (links, poses, 4, 4) each."""
    distance, angle = pose_error(a, b)
    if not (np.isfinite(distance).all() and np.isfinite(angle).all()):
        raise CannotCheckError("link poses are not finite")
    largest = distance if distance.max() > MAX_DISTANCE else angle
    worst = np.unravel_index(largest.round(9).argmax(), distance.shape)  # the first of equal ones
    differs = ((distance > MAX_DISTANCE) | (angle > MAX_ANGLE)).any(axis=1)
    has_difference = bool(differs.any())
    names = [name for name, _ in pairs.links]
    return LinkPoseDifference(
        distance=float(distance.max()),
        angle=float(angle.max()),
        link=names[int(worst[0])],
        first=names[int(differs.argmax())] if has_difference else "",
        pose=int(worst[1]),
        poses=a.shape[1],
        seed=seed,
        links=len(names),
        base=pairs.base,
        is_base_offset=has_difference and _is_base_offset(a, b, pairs),
        is_rotation_only=has_difference
        and bool(distance.max() <= MAX_DISTANCE)
        and _is_constant_rotation(a, b),
    )


def _is_base_offset(a: Matrix, b: Matrix, pairs: RobotPairs) -> bool:
    """Return whether one transform of the base makes all other links agree."""
    others = [k for k, pair in enumerate(pairs.links) if pair != pairs.base]
    if len(others) < 2:
        return False
    # All poses are relative to the base. If T a = b holds for one link in one pose, T is the only
    # candidate, and it has to hold for the others.
    offset = b[others[0], 0] @ invert_poses(a[others[0], 0])
    distance, angle = pose_error(offset @ a[others], b[others])
    return bool(distance.max() <= MAX_DISTANCE and angle.max() <= MAX_ANGLE)


def _is_constant_rotation(a: Matrix, b: Matrix) -> bool:
    """Return whether the relative rotation of each pair of links is the same in every pose."""
    # Another orientation of the link frames, as between exporters, does not change with the pose.
    relative = invert_poses(a) @ b
    _, angle = pose_error(np.broadcast_to(relative[:, :1], relative.shape), relative)
    return bool(angle.max() <= MAX_ANGLE)

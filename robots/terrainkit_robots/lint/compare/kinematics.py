"""Kinematics: whether two descriptions of a robot move alike.

Both are put into the same random poses. Where the links are then is worked out by yourdfpy for URDF
and by MuJoCo for MJCF: two programs that have nothing in common with each other, or with this one.
"""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from terrainkit_robots.analysis.bodies.mimic_joints import mimic_positions
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import Joint
from terrainkit_robots.lint.compare.mjcf_poses import mjcf_poses
from terrainkit_robots.lint.compare.pairing import Pairing, pair_robots
from terrainkit_robots.lint.compare.urdf_poses import urdf_poses
from terrainkit_robots.transforms import Matrix, invert_poses, pose_error

DISTANCE, ANGLE = 1e-3, math.radians(0.1)
"""Links that are closer than this agree [m], [rad]: files give lengths to 0.1 mm, and angles to
three digits behind the point, or 1.57 for a quarter turn."""

_FREE_TURN, _FREE_SLIDE = math.pi, 0.2
"""A joint without limits is moved so far to both sides [rad], [m]; with limits, no farther."""


@dataclass(frozen=True, kw_only=True)
class KinematicDifference:
    """Largest distance and angle between the links of two descriptions, seen from the base."""

    distance: float
    """Largest distance between the origins of two links that belong together [m]."""

    angle: float
    """Largest angle between their frames [rad]."""

    link: str
    """Our name of the link that is farthest off; of the most turned one if none is off by
    `DISTANCE`."""

    first: str
    """Our name of the first link of the tree that is off or turned too far; empty if none is."""

    pose: int
    """At which of the poses `link` is; the first is 0."""

    poses: int
    """How many poses were tried."""

    seed: int
    """What the poses were drawn from."""

    links: int
    """How many links were compared."""

    base: tuple[str, str]
    """Our and their name of the link from which was measured."""

    base_only: bool
    """Whether all links are off in the same way: only the frame of the base is elsewhere."""

    turned_only: bool
    """Whether no link is off, and each turned frame is turned by the same at every pose."""

    @property
    def agrees(self) -> bool:
        """Whether nothing is off or turned by more than the margins."""
        return self.distance <= DISTANCE and self.angle <= ANGLE


def largest_difference(
    one: Facts,
    other: Facts,
    *,
    poses: int = 20,
    seed: int = 0,
    held: Collection[str] = (),
) -> KinematicDifference:
    """Return how far two descriptions of a robot differ, over random poses within the limits.

    Links are compared that have the same name, or hang below joints that have. Joints that only one
    of the two has are at 0.

    Args:
        one: A robot, read from a file that is still there.
        other: Another description of it.
        poses: How many poses to try.
        seed: What they are drawn from.
        held: Our names of joints that stay at 0.

    Raises:
        CannotCheckError: if there is nothing to compare, or one of them cannot be moved.
    """
    pairing = pair_robots(one, other)
    if pairing is None or len(pairing.links) < 2:
        raise CannotCheckError("no links of the two robots belong together")
    ours, theirs = random_positions(pairing, poses=poses, seed=seed, held=held)
    first = _from_base(_poses(one, ours), pairing.base[0], poses)
    second = _from_base(_poses(other, theirs), pairing.base[1], poses)
    a = np.array([first[name] for name, _ in pairing.links])
    b = np.array([second[name] for _, name in pairing.links])
    with np.errstate(all="ignore"):
        return _measured(a, b, pairing, seed)


def random_positions(
    pairing: Pairing, *, poses: int, seed: int, held: Collection[str] = ()
) -> tuple[dict[str, Matrix], dict[str, Matrix]]:
    """Return positions that both can take, shape (poses,) each, by our names and by theirs."""
    generator = np.random.default_rng(seed)
    ours: dict[str, Matrix] = {}
    for one, other in pairing.joints:
        drawn = generator.uniform(*_bounds(one, other), poses)
        ours[one.name] = np.zeros(poses) if one.name in held else drawn
    moving = [replace(one, mimic=None) if one.name in held else one for one, _ in pairing.joints]
    ours |= mimic_positions(moving, ours)
    return ours, {other.name: ours[one.name] for one, other in pairing.joints}


def _bounds(one: Joint, other: Joint) -> tuple[float, float]:
    """Return the positions between which both joints may be."""
    most = _FREE_SLIDE if one.kind == "prismatic" else _FREE_TURN
    mine = one.range or other.range or (-most, most)
    yours = other.range or mine
    lower, upper = max(mine[0], yours[0]), min(mine[1], yours[1])
    if lower > upper:  # they have no position in common
        lower, upper = mine
    lower, upper = (min(max(end, -most), most) for end in (lower, upper))
    return lower, upper


def _poses(robot: Facts, positions: Mapping[str, Matrix]) -> dict[str, Matrix]:
    poses = mjcf_poses if robot.model.kind == "mjcf" else urdf_poses
    return poses(robot, positions)


def _from_base(poses: Mapping[str, Matrix], base: str, count: int) -> dict[str, Matrix]:
    """Return poses as the base sees them, shape (count, 4, 4) each."""
    with np.errstate(all="ignore"):
        seen = invert_poses(poses[base])
        return {name: np.broadcast_to(seen @ p, (count, 4, 4)) for name, p in poses.items()}


def _measured(a: Matrix, b: Matrix, pairing: Pairing, seed: int) -> KinematicDifference:
    """Return the difference of poses, shape (links, poses, 4, 4) each."""
    distance, angle = pose_error(a, b)
    if not (np.isfinite(distance).all() and np.isfinite(angle).all()):
        raise CannotCheckError("the robots reach too far for numbers to hold it")
    worst = np.unravel_index(
        (distance if distance.max() > DISTANCE else angle).argmax(), distance.shape
    )
    wrong = ((distance > DISTANCE) | (angle > ANGLE)).any(axis=1)
    names = [ours for ours, _ in pairing.links]
    return KinematicDifference(
        distance=float(distance.max()),
        angle=float(angle.max()),
        link=names[int(worst[0])],
        first=names[int(wrong.argmax())] if wrong.any() else "",
        pose=int(worst[1]),
        poses=a.shape[1],
        seed=seed,
        links=len(names),
        base=pairing.base,
        base_only=bool(wrong.any()) and _is_base_only(a, b, pairing),
        turned_only=bool(wrong.any()) and distance.max() <= DISTANCE and _keeps(a, b),
    )


def _is_base_only(a: Matrix, b: Matrix, pairing: Pairing) -> bool:
    """Return whether one shift and turn of the base brings all other links together."""
    others = [k for k, pair in enumerate(pairing.links) if pair != pairing.base]
    if len(others) < 2:
        return False
    shift = b[others[0], 0] @ invert_poses(a[others[0], 0])
    distance, angle = pose_error(shift @ a[others], b[others])
    return bool(distance.max() <= DISTANCE and angle.max() <= ANGLE)


def _keeps(a: Matrix, b: Matrix) -> bool:
    """Return whether each link of one is turned against the other's by the same at every pose."""
    turns = invert_poses(a) @ b
    _, angle = pose_error(np.broadcast_to(turns[:, :1], turns.shape), turns)
    return bool(angle.max() <= ANGLE)

"""Twins: a body, its mirror image, and which of the two is the odd one."""

from collections.abc import Callable, Container, Iterator
from dataclasses import dataclass

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.kinematics import axis_in_trunk
from terrainkit_robots.analysis.cached_fact import per_robot
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.symmetry.mirror import Pair, swap_sides
from terrainkit_robots.description.model import Joint
from terrainkit_robots.transforms import Matrix


@dataclass(frozen=True, kw_only=True, eq=False)
class Twin:
    """A body and where it is, all joints at 0, in the trunk's frame."""

    body: Body

    joint: Joint
    """The joint that moves it."""

    point: Matrix
    """A point of the joint's axis, shape (3,) [m]."""

    axis: Matrix
    """The joint's axis, shape (3,)."""

    offset: Matrix
    """From the parent's joint, or the trunk's origin, to this one, shape (3,) [m]."""

    arm: Matrix
    """From the joint to the centre of mass, shape (3,) [m]."""


@per_robot
def twins(robot: Facts) -> tuple[tuple[Pair, Twin, Twin], ...]:
    """Return the mirrored pairs, each with left and right, parents first."""
    return tuple(_twins(robot))


def _twins(robot: Facts) -> Iterator[tuple[Pair, Twin, Twin]]:
    paired = set(partners(robot))
    in_legs = robot.leg_bodies
    for pair in robot.mirror.pairs:
        left, right = _twin(robot, pair.left, paired), _twin(robot, pair.right, paired)
        if left is None or right is None:
            continue
        if {pair.left, pair.right} <= in_legs or _named_alike(left, right):
            yield pair, left, right


def _named_alike(left: Twin, right: Twin) -> bool:
    """Return whether the names say so, too: two fingers of a hand only happen to be mirrored."""
    return (
        swap_sides(left.body.name) == right.body.name
        or swap_sides(left.joint.name) == right.joint.name
    )


@per_robot
def partners(robot: Facts) -> dict[int, int]:
    """Return the index of the mirror image of each body that has one."""
    pairs = robot.mirror.pairs
    return {p.left: p.right for p in pairs} | {p.right: p.left for p in pairs}


def _twin(robot: Facts, index: int, paired: Container[int]) -> Twin | None:
    body, pose = robot.bodies[index], robot.at_zero[index]
    if body.joint is None or body.parent is None:
        return None
    point, axis = axis_in_trunk(body, pose)
    return Twin(
        body=body,
        joint=body.joint,
        point=point,
        axis=axis,
        offset=point - _joint_of(robot, body.parent, paired),
        arm=pose[:3, :3] @ body.center + pose[:3, 3] - point,
    )


def _joint_of(robot: Facts, index: int, paired: Container[int]) -> Matrix:
    """Return where the joint of a body is; for one on the mirror plane that is the plane."""
    body, pose = robot.bodies[index], robot.at_zero[index]
    point = pose[:3, 3] if body.joint is None else axis_in_trunk(body, pose)[0]
    if index not in paired:
        normal, offset = robot.mirror.normal, robot.mirror.offset
        return np.asarray(point - (point @ normal - offset) * normal)
    return point


def odd_one_first(
    robot: Facts, left: Twin, right: Twin, value: Callable[[Body], Matrix | None]
) -> tuple[Twin, Twin]:
    """Return the two in the order of how unlike the legs on their side they are.

    Without others to compare with, the right one comes first.

    Args:
        robot: The robot.
        left: The one on the left.
        right: The other.
        value: What differs between the two. Signs count less than sizes, since those of front and
            rear differ with good reason.
    """
    sides = {True: {pair.left for pair in robot.mirror.pairs}}
    sides[False] = {pair.right for pair in robot.mirror.pairs}

    def strangeness(twin: Twin) -> float:
        own, side = value(twin.body), sides[twin is left]
        if own is None:
            return np.inf
        others = [value(robot.bodies[i]) for i in _alike(robot, left, right) if i in side]
        return min((_unlike(own, other) for other in others if other is not None), default=0.0)

    return (left, right) if strangeness(left) > strangeness(right) else (right, left)


def _unlike(a: Matrix, b: Matrix) -> float:
    return float(np.linalg.norm(np.abs(a) - np.abs(b)) + 0.01 * np.linalg.norm(a - b))


def _alike(robot: Facts, left: Twin, right: Twin) -> list[int]:
    """Return the bodies at the same place of other legs."""
    own = {left.body.index, right.body.index}
    found = []
    for leg in robot.legs:
        place = next((k for k, i in enumerate(leg.limb.chain) if i in own), None)
        if place is None:
            continue
        for other in robot.legs:
            chain = other.limb.chain
            if len(chain) == len(leg.limb.chain) and chain[place] not in own:
                found.append(chain[place])
    return found

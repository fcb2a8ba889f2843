"""Asymmetry: joints that are not where, or do not turn as, the mirror image of their twin."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from terrainkit_robots.analysis.bodies.kinematics import axis_in_trunk
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.symmetry.mirror_pairs import Twin, partners, twins
from terrainkit_robots.description.model import Joint
from terrainkit_robots.transforms import Matrix

LIMIT, LIMIT_SHARE = 0.01, 0.02
"""How far limits may differ: half a degree [rad], or [m], and a share of the range, since some are
measured on the robot."""

PLACE, PLACE_SHARE = 0.002, 0.01
"""How far joints may be from mirrored: some metres and a share of the way from the joint above."""

TURNED = math.radians(1.0)
"""Angle by which axes may be from mirrored [rad]."""


_SHORT = 0.005
"""A centre of mass closer than this to its joint does not tell how the body is turned [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Slip:
    """A pair of joints that are not mirrored."""

    left: Twin
    right: Twin

    axis: bool
    """Whether the axis is what was written differently; else the origin."""

    gap: float
    """Distance from mirrored [m], or 0."""

    angle: float
    """Angle from mirrored [rad], or 0."""


def slips(robot: Facts) -> tuple[list[Slip], set[int]]:
    """Return the pairs that are not mirrored, and the bodies that these displace."""
    found: list[Slip] = []
    displaced: set[int] = set()
    above: dict[int, tuple[Twin, Twin]] = {}
    paired = partners(robot)
    in_legs = robot.leg_bodies
    for pair, left, right in twins(robot):
        above[pair.left] = left, right
        if _points_nowhere(left.joint) or _points_nowhere(right.joint):
            displaced |= {pair.left, pair.right}
            continue
        parents = {left.body.parent, right.body.parent}
        if not parents & displaced and _hang_alike(left, right, paired):
            slip = _slip(robot, left, right, above.get(left.body.parent or 0))
            if slip is None:
                continue
            displaced |= {slip.left.body.index, slip.right.body.index}
            if slip.gap and _turned_around(left, right):
                continue
            # Many arms have their zero wherever the motor has it: not the same pose left and right.
            if pair.left in in_legs or slip.axis or slip.gap:
                found.append(slip)
        displaced |= {pair.left, pair.right}
    return found, displaced


def _points_nowhere(joint: Joint) -> bool:
    return joint.axis is not None and not np.abs(joint.axis).max() > 1e-6


def _turned_around(left: Twin, right: Twin) -> bool:
    """Return whether one is the other turned by half a turn, as the fingers of a gripper may be."""
    if left.body.parent != right.body.parent:
        return False
    allowed = PLACE + PLACE_SHARE * float(np.linalg.norm(left.offset))
    turns = (np.array([1, -1, -1]), np.array([-1, 1, -1]), np.array([-1, -1, 1]))
    return any(float(np.linalg.norm(left.offset * t - right.offset)) <= allowed for t in turns)


def _hang_alike(left: Twin, right: Twin, paired: Mapping[int, int]) -> bool:
    """Return whether two bodies hang from one body, or from mirror images of each other."""
    a, b = left.body.parent, right.body.parent
    if a is None or b is None:
        return False
    return a == b or paired.get(a) == b


def _slip(robot: Facts, left: Twin, right: Twin, above: tuple[Twin, Twin] | None) -> Slip | None:
    image = robot.mirror.image
    gap = float(np.linalg.norm(image(left.offset) - right.offset))
    lengths = [float(np.linalg.norm(twin.offset)) for twin in (left, right)]
    allowed = PLACE + PLACE_SHARE * min(lengths)
    if gap > allowed:
        angle = 2 * math.asin(min(1.0, gap / (lengths[0] + lengths[1])))
        same = abs(lengths[0] - lengths[1]) <= allowed
        if above is not None and same and _is_turned(robot, *above, angle):
            # As far away, but elsewhere: the frame of the joint above is turned about its axis.
            return Slip(left=above[0], right=above[1], axis=False, gap=0.0, angle=angle)
        return Slip(left=left, right=right, axis=False, gap=gap, angle=0.0)
    angle = math.acos(min(1.0, abs(float(image(left.axis) @ right.axis))))
    if angle > TURNED:
        written = [np.abs(twin.joint.direction) for twin in (left, right)]
        axis = bool(np.abs(written[0] - written[1]).max() > math.sin(TURNED))
        return Slip(left=left, right=right, axis=axis, gap=0.0, angle=angle)
    return None


def _is_turned(robot: Facts, left: Twin, right: Twin, angle: float) -> bool:
    """Return whether the mass of a body is turned like what hangs from it.

    If it is not, the joint below is out of place, and not the frame of this one.
    """
    arm = float(np.linalg.norm(right.arm))
    gap = float(np.linalg.norm(robot.mirror.image(left.arm) - right.arm))
    return arm < _SHORT or gap > 0.5 * 2 * math.sin(angle / 2) * arm


def limits_match(a: tuple[float, float], b: tuple[float, float], sign: int) -> bool:
    """Return whether limits are mirrored: the same, or with a negative sign, turned around."""
    mirrored = b if sign > 0 else (-b[1], -b[0])
    allowed = LIMIT + LIMIT_SHARE * min(a[1] - a[0], b[1] - b[0])
    return all(abs(x - y) <= allowed for x, y in zip(a, mirrored, strict=True))


def opposed(left: Twin, right: Twin) -> bool:
    """Return whether two axes point apart: not the way of files that give both sides one axis."""
    return bool(left.axis @ right.axis < 0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Stray:
    """A joint of a leg that turns the other way than those of all other legs."""

    joint: Joint

    others: int
    """How many other legs there are: three or more."""

    axis: Matrix
    """Its axis in the trunk's frame, all joints at 0, shape (3,)."""

    usual: Matrix
    """That of the same joint of another leg."""


def against_the_rest(robot: Facts) -> Iterator[Stray]:
    """Yield the joints of legs that turn the other way than those of all other legs."""
    lengths = {len(leg.limb.chain) for leg in robot.legs}
    if len(robot.legs) < _CROWD or len(lengths) != 1:
        return
    for column in zip(*(leg.limb.chain for leg in robot.legs), strict=True):
        bodies = [robot.bodies[i] for i in column]
        joints = [body.joint for body in bodies]
        axes = [axis_in_trunk(body, robot.at_zero[body.index])[1] for body in bodies]
        agreement = [float(axis @ axes[0]) for axis in axes]
        if min(map(abs, agreement)) < _PARALLEL:
            continue
        with_first = [k for k, x in enumerate(agreement) if x > 0]
        against = [k for k, x in enumerate(agreement) if x < 0]
        for few, many in ((with_first, against), (against, with_first)):
            joint = joints[few[0]] if len(few) == 1 else None
            if joint is not None:
                yield Stray(joint=joint, others=len(many), axis=axes[few[0]], usual=axes[many[0]])


def against_its_kind(robot: Facts) -> Iterator[tuple[Twin, Twin, int]]:
    """Yield the joints of two legs that turn against each other, as no others of their kind do.

    Of one kind are those that bend the legs, and those that do not. Where the limits tell left from
    right, they are believed. Also yields how many others there are, two or more.
    """
    if len(robot.legs) != 2:
        return
    in_legs = robot.leg_bodies
    pairs = [(left, right) for pair, left, right in twins(robot) if pair.left in in_legs]
    for bends in (True, False):
        kind = [
            (left, right)
            for left, right in pairs
            if (abs(float(left.axis @ robot.mirror.normal)) > _PARALLEL) == bends
        ]
        few = [(left, right) for left, right in kind if opposed(left, right)]
        others = len(kind) - len(few)
        if len(few) == 1 and others >= _FEWEST_OTHERS and _either_way(*few[0]):
            yield *few[0], others


_FEWEST_OTHERS = 2
"""Pairs that turn one way from which on the one that does not is odd."""


def _either_way(left: Twin, right: Twin) -> bool:
    """Return whether the limits of two joints are the same whichever way these turn."""
    a, b = left.joint.range, right.joint.range
    return a is None or b is None or (limits_match(a, b, 1) and limits_match(a, b, -1))


_CROWD = 4
"""Legs from which on one can be told to be odd: of two, or of three, either may be right."""

_PARALLEL = 0.9
"""Cosine from which axes are about one direction."""

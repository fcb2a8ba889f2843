"""Detect joints whose origin or axis is not the mirror image of their counterpart."""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.kinematics import joint_axis
from terrainkit_robots.analysis.legs.legs import Leg
from terrainkit_robots.analysis.symmetry.mirror import Mirror
from terrainkit_robots.analysis.symmetry.mirror_pairs import MirrorPair, MirrorSide
from terrainkit_robots.description.model import Joint
from terrainkit_robots.transforms import Matrix

MAX_LIMIT_ERROR, MAX_RELATIVE_LIMIT_ERROR = 0.01, 0.02
"""Difference of mirrored limits, at most: half a degree [rad], or [m], plus a share of the range,
because some limits are measured on the robot."""

MAX_POSITION_ERROR, MAX_RELATIVE_POSITION_ERROR = 0.002, 0.01
"""Distance of a joint from its mirrored position, at most [m], plus a share of the distance from
the joint above."""

MAX_AXIS_ERROR = math.radians(1.0)
"""Angle of an axis from its mirrored direction, at most [rad]."""

_MIN_COM_DISTANCE = 0.005
"""A center of mass closer than this to its joint does not show the rotation of the body [m]."""

_MIN_LEGS = 4
"""Number of legs from which one of them can be an outlier: of two or three, any may be right."""

_MIN_OTHER_PAIRS = 2
"""Number of pairs with the same convention from which one other pair is an outlier."""

_MIN_PARALLEL_COSINE = 0.9
"""Cosine from which two axes count as parallel."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Misalignment:
    """A pair of joints that are not mirror images."""

    pair: MirrorPair

    is_axis: bool
    """Whether the declared axes differ; otherwise the origins do."""

    distance: float
    """Distance from the mirrored position [m], or 0."""

    angle: float
    """Angle from the mirrored direction [rad], or 0."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Slide:
    """An offset along the axis of a hinge, which changes no motion unless the parts below move."""

    pair: MirrorPair
    """The pair of hinges that caused it."""

    vector: Matrix
    """Offset of the right joint from its mirrored position, shape (3,) [m]."""


def find_misalignments(
    mirror: Mirror,
    pairs: Sequence[MirrorPair],
    leg_bodies: Collection[int],
    tips: Mapping[int, Matrix],
) -> tuple[list[Misalignment], set[int]]:
    """Return the misaligned pairs of joints, and the indices of the bodies that they displace.

    Exporters place the frame of a hinge anywhere along its axis. Such an offset only counts if the
    joints or the feet below have it as well.

    Args:
        mirror: The mirror plane.
        pairs: The pairs of mirrored joints, parents first.
        leg_bodies: Indices of the bodies of legs.
        tips: Contact of each foot in the frame of the trunk, all joints at 0, shape (3,) [m], by
            the index of its body.
    """
    found: list[Misalignment] = []
    displaced: set[int] = set()
    pair_of: dict[int, MirrorPair] = {}
    slides: dict[int | None, _Slide] = {}
    for pair in pairs:
        left, right = pair.left, pair.right
        pair_of[left.body.index] = pair
        if _has_zero_axis(left.joint) or _has_zero_axis(right.joint):
            displaced |= pair.indices
            continue
        a, b = left.body.parent, right.body.parent
        has_mirror_parents = a is not None and (a == b or mirror.image_index.get(a) == b)
        if not {a, b} & displaced and has_mirror_parents:
            slide = slides.get(b)
            misalignment = _misalignment(mirror, pair, pair_of.get(left.body.parent or 0), slide)
            if misalignment is None:
                slide = _slide_along(mirror, pair, slide)
                slides[right.body.index] = slide
                misalignment = _tip_misalignment(mirror, slide, pair, tips)
                if misalignment is None:
                    continue
            displaced |= misalignment.pair.indices
            if misalignment.distance and _is_half_rotation(left, right):
                continue
            # Many arm joints have the zero of their motor, which differs from left to right.
            if left.body.index in leg_bodies or misalignment.is_axis or misalignment.distance:
                found.append(misalignment)
        displaced |= pair.indices
    return found, displaced


def _gap(mirror: Mirror, pair: MirrorPair, slide: _Slide | None) -> Matrix:
    """Return the vector from the right joint to its mirrored position, shape (3,) [m]."""
    gap = mirror.image(pair.left.offset) - pair.right.offset
    return np.asarray(gap if slide is None else gap + slide.vector)


def _slide_along(mirror: Mirror, pair: MirrorPair, slide: _Slide | None) -> _Slide:
    """Return the offset along the axis of an aligned pair."""
    gap = _gap(mirror, pair, slide)
    axis = pair.right.axis
    # The hinge that the offset is from: this one, unless it only follows its parent.
    own = mirror.image(pair.left.offset) - pair.right.offset
    if slide is not None and float(np.linalg.norm(own)) <= MAX_POSITION_ERROR:
        pair = slide.pair
    return _Slide(pair=pair, vector=(gap @ axis) * axis)


def _tip_misalignment(
    mirror: Mirror, slide: _Slide, pair: MirrorPair, tips: Mapping[int, Matrix]
) -> Misalignment | None:
    """Return the misalignment of the pair that moved the feet of two legs, if their ends differ."""
    left, right = (tips.get(side.body.index) for side in (pair.left, pair.right))
    if left is None or right is None:
        return None
    arms = left - pair.left.point, right - pair.right.point
    distance = float(np.linalg.norm(mirror.image(arms[0]) - arms[1] + slide.vector))
    moved = float(np.linalg.norm(slide.vector))
    if min(distance, moved) <= _tolerance(pair):
        return None
    return Misalignment(pair=slide.pair, is_axis=False, distance=distance, angle=0.0)


def _tolerance(pair: MirrorPair) -> float:
    length = min(float(np.linalg.norm(side.offset)) for side in (pair.left, pair.right))
    return MAX_POSITION_ERROR + MAX_RELATIVE_POSITION_ERROR * length


def _has_zero_axis(joint: Joint) -> bool:
    return joint.axis is not None and not np.abs(joint.axis).max() > 1e-6


def _is_half_rotation(left: MirrorSide, right: MirrorSide) -> bool:
    """Return whether one joint is the other rotated by half a turn, as in fingers of a gripper.

    Slides may also start at one point.
    """
    if left.body.parent != right.body.parent:
        return False
    offset = float(np.linalg.norm(left.offset))
    tolerance = MAX_POSITION_ERROR + MAX_RELATIVE_POSITION_ERROR * offset
    turns = [np.array([1, -1, -1]), np.array([-1, 1, -1]), np.array([-1, -1, 1])]
    if left.joint.kind == "prismatic":
        turns.append(np.array([1, 1, 1]))
    return any(
        float(np.linalg.norm(left.offset * turn - right.offset)) <= tolerance for turn in turns
    )


def _misalignment(
    mirror: Mirror, pair: MirrorPair, parents: MirrorPair | None, slide: _Slide | None
) -> Misalignment | None:
    left, right = pair.left, pair.right
    gap, tolerance = _gap(mirror, pair, slide), _tolerance(pair)
    if right.joint.kind != "prismatic" and left.joint.kind != "prismatic":
        gap = gap - (gap @ right.axis) * right.axis
    distance = float(np.linalg.norm(gap))
    lengths = [float(np.linalg.norm(joint.offset)) for joint in (left, right)]
    if distance > tolerance:
        if slide is not None and float(np.linalg.norm(slide.vector)) > tolerance:
            return Misalignment(pair=slide.pair, is_axis=False, distance=distance, angle=0.0)
        # The apex angle of an isosceles triangle with the mean length as legs and the distance as
        # base.
        angle = 2 * math.asin(min(1.0, distance / (lengths[0] + lengths[1])))
        is_same_length = abs(lengths[0] - lengths[1]) <= tolerance
        if parents is not None and is_same_length and _is_rotated(mirror, parents, angle):
            # The same distance in another direction: the frame of the parent joint is rotated.
            return Misalignment(pair=parents, is_axis=False, distance=0.0, angle=angle)
        return Misalignment(pair=pair, is_axis=False, distance=distance, angle=0.0)
    angle = math.acos(min(1.0, abs(float(mirror.image(left.axis) @ right.axis))))
    if angle > MAX_AXIS_ERROR:
        declared = [np.abs(joint.joint.direction) for joint in (left, right)]
        is_axis = bool(np.abs(declared[0] - declared[1]).max() > math.sin(MAX_AXIS_ERROR))
        return Misalignment(pair=pair, is_axis=is_axis, distance=0.0, angle=angle)
    return None


def _is_rotated(mirror: Mirror, pair: MirrorPair, angle: float) -> bool:
    """Return whether the center of mass of a body is rotated like the joint below it.

    If it is not, the joint below is misplaced rather than the frame of this body. A center of mass
    at the joint shows nothing; then the frames themselves are compared.
    """
    arm = float(np.linalg.norm(pair.right.arm))
    if arm < _MIN_COM_DISTANCE:
        left, right = (side.body.zero_pose[:3, :3] for side in (pair.left, pair.right))
        mirrored = mirror.image(mirror.image(left).T).T
        return bool(np.abs(mirrored - right).max() > math.sin(MAX_AXIS_ERROR))
    return pair.com_error(mirror) > 0.5 * 2 * math.sin(angle / 2) * arm


def limits_match(a: tuple[float, float], b: tuple[float, float], sign: int) -> bool:
    """Return whether limits are mirrored: equal, or negated and swapped for a negative sign."""
    mirrored = b if sign > 0 else (-b[1], -b[0])
    tolerance = MAX_LIMIT_ERROR + MAX_RELATIVE_LIMIT_ERROR * min(a[1] - a[0], b[1] - b[0])
    return all(abs(x - y) <= tolerance for x, y in zip(a, mirrored, strict=True))


@dataclass(frozen=True, kw_only=True, eq=False)
class FlippedJoint:
    """A joint of a leg whose axis is opposite to the axes of all other legs."""

    joint: Joint

    others: int
    """Number of the other legs, at least three."""

    axis: Matrix
    """Its axis in the frame of the trunk, all joints at 0, shape (3,)."""

    expected_axis: Matrix
    """Axis of the same joint of another leg."""


def find_flipped_joints(legs: Sequence[Leg], bodies: Sequence[Body]) -> Iterator[FlippedJoint]:
    """Yield the joints of legs whose axes are opposite to the axes of all other legs."""
    lengths = {len(leg.limb.chain) for leg in legs}
    if len(legs) < _MIN_LEGS or len(lengths) != 1:
        return
    for indices in zip(*(leg.limb.chain for leg in legs), strict=True):
        joints = [bodies[i].joint for i in indices]
        axes = [joint_axis(bodies[i], bodies[i].zero_pose)[1] for i in indices]
        cosines = [float(axis @ axes[0]) for axis in axes]
        if min(map(abs, cosines)) < _MIN_PARALLEL_COSINE:
            continue
        same = [k for k, cosine in enumerate(cosines) if cosine > 0]
        opposite = [k for k, cosine in enumerate(cosines) if cosine < 0]
        for minority, majority in ((same, opposite), (opposite, same)):
            joint = joints[minority[0]] if len(minority) == 1 else None
            if joint is not None:
                yield FlippedJoint(
                    joint=joint,
                    others=len(majority),
                    axis=axes[minority[0]],
                    expected_axis=axes[majority[0]],
                )


def find_flipped_pairs(
    legs: Sequence[Leg], mirror: Mirror, pairs: Sequence[MirrorPair], leg_bodies: Collection[int]
) -> Iterator[tuple[MirrorPair, int]]:
    """Yield the pairs of a biped with opposite axes if all comparable pairs have equal axes.

    The pairs that bend the legs are compared with each other, and so are the rest. Pairs whose
    limits depend on the direction of the axis are intended.

    Args:
        legs: The legs of the robot.
        mirror: The mirror plane.
        pairs: The pairs of mirrored joints.
        leg_bodies: Indices of the bodies of legs.

    Yields:
        A pair, and the number of the pairs that it was compared with, at least two.
    """
    if len(legs) != 2:
        return
    in_legs = [pair for pair in pairs if pair.left.body.index in leg_bodies]
    for bends in (True, False):
        comparable = [
            pair
            for pair in in_legs
            if (abs(float(pair.left.axis @ mirror.normal)) > _MIN_PARALLEL_COSINE) == bends
        ]
        opposed = [pair for pair in comparable if pair.has_flipped_axes]
        others = len(comparable) - len(opposed)
        if len(opposed) != 1 or others < _MIN_OTHER_PAIRS:
            continue
        a, b = opposed[0].left.joint.range, opposed[0].right.joint.range
        if a is None or b is None or (limits_match(a, b, 1) and limits_match(a, b, -1)):
            yield opposed[0], others

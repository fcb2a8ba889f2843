"""Detect the mirror plane of a robot and the pairs of mirrored bodies."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.kinematics import ancestors, joint_axis
from terrainkit_robots.analysis.legs.legs import Leg
from terrainkit_robots.analysis.name_words import split_name
from terrainkit_robots.description.model import Joint
from terrainkit_robots.transforms import Matrix

Sign = Literal[-1, 0, 1]

MAX_MIRROR_ERROR = 0.02
"""Distance of a joint from the mirror image of its counterpart, at most, over the size of the
robot."""

_MIN_ALIGNED_COSINE = 0.7
"""Cosine from which two axes count as aligned."""

_MIN_REACH = 0.25
"""Horizontal distance from the yaw axis to the foot over the length of the leg, at least, of a leg
that reaches sideways. Feet below the hip have less than 0.1."""

_LEFT_TO_RIGHT = {
    "left": "right",
    "l": "r",
    "fl": "fr",
    "rl": "rr",
    "hl": "hr",
    "bl": "br",
    "lf": "rf",
    "lh": "rh",
    "lm": "rm",
    "ml": "mr",
    "lb": "rb",
    "larm": "rarm",
    "lleg": "rleg",
}
"""Words for the left side, and the corresponding words for the right side."""

_SIDES = _LEFT_TO_RIGHT | {right: left for left, right in _LEFT_TO_RIGHT.items()}


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyPair:
    """Two bodies that are mirror images of each other, or are named so."""

    left: int
    """Index of the body on the positive side."""

    right: int
    """Index of the body on the negative side."""

    sign: Sign
    """+1 if equal joint positions are mirrored, -1 if opposite ones are, 0 if neither."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Mirror:
    """The mirror plane of a robot, and its pairs of bodies."""

    normal: Matrix
    """Normal of the plane to the left in the frame of the trunk, shape (3,): y, or x if the robot
    walks along y, or the axis between the fingers of a gripper."""

    pairs: tuple[BodyPair, ...]
    """Pairs in the order of the left bodies. A body is in at most one pair."""

    offset: float = 0.0
    """Distance of the plane from the trunk's origin along the normal [m]. Nonzero if the frame of
    the trunk is at one side, such as at an IMU."""

    def image(self, vectors: Matrix) -> Matrix:
        """Return mirrored vectors.

        Args:
            vectors: Directions, or positions relative to the plane, shape (..., 3).
        """
        return np.asarray(vectors - 2 * (vectors @ self.normal)[..., None] * self.normal)

    @property
    def reflection(self) -> Matrix:
        """Return the matrix that mirrors vectors, shape (3, 3)."""
        return np.eye(3) - 2 * np.outer(self.normal, self.normal)

    @cached_property
    def image_index(self) -> Mapping[int, int]:
        """Index of the mirror image of each body that has one, by index."""
        return {p.left: p.right for p in self.pairs} | {p.right: p.left for p in self.pairs}

    def image_body(self, index: int) -> tuple[int, Sign] | None:
        """Return the index of the mirror image of a body, and the sign of the pair."""
        for pair in self.pairs:
            if index in (pair.left, pair.right):
                return (pair.right if index == pair.left else pair.left), pair.sign
        return None

    def joint_sign(self, joint: Joint, axis: Matrix, other: Matrix) -> Sign:
        """Return how two joints of a kind mirror each other.

        A reflection turns a rotation by q about an axis into a rotation by -q about the reflected
        axis.

        Args:
            joint: One of the joints.
            axis: Its axis in the frame of the trunk, shape (3,).
            other: Axis of the other joint, shape (3,).

        Returns:
            +1 if equal positions are mirrored, -1 if opposite ones are, 0 if neither.
        """
        image = self.image(axis) if joint.kind == "prismatic" else -self.image(axis)
        cosine = float(image @ other)
        if abs(cosine) < _MIN_ALIGNED_COSINE:
            return 0
        return 1 if cosine > 0 else -1


def detect_mirror(legs: Sequence[Leg], bodies: Sequence[Body]) -> Mirror:
    """Return the mirror plane of a robot, with pairs by position, and by name for the rest.

    Args:
        legs: The legs of the robot.
        bodies: The bodies, the trunk first.
    """
    sides = [] if legs else list(_named_sides(bodies))
    normal = _plane_normal(legs) if legs else _normal_of_sides(sides)
    starts = [leg.limb.points[0] for leg in legs]
    starts += [body.zero_pose[:3, 3] for pair in sides for body in pair]
    offset = _plane_offset(starts, bodies, normal)
    mirror = Mirror(normal=normal, pairs=(), offset=offset)
    points = np.array([body.zero_pose[:3, 3] - offset * normal for body in bodies]).reshape(-1, 3)
    size = float(np.linalg.norm(np.ptp(points, axis=0))) if len(points) else 0.0
    image_index: dict[int, int] = {}
    # Positions come first, because names may be wrong; names pair what is left.
    for candidates in (
        _pairs_by_position(bodies, mirror, points, MAX_MIRROR_ERROR * size),
        _pairs_by_name(bodies, mirror, points),
    ):
        for a, b in candidates:
            if a not in image_index and b not in image_index:
                image_index[a], image_index[b] = b, a
    pairs = []
    for a, b in image_index.items():
        left, right = (a, b) if points[a] @ normal >= points[b] @ normal else (b, a)
        if (left, right) == (a, b):
            sign = _pair_sign(mirror, bodies[left], bodies[right])
            pairs.append(BodyPair(left=left, right=right, sign=sign))
    pairs.sort(key=lambda pair: pair.left)
    return Mirror(normal=normal, pairs=tuple(pairs), offset=offset)


def _plane_normal(legs: Sequence[Leg]) -> Matrix:
    """Return y, or x if most legs bend about x, as in a robot that walks along y."""
    lateral = sum(abs(leg.pitch[0]) > abs(leg.pitch[1]) and not _sprawls(leg) for leg in legs)
    radial = any(0.5 < abs(leg.pitch[0]) < 0.87 for leg in legs)  # legs all around, as a spider's
    is_x = 2 * lateral > len(legs) and not radial
    return np.array([1.0, 0, 0] if is_x else [0, 1.0, 0])


def _named_sides(bodies: Sequence[Body]) -> Iterator[tuple[Body, Body]]:
    """Yield the bodies that are named left, each with the one that is named right."""
    by_name = {body.name: body for body in bodies}
    for body in bodies:
        other = by_name.get(swap_sides(body.name))
        if other is not None and _is_left(body.name):
            yield body, other


def _normal_of_sides(sides: Sequence[tuple[Body, Body]]) -> Matrix:
    """Return y, or the axis to the left parts from the right ones, as fingers may be.

    The centers of mass are compared, since the slides of two fingers may start at one point.
    """
    to_left = sum((left.zero_center - right.zero_center for left, right in sides), np.zeros(3))
    axis = int(np.argmax(np.abs(to_left)))
    if abs(to_left[axis]) <= abs(to_left[1]) + 1e-9:  # also without such names
        return np.array([0, 1.0, 0])
    normal = np.zeros(3)
    normal[axis] = np.sign(to_left[axis])
    return normal


def _sprawls(leg: Leg) -> bool:
    """Return whether a leg reaches sideways, so that its yaw joint swings it, as an insect's."""
    levers = [
        leg.limb.tip - point
        for point, role in zip(leg.limb.points, leg.roles, strict=True)
        if role == "yaw"
    ]
    return bool(levers) and bool(np.hypot(*levers[0][:2]) > _MIN_REACH * leg.length)


def _plane_offset(points: Sequence[Matrix], bodies: Sequence[Body], normal: Matrix) -> float:
    """Return the distance of the middle of the sides from the trunk's origin along the normal [m].

    Zero unless the center of mass of the trunk is there too; otherwise a leg is misplaced.

    Args:
        points: Starts of the legs, or of the parts that are named left and right.
        bodies: The bodies, the trunk first.
        normal: Normal of the mirror plane.
    """
    if len(points) < 2:
        return 0.0
    # The median, since one leg may be misplaced.
    median = float(np.median([point @ normal for point in points]))
    trunk = float(bodies[0].center @ normal)
    return median if abs(trunk - median) < abs(trunk) / 2 else 0.0


def _pairs_by_position(
    bodies: Sequence[Body], mirror: Mirror, points: Matrix, tolerance: float
) -> Iterator[tuple[int, int]]:
    """Yield pairs of bodies at mirrored positions, for each body the closest first."""
    levels: list[int] = []
    for body in bodies:
        levels.append(0 if body.parent is None else levels[body.parent] + 1)
    images = mirror.image(points)
    lateral = np.abs(points @ mirror.normal) > max(tolerance, 1e-3)
    for body in bodies[1:]:
        if not lateral[body.index] or points[body.index] @ mirror.normal < 0:
            continue
        distances = np.linalg.norm(points - images[body.index], axis=1)
        near = np.flatnonzero(lateral & (distances <= tolerance)).tolist()
        candidates = [
            bodies[k]
            for k in near
            if k > 0
            and levels[k] == levels[body.index]
            and _joint_kind(bodies[k]) == _joint_kind(body)
        ]
        swapped = swap_sides(body.name)
        candidates.sort(
            key=lambda other: (other.name != swapped, round(float(distances[other.index]), 6))
        )
        yield from ((body.index, other.index) for other in candidates)


def _joint_kind(body: Body) -> str:
    return body.joint.kind if body.joint is not None else ""


def _pairs_by_name(
    bodies: Sequence[Body], mirror: Mirror, points: Matrix
) -> Iterator[tuple[int, int]]:
    """Yield pairs of bodies whose names, or whose joints' names, differ only in the side."""
    body_names = {body.name: body.index for body in bodies[1:]}
    joint_names = {body.joint.name if body.joint else "": body.index for body in bodies[1:]}
    for index_of in (body_names, joint_names):
        for name, index in index_of.items():
            other = index_of.get(swap_sides(name)) if name else None
            if other is None or other == index:
                continue
            chains = ancestors(bodies, index), ancestors(bodies, other)
            if index in chains[1] or other in chains[0]:
                continue  # links S, L, E, U, R of an arm: L carries R
            if _has_lone_letter(name) and len(chains[0]) != len(chains[1]):
                continue
            # If a sign is wrong, both may be on one side; they still are a pair.
            left, right = points[[index, other]] @ mirror.normal
            if left >= right and _is_left(name):
                yield index, other


def _has_lone_letter(name: str) -> bool:
    """Return whether the only side in a name is the letter l or r."""
    return [word.lower() for word in side_words(name)] in (["l"], ["r"])


def side_words(name: str) -> list[str]:
    """Return the words of a name that mark a side, such as FL or left, as they are written."""
    return [word for word in split_name(name) if word.lower() in _SIDES]


def _is_left(name: str) -> bool:
    return any(word.lower() in _LEFT_TO_RIGHT for word in split_name(name))


def swap_sides(name: str) -> str:
    """Return a name with left and right swapped: FL_calf becomes FR_calf, left_toe right_toe.

    A name without a side is returned unchanged.
    """

    def swap(word: str) -> str:
        other = _SIDES.get(word.lower())
        if other is None:
            return word
        if word.isupper():
            return other.upper()
        return other.capitalize() if word[0].isupper() else other

    return "".join(map(swap, split_name(name)))


def _pair_sign(mirror: Mirror, left: Body, right: Body) -> Sign:
    """Return the sign of the joints of two bodies, 0 if they are not comparable."""
    a, b = left.joint, right.joint
    if a is None or b is None or a.kind != b.kind or not a.moves:
        return 0
    _, axis = joint_axis(left, left.zero_pose)
    _, other = joint_axis(right, right.zero_pose)
    return mirror.joint_sign(a, axis, other)

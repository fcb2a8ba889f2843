"""The mirror: which bodies are left and right of each other."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.kinematics import axis_in_trunk
from terrainkit_robots.transforms import Matrix

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts

_NEAR = 0.02
"""How far a joint may be from the mirror image of its twin, as a share of the robot's size."""

_TOKEN = re.compile(r"[A-Z]+(?![a-z])|[A-Za-z][a-z]*|\d+")

_LEFTS = {
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
"""Words for the left side, and those for the right that go with them."""

_SIDES = _LEFTS | {right: left for left, right in _LEFTS.items()}


@dataclass(frozen=True, kw_only=True, eq=False)
class Pair:
    """Two bodies that are mirror images of each other, or are meant to be."""

    left: int
    """Index of the body on the positive side."""

    right: int
    """Index of the body on the negative side."""

    sign: int
    """+1 if equal positions of their joints look mirrored, -1 if opposite ones do, 0 if neither."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Mirror:
    """The pairs of a robot."""

    normal: Matrix
    """Normal of the mirror plane, to the left, in the trunk's frame, shape (3,): y, or x where the
    robot walks along y."""

    pairs: tuple[Pair, ...]
    """Pairs in the order of the left bodies; a body is in one pair at most."""

    offset: float = 0.0
    """How far the plane is from the trunk's origin along the normal [m]: not where the trunk's
    frame is that of an IMU at one side."""

    def image(self, vectors: Matrix) -> Matrix:
        """Return mirrored vectors, shape (..., 3)."""
        return np.asarray(vectors - 2 * (vectors @ self.normal)[..., None] * self.normal)

    def twin(self, index: int) -> tuple[int, int] | None:
        """Return the other body of the pair of body `index`, and the pair's sign."""
        for pair in self.pairs:
            if index in (pair.left, pair.right):
                return (pair.right if index == pair.left else pair.left), pair.sign
        return None


def find_mirror(facts: "Facts") -> Mirror:
    """Return the mirrored pairs of a robot: by place first, and by name where that finds none."""
    normal = _normal(facts)
    mirror = Mirror(normal=normal, pairs=())
    offset = _offset(facts, normal)
    points = np.array([pose[:3, 3] - offset * normal for pose in facts.at_zero]).reshape(-1, 3)
    near = _NEAR * float(np.linalg.norm(np.ptp(points, axis=0))) if len(points) else 0.0
    twins: dict[int, int] = {}
    for find in (_by_place, _by_name):
        for a, b in find(facts, mirror, points, near):
            if a not in twins and b not in twins:
                twins[a], twins[b] = b, a
    pairs = []
    for a, b in twins.items():
        left, right = (a, b) if points[a] @ normal >= points[b] @ normal else (b, a)
        if (left, right) == (a, b):
            pairs.append(Pair(left=left, right=right, sign=_sign(facts, mirror, left, right)))
    pairs.sort(key=lambda pair: pair.left)
    return Mirror(normal=normal, pairs=tuple(pairs), offset=offset)


def _normal(facts: "Facts") -> Matrix:
    """Return y, or x where most legs bend about x, as those of a robot that walks along y do."""
    sideways = sum(abs(leg.pitch[0]) > abs(leg.pitch[1]) for leg in facts.legs)
    radial = any(0.5 < abs(leg.pitch[0]) < 0.87 for leg in facts.legs)  # legs around, as a spider's
    x = 2 * sideways > len(facts.legs) and not radial
    return np.array([1.0, 0, 0] if x else [0, 1.0, 0])


def _offset(facts: "Facts", normal: Matrix) -> float:
    """Return how far the middle of the legs is aside of the trunk's origin [m].

    Only if the trunk's own mass is there, too: else a leg is out of place, not the origin.
    """
    starts = sorted(float(leg.limb.points[0] @ normal) for leg in facts.legs)
    if len(starts) < 2:
        return 0.0
    half = len(starts) // 2
    middle = (starts[half - 1] + starts[-half]) / 2
    mass = float(facts.bodies[0].center @ normal)
    return middle if abs(mass - middle) < abs(mass) / 2 else 0.0


def _by_place(
    facts: "Facts", mirror: Mirror, points: Matrix, near: float
) -> Iterator[tuple[int, int]]:
    """Yield pairs of bodies whose places are mirrored, the closest first for each body."""
    bodies = facts.bodies
    depth = _depths(bodies)
    images = mirror.image(points)
    aside = np.abs(points @ mirror.normal) > max(near, 1e-3)
    for body in bodies[1:]:
        if not aside[body.index] or points[body.index] @ mirror.normal < 0:
            continue
        apart = np.linalg.norm(points - images[body.index], axis=1)
        close = np.flatnonzero(aside & (apart <= near))
        alike = [
            bodies[k]
            for k in close
            if k > 0 and depth[k] == depth[body.index] and _kind(bodies[k]) == _kind(body)
        ]
        swapped = swap_sides(body.name)
        alike.sort(key=lambda other: (other.name != swapped, round(float(apart[other.index]), 6)))
        yield from ((body.index, other.index) for other in alike)


def _by_name(
    facts: "Facts", mirror: Mirror, points: Matrix, _near: float
) -> Iterator[tuple[int, int]]:
    """Yield pairs of bodies on the two sides whose names, or whose joints', differ in the side."""
    for label in (_body_name, _joint_name):
        named = {label(body): body.index for body in facts.bodies[1:]}
        for name, index in named.items():
            other = named.get(swap_sides(name)) if name else None
            if other is None or other == index:
                continue
            # Where a sign was lost both may be on one side; the pair is the same.
            sides = points[[index, other]] @ mirror.normal
            if sides[0] >= sides[1] and _is_left(name):
                yield index, other


def _body_name(body: Body) -> str:
    return body.name


def _is_left(name: str) -> bool:
    return any(word.lower() in _LEFTS for word in _TOKEN.findall(name))


def _joint_name(body: Body) -> str:
    return body.joint.name if body.joint is not None else ""


def _kind(body: Body) -> str:
    return body.joint.kind if body.joint is not None else ""


def _depths(bodies: Sequence[Body]) -> list[int]:
    depths: list[int] = []
    for body in bodies:
        depths.append(0 if body.parent is None else depths[body.parent] + 1)
    return depths


def swap_sides(name: str) -> str:
    """Return a name with left and right exchanged: FL_calf becomes FR_calf, left_toe right_toe.

    A name without a side comes back as it is.
    """

    def swapped(match: re.Match[str]) -> str:
        word = match.group()
        other = _SIDES.get(word.lower())
        if other is None:
            return word
        if word.isupper():
            return other.upper()
        return other.capitalize() if word[0].isupper() else other

    return _TOKEN.sub(swapped, name)


def _sign(facts: "Facts", mirror: Mirror, left: int, right: int) -> int:
    """Return how the joints of two bodies mirror each other.

    A reflection turns a rotation by q about a into one by -q about the reflected a.
    """
    a, b = facts.bodies[left], facts.bodies[right]
    if a.joint is None or b.joint is None or a.joint.kind != b.joint.kind or not a.joint.moves:
        return 0
    _, axis = axis_in_trunk(a, facts.at_zero[left])
    _, other = axis_in_trunk(b, facts.at_zero[right])
    image = mirror.image(axis) if a.joint.kind == "prismatic" else -mirror.image(axis)
    agreement = float(image @ other)
    return 0 if abs(agreement) < 0.7 else 1 if agreement > 0 else -1

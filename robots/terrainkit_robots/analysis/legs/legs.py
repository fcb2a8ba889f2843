"""Legs: the limbs that the robot stands on, and what each of their joints is for."""

import itertools
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from terrainkit_robots.analysis.bodies.kinematics import axis_in_trunk
from terrainkit_robots.analysis.legs.limbs import Limb, forks
from terrainkit_robots.description.model import Joint
from terrainkit_robots.transforms import Matrix

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts

Role = Literal["waist", "yaw", "roll", "hip", "knee", "ankle", "slide"]
"""Hip, knee and ankle bend the leg in its plane; roll and yaw turn that plane. A waist is what it
shares with other legs."""

_WAIST: Role = "waist"

_LEGGY = 1.5
"""Score from which a limb is taken for a leg."""

_PARALLEL = 0.9
"""Cosine from which two axes count as parallel: 26 degrees, more than legs are splayed."""

_FOOT_WORDS = re.compile(r"foot|feet|toe|sole", re.IGNORECASE)


@dataclass(frozen=True, kw_only=True, eq=False)
class Leg:
    """A limb that the robot stands on."""

    limb: Limb

    foot: str
    """Link that touches the ground."""

    roles: tuple[Role, ...]
    """What each joint of the limb is for."""

    pitch: Matrix
    """Axis about which the leg bends, in the trunk's frame at zero, shape (3,)."""

    length: float
    """From hip over knee and ankle to the contact, in the plane in which the leg bends [m]."""

    @property
    def joints(self) -> tuple[Joint, ...]:
        """Return the joints of the limb."""
        return self.limb.joints

    def joint(self, role: Role) -> Joint | None:
        """Return the first joint of a role."""
        return next((j for j, r in zip(self.joints, self.roles, strict=True) if r == role), None)


def find_legs(facts: "Facts") -> tuple[Leg, ...]:
    """Return the legs of a robot, in the order of its bodies; empty for one that has none."""
    likely = sorted(
        (limb for limb in facts.limbs if limb.score >= _LEGGY),
        key=lambda limb: (-limb.score, float(limb.tip[2]), -len(limb.joints)),
    )
    if not likely:
        return ()
    kept: list[Limb] = []
    size = float(np.linalg.norm(np.ptp([pose[:3, 3] for pose in facts.at_zero], axis=0)))
    for limb in likely:
        if not any(forks(limb, other, size) for other in kept):
            kept.append(limb)
    kept.sort(key=lambda limb: limb.chain)
    uses = Counter(index for limb in kept for index in limb.chain)
    return tuple(_leg(limb, facts, [uses[i] > 1 for i in limb.chain]) for limb in kept)


def _leg(limb: Limb, facts: "Facts", shared: Sequence[bool]) -> Leg:
    hinged = [i for i in limb.chain if (j := facts.bodies[i].joint) is not None and j.moves]
    waist = sum(s for s, i in zip(shared, limb.chain, strict=True) if i in hinged)
    turning = [
        None if joint.kind == "prismatic" else axis_in_trunk(facts.bodies[i], facts.at_zero[i])[1]
        for joint, i in zip(limb.joints[waist:], hinged[waist:], strict=True)
    ]
    points = limb.points[waist:]
    pitch = _pitch_axis([axis for axis in turning if axis is not None])
    bends = [k for k, axis in enumerate(turning) if axis is not None and _along(axis, pitch)]
    path = [_in_plane(points[k], pitch) for k in bends] + [_in_plane(limb.tip, pitch)]
    return Leg(
        limb=limb,
        foot=_foot(limb, facts),
        roles=(*[_WAIST] * waist, *_roles(turning, bends, path)),
        pitch=pitch,
        length=float(sum(np.linalg.norm(b - a) for a, b in itertools.pairwise(path))),
    )


def _along(axis: Matrix, other: Matrix) -> bool:
    return bool(abs(axis @ other) > _PARALLEL)


def _pitch_axis(axes: Sequence[Matrix]) -> Matrix:
    """Return the level axis that most joints of a leg share; of two the one more to the side."""
    level = []
    for axis in axes:
        flat = axis * [1, 1, 0]
        length = float(np.linalg.norm(flat))
        if length > _PARALLEL:
            level.append(flat / length)
    if not level:
        return np.array([0.0, 1.0, 0.0])
    best = max(level, key=lambda a: (sum(_along(a, b) for b in level), round(abs(float(a[1])), 6)))
    return np.asarray(best if best[int(np.abs(best).argmax())] > 0 else -best)


def _in_plane(point: Matrix, normal: Matrix) -> Matrix:
    return np.asarray(point - (point @ normal) * normal)


def _roles(
    turning: Sequence[Matrix | None], bends: Sequence[int], path: Sequence[Matrix]
) -> tuple[Role, ...]:
    """Return the roles; `path` holds the joints of `bends` and the contact, in the leg's plane."""
    halves = [
        abs(np.linalg.norm(path[k] - path[0]) - np.linalg.norm(path[-1] - path[k]))
        for k in range(1, len(bends))
    ]
    knee = bends[1 + int(np.argmin(halves))] if halves else None

    def role(k: int) -> Role:
        axis = turning[k]
        if axis is None:
            return "slide"
        if k in bends:
            return "hip" if knee is None or k < knee else "knee" if k == knee else "ankle"
        return "yaw" if abs(axis[2]) > np.hypot(axis[0], axis[1]) else "roll"

    return tuple(role(k) for k in range(len(turning)))


def _foot(limb: Limb, facts: "Facts") -> str:
    """Return the link at the tip: one that is called a foot, or else carries the lowest shape.

    A frame without any shape, such as that of a sensor in the sole, is one only if nothing else is.
    """
    body = facts.bodies[limb.chain[-1]]
    pose = facts.at_zero[body.index]
    reach = float(np.linalg.norm(limb.tip - pose[:3, 3]))
    near = [
        link
        for link, local in zip(body.links, body.poses, strict=True)
        if np.linalg.norm((pose @ local)[:3, 3] - limb.tip) <= 0.5 * reach + 0.01
    ]
    carriers = [link for link in body.links if link.collisions]
    drawn = [link for link in body.links if link.visuals]
    shaped = [link for link in near if link in carriers or link in drawn]
    candidates = shaped or carriers or drawn or near or [body.top]
    named = [link for link in candidates if _FOOT_WORDS.search(link.name)]
    touching = [link for link in candidates if link in carriers]
    return (named or touching or candidates)[0].name

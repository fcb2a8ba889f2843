"""Detect the legs of a robot and the role of each of their joints."""

import itertools
import math
import re
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.contact import MAX_SOLE_DEPTH
from terrainkit_robots.analysis.bodies.kinematics import joint_axis
from terrainkit_robots.analysis.bodies.shapes import min_height
from terrainkit_robots.analysis.legs.limbs import MIN_LEG_SCORE, Limb, is_branch
from terrainkit_robots.description.model import Joint
from terrainkit_robots.mesh.mesh_cache import Meshes
from terrainkit_robots.transforms import Matrix

Role = Literal["waist", "yaw", "roll", "hip", "knee", "ankle", "slide", "wheel"]
"""Hip, knee and ankle bend the leg in its plane. Roll and yaw rotate that plane. A waist is shared
with other legs. A wheel is the last body of a leg and does not bend it."""

_WAIST: Role = "waist"
_WHEEL: Role = "wheel"

_MIN_HORIZONTAL = 0.5
"""Horizontal part of an axis about which a leg may bend. Hips are tilted by up to 45 degrees."""

_MIN_BENDING_COSINE = 0.6
"""Cosine from which an axis bends the leg in its plane, if it moves the foot in that plane more
than out of it. A yaw joint that is tilted sideways by 30 degrees has 0.5, a tilted hip 0.7."""

_MAX_IMBALANCE = 0.1
"""Gap of the two segments' difference in length to the smallest one, over the length of the leg, up
to which a name decides which joint is the knee: the ankle of a small biped may halve its leg."""

_DIGITS = 3
"""Decimals of lengths [m] that decide between parts of a leg; smaller differences are ties."""

_KNEE_NAME = re.compile(r"knee|calf|kfe|shank|tibia|shin", re.IGNORECASE)

_FOOT_NAME = re.compile(r"foot|feet|toe|sole", re.IGNORECASE)


@dataclass(frozen=True, kw_only=True, eq=False)
class Leg:
    """A limb that the robot stands on."""

    limb: Limb

    foot: str
    """Name of the link that touches the ground."""

    roles: tuple[Role, ...]
    """Role of each joint of the limb."""

    pitch: Matrix
    """Axis about which the leg bends, in the frame of the trunk at zero, shape (3,)."""

    branches: tuple[Joint, ...] = ()
    """Its joints in other branches, which closed loops connect to the limb."""

    length: float
    """Length from hip over knee and ankle to the contact, in the plane of the leg [m]."""

    @property
    def joints(self) -> tuple[Joint, ...]:
        """Return the joints of the limb."""
        return self.limb.joints

    def joint(self, role: Role) -> Joint | None:
        """Return the first joint of a role."""
        return next((j for j, r in zip(self.joints, self.roles, strict=True) if r == role), None)


def mean_length(legs: Sequence[Leg]) -> float:
    """Return the mean length of at least one leg [m]."""
    return sum(leg.length for leg in legs) / len(legs)


def detect_legs(
    limbs: Sequence[Limb], bodies: Sequence[Body], meshes: Meshes, feet: Collection[str] = ()
) -> tuple[Leg, ...]:
    """Return the legs of a robot in the order of its bodies.

    Args:
        limbs: The limbs of the robot.
        bodies: The bodies, parents first.
        meshes: Mesh files.
        feet: Names of the feet, if the user knows them; the legs are then the limbs with these
            links in their last bodies.
    """
    candidates = sorted(
        (
            limb
            for limb in limbs
            if any(link.name in feet for link in bodies[limb.chain[-1]].links)
            or (not feet and limb.score >= MIN_LEG_SCORE)
        ),
        # Among equal branches, the same one on both sides of the robot.
        key=lambda limb: (
            -limb.score,
            round(float(limb.tip[2]), _DIGITS),
            -len(limb.joints),
            *(-round(math.hypot(x, y), _DIGITS) for x, y, _ in (limb.tip, limb.points[0])),
        ),
    )
    if not candidates:
        return ()
    kept: list[Limb] = []
    size = float(np.linalg.norm(np.ptp([body.zero_pose[:3, 3] for body in bodies], axis=0)))
    for limb in candidates:
        if not any(is_branch(limb, other, size) for other in kept):
            kept.append(limb)
    kept.sort(key=lambda limb: limb.chain)
    uses = Counter(index for limb in kept for index in limb.chain)
    legs = []
    for limb in kept:
        leg = _make_leg(limb, bodies, [uses[i] > 1 for i in limb.chain])
        named = [link.name for link in bodies[limb.chain[-1]].links if link.name in feet]
        foot = named[0] if named else _foot_link(limb, bodies, meshes)
        branches = dict.fromkeys(
            joint
            for other in limbs
            if limb.linkage is not None and other.linkage == limb.linkage
            for joint in other.joints
            if joint not in limb.joints
        )
        legs.append(replace(leg, foot=foot, branches=tuple(branches)))
    return tuple(legs)


def _make_leg(limb: Limb, bodies: Sequence[Body], shared: Sequence[bool]) -> Leg:
    """Return a leg without its foot."""
    moving = [i for i in limb.chain if (j := bodies[i].joint) is not None and j.moves]
    waist = sum(s for s, i in zip(shared, limb.chain, strict=True) if i in moving)
    axes = [
        None if joint.kind == "prismatic" else joint_axis(bodies[i], bodies[i].zero_pose)[1]
        for joint, i in zip(limb.joints[waist:], moving[waist:], strict=True)
    ]
    own = axes[: len(axes) - limb.has_wheel]
    pitch = _pitch_axis([axis for axis in own if axis is not None])
    points = limb.points[waist:]
    bending = [
        k
        for k, axis in enumerate(own)
        if axis is not None and _bends(axis, limb.tip - points[k], pitch)
    ]
    # The axis of a wheel ends the last segment that the joints turn.
    ends = [*limb.points[len(limb.points) - limb.has_wheel :], limb.tip]
    path = [_project(point, pitch) for point in (*points[bending], *ends)]
    names = [joint.name for joint in limb.joints[waist:]]
    return Leg(
        limb=limb,
        foot="",
        roles=(
            *itertools.repeat(_WAIST, waist),
            *_roles(own, bending, path, names),
            *([_WHEEL] if limb.has_wheel else []),
        ),
        pitch=pitch,
        length=float(sum(np.linalg.norm(b - a) for a, b in itertools.pairwise(path))),
    )


def _bends(axis: Matrix, lever: Matrix, pitch: Matrix) -> bool:
    """Return whether a joint bends the leg in its plane.

    Args:
        axis: Axis of the joint, shape (3,).
        lever: Vector from a point of the axis to the foot, shape (3,) [m].
        pitch: Normal of the plane of the leg, shape (3,).
    """
    motion = np.cross(axis, lever)  # the column of the Jacobian [m/rad]
    sideways = abs(motion @ pitch)
    in_plane = np.linalg.norm(_project(motion, pitch))
    return bool(abs(axis @ pitch) > _MIN_BENDING_COSINE and in_plane >= sideways)


def _pitch_axis(axes: Sequence[Matrix]) -> Matrix:
    """Return the horizontal axis that most joints of a leg share; in a tie the more lateral one."""
    flat = [axis * [1, 1, 0] for axis in axes]
    candidates = [
        axis / length for axis in flat if (length := np.linalg.norm(axis)) > _MIN_HORIZONTAL
    ]
    if not candidates:
        return np.array([0.0, 1.0, 0.0])
    best = max(
        candidates,
        key=lambda a: (
            round(sum(float(a @ axis) ** 2 for axis in axes), 3),
            abs(round(float(a[1]), 6)),
        ),
    )
    return np.asarray(best if best[int(np.abs(best).argmax())] > 0 else -best)


def _project(point: Matrix, normal: Matrix) -> Matrix:
    return np.asarray(point - (point @ normal) * normal)


def _roles(
    axes: Sequence[Matrix | None],
    bending: Sequence[int],
    path: Sequence[Matrix],
    names: Sequence[str],
) -> tuple[Role, ...]:
    """Return the role of each joint.

    Args:
        axes: Axis of each joint, shape (3,); None for a prismatic joint.
        bending: Indices of the joints that bend the leg in its plane.
        path: Positions of these joints and of the contact in that plane, each of shape (3,) [m].
        names: Name of each joint.
    """
    bonus = _MAX_IMBALANCE * np.linalg.norm(path[-1] - path[0])
    imbalances = [
        abs(np.linalg.norm(path[k] - path[0]) - np.linalg.norm(path[-1] - path[k]))
        - bonus * bool(_KNEE_NAME.search(names[bending[k]]))
        for k in range(1, len(bending))
    ]
    knee = bending[1 + int(np.argmin(imbalances))] if imbalances else None

    def role(k: int) -> Role:
        axis = axes[k]
        if axis is None:
            return "slide"
        if k in bending:
            return "hip" if knee is None or k < knee else "knee" if k == knee else "ankle"
        return "yaw" if abs(axis[2]) > np.hypot(axis[0], axis[1]) else "roll"

    return tuple(role(k) for k in range(len(axes)))


def _foot_link(limb: Limb, bodies: Sequence[Body], meshes: Meshes) -> str:
    """Return the link that is named a foot and touches the ground or is drawn, or that touches it.

    Of the parts of a split sole, it is the lowest one, or the one furthest from the trunk, so that
    the feet of both sides are the same part. Without collision shapes, it is a link with a visual
    shape or the link with the lowest frame.
    """
    body = bodies[limb.chain[-1]]
    pose = body.zero_pose
    places: dict[str, tuple[float, float]] = {}
    for link in body.links:
        shapes = [shape for shape in body.collisions if shape.link == link.name]
        if shapes:
            x, y, _ = np.mean([(pose @ shape.pose)[:3, 3] for shape in shapes], axis=0)
            height = min(min_height(shape, pose, meshes) for shape in shapes)
            places[link.name] = (round(height, _DIGITS), -round(math.hypot(x, y), _DIGITS))
    ground = min((height for height, _ in places.values()), default=0.0)
    touching = [name for name, (height, _) in places.items() if height <= ground + MAX_SOLE_DEPTH]
    visible = [link.name for link in body.links if link.visuals]
    named = [link.name for link in body.links if _FOOT_NAME.search(link.name)]
    soles = [name for name in touching if name in named] or touching
    drawn_feet = [name for name in named if name in visible]
    if soles and (soles[0] in named or not drawn_feet):
        return min(soles, key=places.__getitem__)
    heights = [float((pose @ local)[2, 3]) for local in body.poses]
    lowest = body.links[int(np.argmin(heights))].name
    return [*drawn_feet, *visible, *named, lowest][0]

"""The standing pose: joint positions at which the legs carry the trunk, found by a search.

Each leg is bent by its hip and knee over a grid that closes in on the best place; the ankle keeps
the sole level, and everything else stays at zero. Pairs of legs stand alike, so one is searched.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.contact import level_turn, sole
from terrainkit_robots.analysis.bodies.kinematics import axis_in_trunk, body_poses, joint_motion
from terrainkit_robots.analysis.bodies.mimic_joints import follower_positions
from terrainkit_robots.analysis.legs.legs import Leg
from terrainkit_robots.description.model import Joint
from terrainkit_robots.transforms import Matrix, axis_angle_to_matrix

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts

_BENT = {2: 0.965}
"""Distance from hip to ground over leg length, by number of legs: two stand almost straight."""

_BENT_ELSE = 0.75
"""The same for four legs and more."""

_PRECISION = np.array([0.02, 0.02, 0.1])
"""Distance from where the foot should be that costs 1, along x, y and z, as a share of the leg's
length: under the mass is a must, the height a preference."""

_GRID = 21
"""Positions of a joint that are tried in each round."""

_ROUNDS = 4
"""Each round closes in on a fifth of the range around the best place."""

_BASINS = 4
"""So many places that are better than all around them are looked at closer."""

_BENDING = ("hip", "knee", "ankle")

_WIDEST = 2.4
"""A joint without limits is tried within +- this [rad]."""

_MARGIN = 0.08
"""Positions closer to a limit than this share of the range are avoided."""

_FARTHEST = 0.3
"""How far all feet may be from below their hips, as a share of the leg's length; a robot that has
to reach farther does not stand."""

_OUTWARD = 0.05
"""Cost of a knee that is a leg's length outside of its hip; next to nothing."""

_CLEAR = 0.15
"""How far the knee has to be above the ground, as a share of the leg's length."""


def solve_positions(facts: "Facts") -> Mapping[str, float]:
    """Return the position of each moving joint [rad] or [m] in the standing pose, by name.

    A keyframe of the file that has every joint of the legs is taken as it is.
    """
    joints = [joint for leg in facts.legs for joint in leg.joints]
    home = facts.model.home
    if home and all(joint.name in home for joint in joints):
        return {joint.name: home.get(joint.name, 0.0) for joint in facts.joints}
    positions = {joint.name: nearest(joint, joint.reference) for joint in facts.joints}
    # The centre of mass moves with the legs, so that their feet follow it in a second pass.
    for _ in range(2 if facts.legs else 0):
        shift = _offset(facts, positions)
        for leg, twin, signs in _alike(facts):
            bent = _bend(leg, facts, positions, shift)
            positions |= bent
            if twin is not None:
                positions |= _copied(bent, leg, twin, signs)
    followed = follower_positions(facts.joints, positions)
    return positions | {name: float(position) for name, position in followed.items()}


def nearest(joint: Joint, position: float) -> float:
    """Return the position closest to `position` that the limits allow."""
    lower, upper = range_of(joint)
    return float(np.clip(position, lower, upper))


def range_of(joint: Joint) -> tuple[float, float]:
    """Return the limits of a joint [rad] or [m]; infinite where there are none that make sense."""
    return joint.range or (-np.inf, np.inf)


def _alike(facts: "Facts") -> list[tuple[Leg, Leg | None, Sequence[int]]]:
    """Return each leg to be searched, with the one that mirrors it and the signs of its joints."""
    legs, done = facts.legs, set[int]()
    uses = Counter(i for leg in legs for i in leg.limb.chain)  # a waist is its own twin
    found: list[tuple[Leg, Leg | None, Sequence[int]]] = []
    for index, leg in enumerate(legs):
        if index in done:
            continue
        twins = [(i, 1) if uses[i] > 1 else facts.mirror.twin(i) for i in leg.limb.chain]
        chain = tuple(twin[0] for twin in twins if twin is not None)
        other = next((k for k, o in enumerate(legs) if o.limb.chain == chain), None)
        signs = [twin[1] for twin in twins if twin is not None]
        if other is None or other == index or 0 in signs:
            found.append((leg, None, ()))
            continue
        done.add(other)
        found.append((leg, legs[other], signs))
    return found


def _copied(
    bent: Mapping[str, float], leg: Leg, twin: Leg, signs: Sequence[int]
) -> dict[str, float]:
    """Return the positions of the twin's joints, which its own limits may hold back."""
    return {
        other.name: nearest(other, sign * bent[joint.name])
        for joint, other, sign in zip(leg.joints, twin.joints, signs, strict=False)
        if joint.name in bent
    }


def _offset(facts: "Facts", positions: Mapping[str, float]) -> Matrix:
    """Return how far all feet have to be from below their hips, for the mass to be above them."""
    poses = body_poses(facts.bodies, positions)
    center = center_of_mass(facts.bodies, poses)
    hips = [_hip(leg, facts, poses) for leg in facts.legs]
    away = (center - np.mean(hips, axis=0)) * [1, 1, 0]
    most = _FARTHEST * float(np.mean([leg.length for leg in facts.legs]))
    return np.asarray(away * min(1.0, most / max(float(np.linalg.norm(away)), 1e-9)))


def center_of_mass(bodies: Sequence[Body], poses: Sequence[Matrix]) -> Matrix:
    """Return the centre of mass in the frame of the poses, shape (3,) [m]."""
    total = sum(body.mass for body in bodies)
    if total <= 0:
        return poses[0][:3, 3]
    centers = [pose[:3, :3] @ b.center + pose[:3, 3] for b, pose in zip(bodies, poses, strict=True)]
    return np.asarray(
        sum((b.mass * c for b, c in zip(bodies, centers, strict=True)), np.zeros(3)) / total
    )


def _hip(leg: Leg, facts: "Facts", poses: Sequence[Matrix]) -> Matrix:
    """Return where the leg hangs: the axis of its first joint that bends it, shape (3,)."""
    hinged = [i for i in leg.limb.chain if _moves(facts.bodies[i])]
    own = [(i, r) for i, r in zip(hinged, leg.roles, strict=True) if r != "waist"]
    index = next((i for i, r in own if r == "hip"), own[0][0])
    return axis_in_trunk(facts.bodies[index], poses[index])[0]


def _moves(body: Body) -> bool:
    return body.joint is not None and body.joint.moves


@dataclass(frozen=True, kw_only=True, eq=False)
class _Bending:
    """One leg, ready to be tried at many positions of its hip and knee."""

    chain: tuple[Body, ...]
    start: Matrix
    """Pose of the body that the leg hangs from, shape (4, 4)."""

    hip: Joint
    knee: Joint
    ankle: Joint | None
    level: tuple[float, float, float]
    """Position of the ankle that keeps the sole level: a constant, and per hip and knee."""

    fixed: Mapping[str, float]
    tip: Matrix
    """The contact in the frame of the leaf, shape (3,) [m]."""

    hip_place: Matrix
    wanted: Matrix
    """Where the contact should be, seen from the hip, shape (3,) [m]."""

    pitch: Matrix

    outward: Matrix
    """Where the knee of one of four legs rather is not, if both ways are open, shape (3,): ahead of
    a fore leg and behind a hind one; zero for two legs."""

    length: float

    def at(self, hip: Matrix, knee: Matrix) -> dict[str, Matrix]:
        """Return the positions of the joints that bend."""
        bent = {self.hip.name: hip, self.knee.name: knee}
        if self.ankle is not None:
            level = self._level(hip, knee)
            bent[self.ankle.name] = np.clip(level, *range_of(self.ankle))
        return bent

    def cost(self, hip: Matrix, knee: Matrix) -> Matrix:
        """Return how bad positions are, shape as theirs."""
        bent = self.at(hip, knee)
        contact, joint = self._places(bent)
        flat = self.pitch * [1, 1, 0]
        away = contact - self.hip_place - self.wanted
        away = away - (away @ flat)[..., None] * flat  # sideways it cannot go
        total = ((away / (self.length * _PRECISION)) ** 2).sum(-1)
        for name, limits in ((self.hip.name, self.hip), (self.knee.name, self.knee)):
            total = total + 10 * _crowding(bent[name], limits) + 1e-3 * np.abs(bent[name])
        if self.ankle is not None:
            total = total + 10 * (bent[self.ankle.name] - self._level(hip, knee)) ** 2
        total = total + _OUTWARD * np.clip((joint - self.hip_place) @ self.outward, 0, None)
        low = _CLEAR * self.length - (joint[..., 2] - contact[..., 2])
        return np.asarray(total + 100 * np.clip(low / self.length, 0, None))

    def _level(self, hip: Matrix, knee: Matrix) -> Matrix:
        constant, per_hip, per_knee = self.level
        return np.asarray(constant + per_hip * hip + per_knee * knee)

    def _places(self, bent: Mapping[str, Matrix]) -> tuple[Matrix, Matrix]:
        """Return where the contact and the knee are, shapes (..., 3) [m]."""
        pose = self.start
        joint = pose[..., :3, 3]
        for body in self.chain:
            pose = pose @ body.mount
            if body.joint is not None and body.joint.moves:
                name = body.joint.name
                q = bent[name] if name in bent else np.float64(self.fixed[name])
                pose = pose @ joint_motion(body, q)
                if name == self.knee.name:
                    joint = (pose[..., :3, :3] @ body.joint.anchor) + pose[..., :3, 3]
        return pose[..., :3, :3] @ self.tip + pose[..., :3, 3], joint


def _crowding(position: Matrix, joint: Joint) -> Matrix:
    """Return by how much a position is too close to a limit: 0 away from them, 1 at one."""
    lower, upper = range_of(joint)
    if not np.isfinite(upper - lower):
        return np.zeros_like(position)
    room = _MARGIN * (upper - lower)
    near = np.minimum(position - lower, upper - position)
    return np.asarray(np.clip((room - near) / room, 0, None) ** 2)


def _bend(
    leg: Leg, facts: "Facts", positions: Mapping[str, float], shift: Matrix
) -> dict[str, float]:
    """Return the best positions of a leg's hip, knee and ankle; none without a hip and a knee."""
    bending = _bending(leg, facts, positions, shift)
    if bending is None:
        return {}
    limits = np.array([_searched(bending.hip), _searched(bending.knee)])
    axes = np.linspace(limits[:, 0], limits[:, 1], _GRID, axis=-1)
    cost = bending.cost(*np.meshgrid(axes[0], axes[1], indexing="ij"))
    # The knee may bend both ways; which is better shows only close to the best place of each.
    starts = np.array([(axes[0, i], axes[1, j]) for i, j in _minima(cost)[:_BASINS]])
    hip, knee = _closest_in(bending, starts, limits)
    return {name: float(q) for name, q in bending.at(hip, knee).items()}


def _minima(cost: Matrix) -> list[tuple[int, int]]:
    """Return where no neighbour costs less, the cheapest first."""
    padded = np.pad(cost, 1, constant_values=np.inf)
    around = np.lib.stride_tricks.sliding_window_view(padded, (3, 3)).min(axis=(-1, -2))
    places = [(int(i), int(j)) for i, j in np.argwhere(cost <= around)]
    return sorted(places, key=lambda place: float(cost[place]))


def _closest_in(bending: _Bending, starts: Matrix, limits: Matrix) -> Matrix:
    """Return the best positions of hip and knee around any of the starts, shape (n, 2)."""
    best, width, rows = starts, np.ptp(limits, axis=1), np.arange(len(starts))
    for _ in range(_ROUNDS):
        width = width / 5
        lower, upper = (np.clip(best + side * width / 2, *limits.T) for side in (-1, 1))
        axes = np.linspace(lower, upper, _GRID, axis=-1)
        # Not as a grid, but as its two sides: what only one of them turns is worked out once.
        cost = bending.cost(axes[:, 0, :, None], axes[:, 1, None, :]).reshape(len(starts), -1)
        hip, knee = np.divmod(cost.argmin(axis=1), _GRID)
        best = np.stack([axes[rows, 0, hip], axes[rows, 1, knee]], axis=1)
    return np.asarray(best[cost.min(axis=1).argmin()])


def _searched(joint: Joint) -> tuple[float, float]:
    lower, upper = range_of(joint)
    if upper - lower > 4 * np.pi:
        return -_WIDEST, _WIDEST
    return lower, upper


def _bending(
    leg: Leg, facts: "Facts", positions: Mapping[str, float], shift: Matrix
) -> _Bending | None:
    hip, knee = leg.joint("hip"), leg.joint("knee")
    if hip is None or knee is None:
        return None
    bodies = [facts.bodies[i] for i in leg.limb.chain]
    ankles = [j for j, r in zip(leg.joints, leg.roles, strict=True) if r == "ankle"]
    leaf = facts.bodies[leg.limb.chain[-1]]
    poses = body_poses(facts.bodies, positions)
    if ankles:
        turn = level_turn(leaf, facts.at_zero[leaf.index], leg.pitch, facts.meshes)
        foot = facts.at_zero[leaf.index].copy()
        foot[:3, :3] = axis_angle_to_matrix(leg.pitch, np.float64(turn)) @ foot[:3, :3]
    else:
        turn, foot = 0.0, poses[leaf.index]  # a ball rolls: its contact depends on the pose
    contact = sole(leaf, foot, facts.meshes).mean(axis=0)
    start = poses[bodies[0].parent or 0]
    ratio = _BENT.get(len(facts.legs), _BENT_ELSE)
    hip_place, length = _hip(leg, facts, poses), max(leg.length, 1e-6)
    return _Bending(
        chain=tuple(bodies),
        start=start,
        hip=hip,
        knee=knee,
        ankle=ankles[-1] if ankles else None,
        level=_level(leg, facts, positions, turn) if ankles else (0.0, 0.0, 0.0),
        fixed=positions,
        tip=foot[:3, :3].T @ (contact - foot[:3, 3]),
        hip_place=hip_place,
        wanted=shift + np.array([0.0, 0.0, -ratio * leg.length]),
        pitch=leg.pitch,
        outward=_outward(leg, facts, poses, hip_place) / length,
        length=length,
    )


def _outward(leg: Leg, facts: "Facts", poses: Sequence[Matrix], hip_place: Matrix) -> Matrix:
    """Return the level unit vector from the middle of the robot in the plane of one of four legs.

    Zero for a leg that hangs in the middle, or reaches to the side as a spider's.
    """
    middle = np.mean([_hip(other, facts, poses) for other in facts.legs], axis=0)
    across = np.cross(leg.pitch, [0.0, 0.0, 1.0])
    ahead = float((hip_place - middle) @ across)
    alone = len(facts.legs) != 4 or abs(ahead) < 0.1 * leg.length
    return np.zeros(3) if alone else np.asarray(np.sign(ahead) * across)


def _level(
    leg: Leg, facts: "Facts", positions: Mapping[str, float], wanted: float
) -> tuple[float, float, float]:
    """Return what keeps the sole level: the turns of all joints that bend add up to `wanted`."""
    signs = {
        joint.name: float(np.sign(axis_in_trunk(facts.bodies[i], facts.at_zero[i])[1] @ leg.pitch))
        for i in leg.limb.chain
        if (joint := facts.bodies[i].joint) is not None and joint.moves
    }
    bends = {j.name for j, r in zip(leg.joints, leg.roles, strict=True) if r in _BENDING}
    ankle = [j.name for j, r in zip(leg.joints, leg.roles, strict=True) if r == "ankle"][-1]
    hip, knee = leg.joint("hip"), leg.joint("knee")
    assert hip is not None
    assert knee is not None
    others = sum(signs[n] * positions[n] for n in bends - {hip.name, knee.name, ankle})
    last = signs[ankle]
    return last * (wanted - others), -last * signs[hip.name], -last * signs[knee.name]

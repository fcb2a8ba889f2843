"""Solve for the standing pose: joint positions at which the legs carry the trunk.

For each leg, hip and knee are searched over a grid that is refined around its best points. The
ankle keeps the sole level, and all other joints stay at zero. Of mirrored legs only one is solved.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body, center_of_mass
from terrainkit_robots.analysis.bodies.contact import contact_points, flat_foot_angle
from terrainkit_robots.analysis.bodies.kinematics import body_poses, joint_axis, joint_motion
from terrainkit_robots.analysis.legs.closed_loops import close_loops
from terrainkit_robots.analysis.legs.keyframe import is_standing_keyframe
from terrainkit_robots.analysis.legs.legs import Leg
from terrainkit_robots.analysis.legs.wheels import MAX_LIMITED_RANGE
from terrainkit_robots.description.model import Joint
from terrainkit_robots.transforms import Matrix, axis_angle_to_matrix, invert_poses

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts

# This ratio and the next one were chosen in trials on 39 robots.
_HEIGHT_RATIO = {2: 0.965}
"""Distance from hip to ground over leg length, by number of legs. Bipeds stand almost straight."""

_DEFAULT_HEIGHT_RATIO = 0.75
"""The same ratio for all other numbers of legs."""

_MAX_REACH_RATIO = 0.98
"""The ratio of that distance to the longest one that the limits of the knee allow, at most."""

_PRECISION = np.array([0.02, 0.02, 0.1])
"""Distance of the foot from its target that costs 1, along x, y and z, over the leg length. The
foot must be below the mass; the height is only a preference."""

# 20 intervals and 4 refinements by 5 end at 1/12,500 of the range, 0.5 mrad on a whole turn.
_GRID_SIZE = 21
"""Number of positions of a joint in each round of the search."""

_ROUNDS = 4
"""Number of refinements, each to a fifth of the range around the best point."""

_MAX_STARTS = 4
"""Number of local minima of the grid that are refined."""

_LEVEL_ROLES = ("ankle", "wheel")
"""Roles of joints that keep the contact below the last segment. A wheel then returns to 0."""

_BENDING_ROLES = ("hip", "knee", *_LEVEL_ROLES)

_DEFAULT_RANGE = 2.4
"""A joint without limits is searched within plus and minus this [rad]."""

_LIMIT_MARGIN = 0.08
"""Positions closer to a limit than this are penalized, over the range."""

_INSET = 0.25
"""Distance to the limits of a joint that bends a leg and cannot reach 0, over its range. The search
does not move all of them: Cassie has two above its knee, and the second cannot reach 0."""

_MAX_ANKLE_OFFSET = 0.5
"""Offset of the center of mass of a biped from the middle of its soles toward its ankles, at most,
over half of their length. It keeps half of the distance to the edge of the support polygon."""

_MAX_FOOT_OFFSET = 0.3
"""Largest horizontal offset of all feet from their hips, over the leg length. A robot that needs
more does not stand."""

_OUTWARD_COST = 0.05
"""Cost of a knee that is a leg length outside of its hip. It only breaks ties."""

_STEPS = (0.05, 0.01)
"""Hip and knee are multiples of the first step [rad] at which the cost is close to the lowest."""

# An offset d of the foot along x costs (d / (0.02 l))^2, which is 0.25 at d = 0.01 l.
_MAX_ROUNDING_COST = 0.25
"""Increase of the cost by rounding, at most: the foot moves by 1 % of the leg length."""

_MAX_ROUNDED = 1e6
"""Larger positions are not rounded [rad] or [m]."""

_MIN_KNEE_HEIGHT = 0.15
"""Smallest height of the knee above the ground, over the leg length."""


def solve_standing_pose(robot: "Facts") -> Mapping[str, float]:
    """Return the position of each moving joint in the standing pose [rad] or [m], by name.

    A keyframe in which the robot stands on its feet is used unchanged. Mimic joints are treated as
    if they were free. Closed loops are closed in the end, if that is possible.
    """
    if is_standing_keyframe(robot):
        return {joint.name: robot.model.keyframe.get(joint.name, 0.0) for joint in robot.joints}
    positions = {joint.name: clip_to_limits(joint, joint.reference) for joint in robot.joints}
    positions |= {
        joint.name: _initial_position(joint)
        for leg in robot.legs
        for joint, role in zip(leg.joints, leg.roles, strict=True)
        if role in _BENDING_ROLES
    }
    # The center of mass moves with the legs, hence a second pass.
    for _ in range(2 if robot.legs else 0):
        # The feet go below the center of mass, since the hips are not always placed around it.
        shift = _foot_shift(robot, positions)
        for leg, mirror_leg, signs in _leg_pairs(robot):
            solution = _solve_leg(leg, robot, positions, shift)
            positions |= solution
            if mirror_leg is not None:
                positions |= _mirror_solution(solution, leg, mirror_leg, signs)
    positions = {joint.name: round_position(joint, positions[joint.name]) for joint in robot.joints}
    if not robot.loops:
        return positions
    legs = {joint.name for leg in robot.legs for joint in leg.joints}
    actuated = {joint.name for joint in robot.actuated}
    return close_loops(robot, positions, legs=legs, actuated=actuated)


def round_position(joint: Joint, position: float) -> float:
    """Return a position in steps of 0.01 rad or 1 mm within the limits, if there is one."""
    digits = 3 if joint.kind == "prismatic" else 2
    step = 10.0**-digits if abs(position) < _MAX_ROUNDED else 0.0
    lower, upper = joint_range(joint)
    nearby = (round(position + shift * step, digits) + 0.0 for shift in (0, 1, -1))
    return next((near for near in nearby if lower <= near <= upper), position)


def clip_to_limits(joint: Joint, position: float) -> float:
    """Return the position closest to `position` within the limits [rad] or [m]."""
    lower, upper = joint_range(joint)
    return float(np.clip(position, lower, upper))


def _initial_position(joint: Joint) -> float:
    """Return the reference position, or one at a distance from the limits that exclude it."""
    lower, upper = joint_range(joint)
    if lower <= joint.reference <= upper:
        return joint.reference
    inset = _INSET * (upper - lower) if np.isfinite(upper - lower) else 0.0
    return float(np.clip(joint.reference, lower + inset, upper - inset))


def joint_range(joint: Joint) -> tuple[float, float]:
    """Return the limits of a joint [rad] or [m]. Infinite without valid limits."""
    return joint.range or (-np.inf, np.inf)


def _leg_pairs(robot: "Facts") -> list[tuple[Leg, Leg | None, Sequence[int]]]:
    """Return each leg to solve, the leg that mirrors it, and the signs of its joints."""
    legs, done = robot.legs, set[int]()
    uses = Counter(i for leg in legs for i in leg.limb.chain)  # a waist mirrors itself
    found: list[tuple[Leg, Leg | None, Sequence[int]]] = []
    for index, leg in enumerate(legs):
        if index in done:
            continue
        # With a sign of 0, neither equal nor opposite positions are mirrored.
        images = [(i, 1) if uses[i] > 1 else robot.mirror.image_body(i) for i in leg.limb.chain]
        chain = tuple(image[0] for image in images if image is not None)
        other = next((k for k, o in enumerate(legs) if o.limb.chain == chain), None)
        signs = [image[1] for image in images if image is not None]
        if other is None or other == index or 0 in signs:
            found.append((leg, None, ()))
            continue
        done.add(other)
        found.append((leg, legs[other], signs))
    return found


def _mirror_solution(
    solution: Mapping[str, float], leg: Leg, mirror_leg: Leg, signs: Sequence[int]
) -> dict[str, float]:
    """Return the positions of the mirrored leg, clipped to its own limits."""
    return {
        other.name: clip_to_limits(other, sign * solution[joint.name])
        for joint, other, sign in zip(leg.joints, mirror_leg.joints, signs, strict=False)
        if joint.name in solution
    }


def _foot_shift(robot: "Facts", positions: Mapping[str, float]) -> Matrix:
    """Return the offset of the feet from their hips that puts the mass above them, shape (3,)."""
    poses = body_poses(robot.bodies, positions)
    center = center_of_mass(robot.bodies, poses)
    hips = [_hip_point(leg, robot, poses) for leg in robot.legs]
    offset = (center - np.mean(hips, axis=0)) * [1, 1, 0]
    # Only the horizontal part counts, and a longer offset keeps its direction.
    limit = _MAX_FOOT_OFFSET * float(np.mean([leg.length for leg in robot.legs]))
    return np.asarray(offset * min(1.0, limit / max(float(np.linalg.norm(offset)), 1e-9)))


def _hip_point(leg: Leg, robot: "Facts", poses: Sequence[Matrix]) -> Matrix:
    """Return a point of the hip axis, or of the first joint of a leg without a hip, shape (3,)."""
    moving = [i for i in leg.limb.chain if (j := robot.bodies[i].joint) is not None and j.moves]
    own = [(i, role) for i, role in zip(moving, leg.roles, strict=True) if role != "waist"]
    index = next((i for i, role in own if role == "hip"), own[0][0])
    return joint_axis(robot.bodies[index], poses[index])[0]


@dataclass(frozen=True, kw_only=True, eq=False)
class _LegObjective:
    """The cost of one leg as a function of its hip and knee."""

    chain: tuple[Body, ...]
    base_pose: Matrix
    """Pose of the body that the leg is attached to, shape (4, 4) [m]."""

    hip: Joint
    knee: Joint
    ankle: Joint | None
    level: tuple[float, float, float]
    """Ankle position that keeps the sole level: a constant, and its slopes over hip and knee."""

    fixed: Mapping[str, float]
    """Positions of the other joints."""

    tip: Matrix
    """Contact in the frame of the leaf, shape (3,) [m]."""

    hip_point: Matrix
    target: Matrix
    """Target of the contact relative to the hip, shape (3,) [m]."""

    pitch: Matrix

    penalty_axis: Matrix
    """Direction in which the knee should not bend if both ways are open, shape (3,): forward for a
    front leg and backward for a rear leg of a quadruped, else zero."""

    length: float

    def positions(self, hip: Matrix, knee: Matrix) -> dict[str, Matrix]:
        """Return the positions of hip, knee and ankle."""
        positions = {self.hip.name: hip, self.knee.name: knee}
        if self.ankle is not None:
            level = self._level_ankle(hip, knee)
            positions[self.ankle.name] = np.clip(level, *joint_range(self.ankle))
        return positions

    def cost(self, hip: Matrix, knee: Matrix) -> Matrix:
        """Return the cost of positions, broadcast to a common shape."""
        positions = self.positions(hip, knee)
        contact, knee_point = self._forward(positions)
        # Hip and knee turn about the same axis, so they cannot move the foot along it.
        lateral = self.pitch * [1, 1, 0]
        error = contact - self.hip_point - self.target
        error = error - (error @ lateral)[..., None] * lateral  # the leg cannot move sideways
        total = ((error / (self.length * _PRECISION)) ** 2).sum(-1)
        # A joint at its limit costs as much as a foot that is 6 % of the leg length off. The small
        # term selects the position nearest to zero where the foot does not determine it.
        for joint in (self.hip, self.knee):
            position = positions[joint.name]
            total = total + 10 * _limit_cost(position, joint) + 1e-3 * np.abs(position)
        if self.ankle is not None:
            # Not zero only where the limits of the ankle prevent a level sole. A sole that is 0.3
            # rad off level costs about 1, as a foot that is 2 % of the leg length off.
            total = total + 10 * (positions[self.ankle.name] - self._level_ankle(hip, knee)) ** 2
        outward = np.clip((knee_point - self.hip_point) @ self.penalty_axis, 0, None)
        total = total + _OUTWARD_COST * outward
        # A knee that is too low by 1 % of the leg length costs 1.
        low = _MIN_KNEE_HEIGHT * self.length - (knee_point[..., 2] - contact[..., 2])
        return np.asarray(total + 100 * np.clip(low / self.length, 0, None))

    def reachable_target(self, knee: Matrix) -> Matrix:
        """Return the target, raised if no position of the knee extends the leg as far."""
        contact, _ = self._forward(self.positions(np.zeros_like(knee), knee))
        reach = float(np.linalg.norm(contact - self.hip_point, axis=-1).max())
        return np.array([*self.target[:2], max(self.target[2], -_MAX_REACH_RATIO * reach)])

    def _level_ankle(self, hip: Matrix, knee: Matrix) -> Matrix:
        constant, per_hip, per_knee = self.level
        return np.asarray(constant + per_hip * hip + per_knee * knee)

    def _forward(self, positions: Mapping[str, Matrix]) -> tuple[Matrix, Matrix]:
        """Return the positions of the contact and of the knee, each of shape (..., 3) [m]."""
        pose = self.base_pose
        knee_point = pose[..., :3, 3]
        for body in self.chain:
            pose = pose @ body.origin
            if body.joint is not None and body.joint.moves:
                name = body.joint.name
                q = positions[name] if name in positions else np.float64(self.fixed[name])
                pose = pose @ joint_motion(body, q)
                if name == self.knee.name:
                    knee_point = (pose[..., :3, :3] @ body.joint.anchor) + pose[..., :3, 3]
        return pose[..., :3, :3] @ self.tip + pose[..., :3, 3], knee_point


def _limit_cost(position: Matrix, joint: Joint) -> Matrix:
    """Return the penalty of positions near a limit: 0 outside of the margin, 1 at the limit."""
    lower, upper = joint_range(joint)
    if not np.isfinite(upper - lower):
        return np.zeros_like(position)
    margin = _LIMIT_MARGIN * (upper - lower)
    distance = np.minimum(position - lower, upper - position)
    return np.asarray(np.clip((margin - distance) / margin, 0, None) ** 2)


def _solve_leg(
    leg: Leg, robot: "Facts", positions: Mapping[str, float], shift: Matrix
) -> dict[str, float]:
    """Return the best positions of hip, knee and ankle. Empty without a hip and a knee."""
    objective = _make_objective(leg, robot, positions, shift)
    if objective is None:
        return {}
    limits = np.array([_search_range(objective.hip), _search_range(objective.knee)])
    axes = np.linspace(limits[:, 0], limits[:, 1], _GRID_SIZE, axis=-1)
    objective = replace(objective, target=objective.reachable_target(axes[1]))
    cost = objective.cost(*np.meshgrid(axes[0], axes[1], indexing="ij"))
    # The knee may bend both ways, and only the refined minima tell which way is better.
    starts = np.array([(axes[0, i], axes[1, j]) for i, j in _local_minima(cost)[:_MAX_STARTS]])
    hip, knee = _round(objective, _minimize(objective, starts, limits))
    solution = {name: float(q) for name, q in objective.positions(hip, knee).items()}
    return solution | {wheel.name: 0.0 for wheel in filter(None, [leg.joint("wheel")])}


def _local_minima(cost: Matrix) -> list[tuple[int, int]]:
    """Return the indices of the local minima of a grid, the lowest first."""
    padded = np.pad(cost, 1, constant_values=np.inf)
    lowest = np.lib.stride_tricks.sliding_window_view(padded, (3, 3)).min(axis=(-1, -2))
    indices = [(int(i), int(j)) for i, j in np.argwhere(cost <= lowest)]
    return sorted(indices, key=lambda index: float(cost[index]))


def _minimize(objective: _LegObjective, starts: Matrix, limits: Matrix) -> Matrix:
    """Return the best position of hip and knee near any of the starts, shape (2,)."""
    best = starts
    width = np.ptp(limits, axis=1)
    rows = np.arange(len(starts))
    for _ in range(_ROUNDS):
        # Two grid steps to either side of the best point.
        width = width / 5
        lower, upper = (np.clip(best + side * width / 2, *limits.T) for side in (-1, 1))
        axes = np.linspace(lower, upper, _GRID_SIZE, axis=-1)
        # Broadcasting instead of a full grid computes the motion of each joint only once.
        cost = objective.cost(axes[:, 0, :, None], axes[:, 1, None, :]).reshape(len(starts), -1)
        hip, knee = np.divmod(cost.argmin(axis=1), _GRID_SIZE)
        best = np.stack([axes[rows, 0, hip], axes[rows, 1, knee]], axis=1)
    return np.asarray(best[cost.min(axis=1).argmin()])


def _round(objective: _LegObjective, best: Matrix) -> Matrix:
    """Return hip and knee as multiples of the first step that does not move the foot much."""
    max_cost = float(objective.cost(*best)) + _MAX_ROUNDING_COST
    for step in _STEPS:
        axes = [
            [near for near in step * (round(q / step) + np.arange(-1, 2)) if low <= near <= high]
            for joint, q in zip((objective.hip, objective.knee), best, strict=True)
            for low, high in [joint_range(joint)]
        ]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
        cost = objective.cost(*grid.T)
        if len(grid) and cost.min() <= max_cost:
            return np.asarray(grid[cost.argmin()]).round(2)
    return best


def _search_range(joint: Joint) -> tuple[float, float]:
    lower, upper = joint_range(joint)
    is_unlimited = upper - lower > MAX_LIMITED_RANGE
    return (-_DEFAULT_RANGE, _DEFAULT_RANGE) if is_unlimited else (lower, upper)


def _make_objective(
    leg: Leg, robot: "Facts", positions: Mapping[str, float], shift: Matrix
) -> _LegObjective | None:
    hip, knee = leg.joint("hip"), leg.joint("knee")
    if hip is None or knee is None:
        return None
    chain = [robot.bodies[i] for i in leg.limb.chain]
    ankles = [j for j, role in zip(leg.joints, leg.roles, strict=True) if role in _LEVEL_ROLES]
    leaf = chain[-1]
    poses = body_poses(robot.bodies, positions)
    if ankles:
        angle = flat_foot_angle(leaf, leaf.zero_pose, leg.pitch, robot.meshes)
        foot = leaf.zero_pose.copy()
        foot[:3, :3] = axis_angle_to_matrix(leg.pitch, np.float64(angle)) @ foot[:3, :3]
    else:
        angle = 0.0
        foot = poses[leaf.index]  # the contact of a ball depends on the pose
    contact = contact_points(leaf, foot, robot.meshes).mean(axis=0)
    if ankles and len(robot.legs) == 2:
        contact = contact + _ankle_offset(leg, robot, foot)
    ratio = _HEIGHT_RATIO.get(len(robot.legs), _DEFAULT_HEIGHT_RATIO)
    hip_point = _hip_point(leg, robot, poses)
    length = max(leg.length, 1e-6)
    return _LegObjective(
        chain=tuple(chain),
        base_pose=poses[chain[0].parent or 0],
        hip=hip,
        knee=knee,
        ankle=ankles[-1] if ankles else None,
        level=_level_coefficients(leg, robot, positions, angle) if ankles else (0.0, 0.0, 0.0),
        fixed=positions,
        tip=foot[:3, :3].T @ (contact - foot[:3, 3]),
        hip_point=hip_point,
        target=shift + np.array([0.0, 0.0, -ratio * leg.length]),
        pitch=leg.pitch,
        penalty_axis=_penalty_axis(leg, robot, poses, hip_point) / length,
        length=length,
    )


def _ankle_offset(leg: Leg, robot: "Facts", foot: Matrix) -> Matrix:
    """Return the offset from the middle of a sole toward a point below the ankle, shape (3,) [m].

    The ankle carries the weight times its horizontal distance to the center of mass, which is put
    above this point.

    Args:
        leg: The leg.
        robot: The robot.
        foot: Pose of the foot, flat on the ground, shape (4, 4) [m].
    """
    forward = np.cross(leg.pitch, [0.0, 0.0, 1.0])
    leaf = robot.bodies[leg.limb.chain[-1]]
    ankle = [p for p, role in zip(leg.limb.points, leg.roles, strict=True) if role == "ankle"]
    if not ankle:
        return np.zeros(3)
    # The points of the limb are those of the zero pose; the foot has turned since then.
    above = foot @ invert_poses(leaf.zero_pose) @ [*ankle[-1], 1.0]
    sole = contact_points(leaf, foot, robot.meshes) @ forward
    reach = _MAX_ANKLE_OFFSET * float(np.ptp(sole)) / 2
    return np.asarray(np.clip(above[:3] @ forward - sole.mean(), -reach, reach) * forward)


def _penalty_axis(leg: Leg, robot: "Facts", poses: Sequence[Matrix], hip_point: Matrix) -> Matrix:
    """Return the horizontal unit vector in the plane of a leg that points away from the middle.

    Zero for robots that do not have four legs, for a leg in the middle, and for a leg that points
    sideways like a spider's.
    """
    middle = np.mean([_hip_point(other, robot, poses) for other in robot.legs], axis=0)
    forward = np.cross(leg.pitch, [0.0, 0.0, 1.0])
    distance = float((hip_point - middle) @ forward)
    if len(robot.legs) != 4 or abs(distance) < 0.1 * leg.length:
        return np.zeros(3)
    return np.asarray(np.sign(distance) * forward)


def _level_coefficients(
    leg: Leg, robot: "Facts", positions: Mapping[str, float], angle: float
) -> tuple[float, float, float]:
    """Return the ankle position that keeps the sole level: constant and slopes over hip and knee.

    The rotations of all joints that bend the leg then add up to `angle`.
    """
    # The axes are parallel to the normal of the leg's plane or opposite to it, so the foot turns by
    # the sum of the positions times these cosines. Solved for the ankle, that is a plane over hip
    # and knee.
    cosines = {
        joint.name: float(joint_axis(body, body.zero_pose)[1] @ leg.pitch)
        for body in (robot.bodies[i] for i in leg.limb.chain)
        if (joint := body.joint) is not None and joint.moves
    }
    roles = [(j.name, role) for j, role in zip(leg.joints, leg.roles, strict=True)]
    bending = {name for name, role in roles if role in _BENDING_ROLES}
    ankle = [name for name, role in roles if role in _LEVEL_ROLES][-1]
    hip, knee = leg.joint("hip"), leg.joint("knee")
    assert hip is not None
    assert knee is not None
    others = sum(cosines[n] * positions[n] for n in bending - {hip.name, knee.name, ankle})
    own = cosines[ankle]
    if abs(own) < 1e-6:  # the axle of a wheel may point ahead
        return 0.0, 0.0, 0.0
    return (angle - others) / own, -cosines[hip.name] / own, -cosines[knee.name] / own

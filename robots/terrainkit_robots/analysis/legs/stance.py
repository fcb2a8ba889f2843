"""Compute how a robot stands at given joint positions, and the required torques."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import center_of_mass, subtree_of
from terrainkit_robots.analysis.bodies.contact import contact_points, convex_hull, margin
from terrainkit_robots.analysis.bodies.kinematics import body_poses, joint_axis
from terrainkit_robots.analysis.bodies.shapes import min_height
from terrainkit_robots.analysis.legs.legs import Leg
from terrainkit_robots.transforms import Matrix

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts

GRAVITY = 9.81
"""Acceleration of gravity, as in MuJoCo [m/s2]."""

_MIN_STABLE_LEGS = 3
"""Robots with at least this many legs stand without a balance controller."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Stance:
    """A robot on level ground, with the trunk level."""

    positions: Mapping[str, float]
    """Position of each moving joint [rad] or [m], by name."""

    height: float
    """Height of the trunk's origin above the ground when the lowest collision shape touches it
    [m]."""

    contacts: Matrix
    """Center of each foot's contact in the frame of the trunk, shape (legs, 3) [m]."""

    force_points: Matrix
    """Center of pressure of each foot in the frame of the trunk, shape (legs, 3) [m]: the point of
    its sole closest to the center at which the feet balance the robot."""

    support: Matrix
    """Support polygon in the frame of the trunk, convex, counter-clockwise, shape (n, 2) [m]."""

    center: Matrix
    """Center of mass in the frame of the trunk, shape (3,) [m]."""

    margin: float
    """Distance of the center of mass to the edge of the support polygon [m]. Negative outside, NaN
    if a mass is unknown."""

    torques: Mapping[str, float]
    """Holding torque of each joint of the legs [N m], or force of a prismatic joint [N], by name.
    Empty if a mass is unknown."""

    @property
    def spawn_height(self) -> float:
        """Return the height of the trunk's origin with 1 cm of clearance [m]."""
        return self.height + 0.01


def compute_stance(robot: "Facts", positions: Mapping[str, float], *, total_mass: float) -> Stance:
    """Return the stance of a robot with legs.

    Args:
        robot: The robot.
        positions: Position of each moving joint [rad] or [m], by name.
        total_mass: Total declared mass [kg]. NaN if a mass is unknown.
    """
    bodies = robot.bodies
    poses = body_poses(bodies, positions)
    feet = [leg.limb.chain[-1] for leg in robot.legs]
    soles = [contact_points(bodies[i], poses[i], robot.meshes) for i in feet]
    contacts = np.array([points.mean(axis=0) for points in soles])
    heights = [
        min_height(shape, pose, robot.meshes)
        for body, pose in zip(bodies, poses, strict=True)
        for shape in body.collisions
    ]
    center = center_of_mass(bodies, poses)
    support = convex_hull(np.concatenate(soles)[:, :2])
    is_known = math.isfinite(total_mass)
    weight = sum(body.mass for body in bodies) * GRAVITY
    forces = ground_forces(contacts[:, :2], center[:2], weight)
    force_points = _force_points(soles, contacts, forces, center)
    return Stance(
        positions=positions,
        height=-min([*heights, float(contacts[:, 2].min())]),
        contacts=contacts,
        force_points=force_points,
        support=support,
        center=center,
        margin=margin(center[:2], support) if is_known else math.nan,
        torques=_static_torques(robot, poses, force_points, forces) if is_known else {},
    )


def is_statically_stable(legs: Sequence[Leg]) -> bool:
    """Return whether a robot has enough legs to stand by the stiffness of its joints alone.

    A policy has to balance a robot with fewer legs, unless its joints are locked.
    """
    return len(legs) >= _MIN_STABLE_LEGS


def _force_points(
    sole_points: Sequence[Matrix], contacts: Matrix, forces: Matrix, center: Matrix
) -> Matrix:
    """Return the centers of pressure, shape (n, 3) [m], shifted from the contacts for balance."""
    weight = float(forces.sum())
    if weight <= 0:
        return contacts
    # Clipping in `ground_forces` may leave a moment, which the soles take by moving the pressure.
    shift = (center - forces @ contacts / weight) * [1, 1, 0]
    shifted = [
        np.clip(contact + shift, points.min(axis=0), points.max(axis=0))
        for contact, points in zip(contacts, sole_points, strict=True)
    ]
    return np.column_stack([np.array(shifted)[:, :2], contacts[:, 2]])


def _static_torques(
    robot: "Facts", poses: Sequence[Matrix], force_points: Matrix, forces: Matrix
) -> dict[str, float]:
    """Return the torque of each joint of the legs that balances gravity and the ground forces."""
    bodies = robot.bodies
    up = np.array([0.0, 0.0, 1.0])
    torques: dict[str, float] = {}
    for index in sorted(robot.leg_bodies):
        joint = bodies[index].joint
        if joint is None or not joint.moves:
            continue
        # A waist carries the loads of all legs below it.
        loads = [
            (point, force * up)
            for leg, point, force in zip(robot.legs, force_points, forces, strict=True)
            if index in leg.limb.chain
        ]
        for descendant in sorted(subtree_of(bodies, index)):
            body, pose = bodies[descendant], poses[descendant]
            loads.append((pose[:3, :3] @ body.center + pose[:3, 3], -body.mass * GRAVITY * up))
        origin, axis = joint_axis(bodies[index], poses[index])
        if joint.kind == "prismatic":
            torques[joint.name] = -float(sum(axis @ force for _, force in loads))
        else:
            torques[joint.name] = -float(sum(axis @ np.cross(p - origin, f) for p, f in loads))
    return torques


def ground_forces(points: Matrix, center: Matrix, weight: float) -> Matrix:
    """Return the most even upward forces of the feet that balance a weight, shape (n,) [N].

    Args:
        points: Contacts of the feet, shape (n, 2) [m].
        center: Center of mass, shape (2,) [m].
        weight: Weight [N].
    """
    forces = np.zeros(len(points))
    loaded = np.arange(len(points))
    while len(loaded):
        # The vertical forces must add up to the weight, and their moments about the center of mass
        # to 0.
        balance = np.vstack([np.ones(len(loaded)), (points[loaded] - center).T])
        even = np.full(len(loaded), weight / len(loaded))
        residual = np.array([weight, 0.0, 0.0]) - balance @ even
        # Of all solutions, lstsq returns the change with the smallest norm: the forces closest to
        # even.
        change, *_ = np.linalg.lstsq(balance, residual, rcond=1e-9)
        pulling = even + change < -1e-9 * abs(weight)  # the ground cannot pull: this foot lifts off
        if not pulling.any():
            forces[loaded] = np.clip(even + change, 0, None)
            break
        loaded = loaded[~pulling]
    total = float(forces.sum())
    return forces * weight / total if total > 0 else np.full(len(points), weight / len(points))

"""The stance: how a robot stands at given joint positions, and what that takes."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from terrainkit_robots.analysis.bodies.contact import convex_hull, margin, sole
from terrainkit_robots.analysis.bodies.kinematics import axis_in_trunk, body_poses
from terrainkit_robots.analysis.bodies.shapes import lowest
from terrainkit_robots.analysis.legs.standing_pose import center_of_mass
from terrainkit_robots.transforms import Matrix

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts

GRAVITY = 9.81
"""Acceleration [m/s2], as MuJoCo has it."""

_ENOUGH_LEGS = 3
"""Robots with so many legs stand by the springs of their joints; those with fewer balance."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Stance:
    """A robot on level ground, with the trunk level."""

    positions: Mapping[str, float]
    """Position of each moving joint [rad] or [m], by name."""

    height: float
    """Trunk's origin above the ground, when the lowest collision shape touches it [m]."""

    contacts: Matrix
    """Middle of each foot's contact in the trunk's frame, shape (legs, 3) [m]."""

    pressures: Matrix
    """Where the ground pushes on each foot in the trunk's frame, shape (legs, 3) [m]: moved within
    its sole from the middle to where the feet balance the mass."""

    support: Matrix
    """Support polygon in the trunk's frame, convex, counter-clockwise, shape (n, 2) [m]."""

    center: Matrix
    """Centre of mass in the trunk's frame, shape (3,) [m]."""

    margin: float
    """Distance of the centre of mass to the edge of the support polygon [m]; negative outside, NaN
    if a mass is not known."""

    torques: Mapping[str, float]
    """Torque [N m], or force [N] of a sliding joint, that holds each joint of the legs, by name;
    empty if a mass is not known."""

    @property
    def spawn_height(self) -> float:
        """Return the height of the trunk's origin to let the robot go from: 1 cm of air [m]."""
        return self.height + 0.01


def stand(facts: "Facts", positions: Mapping[str, float]) -> Stance:
    """Return how a robot with legs stands at these joint positions [rad] or [m]."""
    bodies = facts.bodies
    poses = body_poses(bodies, positions)
    feet = [leg.limb.chain[-1] for leg in facts.legs]
    soles = [sole(bodies[i], poses[i], facts.meshes) for i in feet]
    contacts = np.array([points.mean(axis=0) for points in soles])
    center = center_of_mass(bodies, poses)
    support = convex_hull(np.concatenate(soles)[:, :2])
    known = math.isfinite(facts.total_mass)
    weight = sum(body.mass for body in bodies) * GRAVITY
    forces = ground_forces(contacts[:, :2], center[:2], weight)
    pressures = _pressures(soles, contacts, forces, center)
    return Stance(
        positions=positions,
        height=-_lowest(facts, poses, contacts),
        contacts=contacts,
        pressures=pressures,
        support=support,
        center=center,
        margin=margin(center[:2], support) if known else math.nan,
        torques=_torques(facts, poses, pressures, forces) if known else {},
    )


def stands_alone(facts: "Facts") -> bool:
    """Return whether it has legs enough to stand by the stiffness of its joints alone.

    One with fewer is held in balance by a policy, and stands for itself only with locked joints.
    """
    return len(facts.legs) >= _ENOUGH_LEGS


def _pressures(soles: Sequence[Matrix], contacts: Matrix, forces: Matrix, center: Matrix) -> Matrix:
    """Return where feet are pushed, shape (n, 3) [m]: as far from the middle as balance needs."""
    weight = float(forces.sum())
    if weight <= 0:
        return contacts
    missing = (center - forces @ contacts / weight) * [1, 1, 0]
    moved = [
        np.clip(contact + missing, sole.min(axis=0), sole.max(axis=0))
        for contact, sole in zip(contacts, soles, strict=True)
    ]
    return np.array(
        [[*place[:2], contact[2]] for place, contact in zip(moved, contacts, strict=True)]
    )


def _lowest(facts: "Facts", poses: Sequence[Matrix], contacts: Matrix) -> float:
    shapes = [
        lowest(shape, pose, facts.meshes)
        for body, pose in zip(facts.bodies, poses, strict=True)
        for shape in body.collisions
    ]
    return min([*shapes, float(contacts[:, 2].min())])


def _torques(
    facts: "Facts", poses: Sequence[Matrix], places: Matrix, forces: Matrix
) -> dict[str, float]:
    """Return what holds each joint of the legs against gravity and the ground's push."""
    up = np.array([0.0, 0.0, 1.0])
    torques: dict[str, float] = {}
    for index in sorted(facts.leg_bodies):
        joint = facts.bodies[index].joint
        if joint is None or not joint.moves:
            continue
        # A waist carries what all legs below it do.
        loads = [
            (place, push * up)
            for leg, place, push in zip(facts.legs, places, forces, strict=True)
            if index in leg.limb.chain
        ]
        for below in _below(facts, index):
            body, pose = facts.bodies[below], poses[below]
            loads.append((pose[:3, :3] @ body.center + pose[:3, 3], -body.mass * GRAVITY * up))
        point, axis = axis_in_trunk(facts.bodies[index], poses[index])
        if joint.kind == "prismatic":
            torques[joint.name] = -float(sum(axis @ force for _, force in loads))
        else:
            torques[joint.name] = -float(sum(axis @ np.cross(p - point, f) for p, f in loads))
    return torques


def _below(facts: "Facts", index: int) -> list[int]:
    """Return a body and all that hang from it; a parent comes before its children."""
    found = {index}
    for body in facts.bodies[index + 1 :]:
        if body.parent in found:
            found.add(body.index)
    return sorted(found)


def ground_forces(places: Matrix, center: Matrix, weight: float) -> Matrix:
    """Return how feet share a weight: the even-most upward forces in balance, shape (n,) [N].

    Args:
        places: Where the feet are, shape (n, 2) [m].
        center: Where the weight is, shape (2,) [m].
        weight: How much it is [N].
    """
    forces = np.zeros(len(places))
    standing = np.arange(len(places))
    while len(standing):
        balance = np.vstack([np.ones(len(standing)), (places[standing] - center).T])
        even = np.full(len(standing), weight / len(standing))
        missing = np.array([weight, 0.0, 0.0]) - balance @ even
        change, *_ = np.linalg.lstsq(balance, missing, rcond=1e-9)
        pulled = even + change < -1e-9 * abs(weight)  # the ground does not pull: a foot that lifts
        if not pulled.any():
            forces[standing] = np.clip(even + change, 0, None)
            break
        standing = standing[~pulled]
    total = float(forces.sum())
    return forces * weight / total if total > 0 else np.full(len(places), weight / len(places))

"""Default armature: the rotor inertia that Genesis gives to joints whose file names none.

A URDF cannot name one, so every joint of a URDF gets it. Where it is more than what the joint moves
by itself, the joint reacts to torque as if it carried something else.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from terrainkit_robots.model import Joint, Matrix

if TYPE_CHECKING:
    from terrainkit_robots.facts import Facts

GENESIS_ARMATURE = 0.1
"""What `default_armature` of the morphs URDF, MJCF and Drone is in genesis-world 1.4.5 [kg m2] or
[kg]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Moved:
    """A joint without armature and what it moves."""

    joint: Joint

    inertia: float
    """Inertia about its axis of all that is below it, all joints held at 0 [kg m2]; of a prismatic
    joint the mass [kg]."""


def moved_by_joints(facts: "Facts") -> tuple[Moved, ...]:
    """Return the motor-driven joints without armature; those that move no number are left out."""
    driven = set(facts.actuated)
    with np.errstate(all="ignore"):
        inertias = _below_joints(facts)
    return tuple(
        Moved(joint=body.joint, inertia=inertias[body.index])
        for body in facts.bodies
        if body.joint is not None
        and body.joint in driven
        and body.joint.armature == 0
        and math.isfinite(inertias[body.index])
        and inertias[body.index] > 0
    )


def _below_joints(facts: "Facts") -> list[float]:
    """Return the inertia about the axis of each body's joint of it and all below it."""
    masses = [body.mass for body in facts.bodies]
    firsts: list[Matrix] = []
    seconds: list[Matrix] = []
    for body, pose in zip(facts.bodies, facts.at_zero, strict=True):
        turn, center = pose[:3, :3], pose[:3, :3] @ body.center + pose[:3, 3]
        firsts.append(body.mass * center)
        seconds.append(turn @ body.inertia @ turn.T + _steiner(body.mass, center))
    inertias = [math.nan] * len(masses)
    for body in reversed(facts.bodies):  # children before their parents
        index, joint = body.index, body.joint
        if joint is not None and joint.moves:
            pose = facts.at_zero[index]
            axis, point = pose[:3, :3] @ joint.direction, pose[:3, :3] @ joint.anchor + pose[:3, 3]
            mass, first, second = masses[index], firsts[index], seconds[index]
            # Moved from the trunk's origin to the point, which the centre of mass need not be.
            about = second - _mixed(first, point) + _steiner(mass, point)
            inertias[index] = mass if joint.kind == "prismatic" else float(axis @ about @ axis)
        if body.parent is not None:
            masses[body.parent] += masses[index]
            firsts[body.parent] = firsts[body.parent] + firsts[index]
            seconds[body.parent] = seconds[body.parent] + seconds[index]
    return inertias


def _steiner(mass: float, arm: Matrix) -> Matrix:
    return np.asarray(mass * (arm @ arm * np.eye(3) - np.outer(arm, arm)))


def _mixed(first: Matrix, point: Matrix) -> Matrix:
    """Return the cross terms of sum m |r - p|^2, with `first` the sum of m r."""
    return np.asarray(
        2 * (first @ point) * np.eye(3) - np.outer(first, point) - np.outer(point, first)
    )

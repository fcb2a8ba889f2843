"""Carried inertia: what a joint turns or pushes, all that hangs from it included."""

import math
from typing import TYPE_CHECKING

import numpy as np

from terrainkit_robots.transforms import Matrix

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts


def carried_inertias(facts: "Facts") -> list[float]:
    """Return what the joint above each body carries, all other joints held at 0 [kg m2] or [kg].

    That is the inertia about its axis of the body and all below it, of a sliding joint their mass;
    NaN for a body without a joint that moves. It is the diagonal of the mass matrix.
    """
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

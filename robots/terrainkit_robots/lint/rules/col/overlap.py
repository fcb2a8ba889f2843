"""Rules on overlaps of bodies."""

import math
from collections import Counter

import numpy as np

from terrainkit_robots.analysis.bodies.kinematics import ancestors
from terrainkit_robots.analysis.bodies.overlap import Overlap
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.standing_pose import joint_range
from terrainkit_robots.analysis.legs.wheels import MAX_LIMITED_RANGE
from terrainkit_robots.lint.rule import Part, Severity, Violation, Violations, findings_of, rule
from terrainkit_robots.text import contrast
from terrainkit_robots.transforms import Matrix

_MAX_OVERLAP = 0.001
"""Overlap above which simulators push two bodies apart [m]."""

# 3 of 536 published files exceed it with primitives, and are thrown apart in the first step.
_MAX_OVERLAP_ERROR = 0.01
"""Overlap above which the contact force throws a robot of common size off its feet [m]."""

_MIN_RANGE = 0.01
"""Distance of zero from the end of a range below which zero is the folded pose [rad] or [m]."""

_NUM_SAMPLES = 64
"""Number of joint configurations that are tested for overlaps."""

_PRIMES = [n for n in range(2, 542) if all(n % k for k in range(2, math.isqrt(n) + 1))]
"""The first hundred primes, one for each joint."""

_MAX_OVERLAP_SHARE = 0.5
"""Share of the joint range above which overlaps are reported. The arms of a humanoid collide with
its trunk in 40 % of theirs."""

_DEFAULT_RANGE = 1.5
"""A joint without limits is sampled in +- this range [rad]."""


@rule("COL005", "overlap", "warning")
def overlap(robot: Facts) -> Violations:
    """Two bodies that are not neighbors overlap at the default pose.

    Simulators only ignore contacts between a body and its parent. They push all other overlapping
    bodies apart from the first step on: the robot jumps, jitters, or becomes unstable. Primitives
    are compared as they are, meshes by their convex hulls, as in most simulators. An overlap above
    1 mm is a warning, and above 10 mm an error on a robot with legs. The severity is one level
    lower if a convex hull is involved, since other simulators may use the mesh itself or its convex
    parts. Without a keyframe, the default pose of arms, grippers and hands is arbitrary. Their
    overlap is a note if a convex hull is involved, or if zero is at an end of the range of a joint
    between the two bodies or outside of it.

    Fix:
        Shrink or move one of the shapes, or disable contacts of this pair (<exclude> in MJCF,
        self_collisions = 1 in legged_gym).

    Source:
        MuJoCo's collision filter (computation, `Selection`); depth by mj_geomDistance.
    """
    if not robot.bodies:
        raise CannotCheckError("there is no tree of links")
    overlaps = robot.overlap_scene.detect(robot.default_pose)
    wrong = {finding.subject for finding in findings_of(robot, "COL009")}
    for pair, deepest in _group_by_pair(robot, overlaps).items():
        # A shape that is too large or displaced causes all its overlaps.
        is_reported = not wrong.isdisjoint((deepest.first.link, deepest.second.link))
        if deepest.depth <= _MAX_OVERLAP or is_reported:
            continue
        got, expected = contrast(1000 * deepest.depth, 1000 * _MAX_OVERLAP, ".1f")
        # Fixed-base arms often disable contacts of pairs that always touch, so no error for them.
        levels: tuple[Severity, ...] = ("note", "warning", "error" if robot.legs else "warning")
        level = 1 + (deepest.depth > _MAX_OVERLAP_ERROR) - deepest.has_mesh
        if _is_arbitrary_pose(robot, pair, deepest):
            level = 0
        yield Violation(
            element=Part(" and ".join(pair), deepest.second.geometry.source),
            message=f"overlap of {'the convex hulls of ' if deepest.has_mesh else ''}"
            f"{deepest.first.link} and {deepest.second.link} at the default pose: got "
            f"{got} mm; expected at most {expected} mm",
            severity=levels[level],
            certainty="likely" if deepest.has_mesh else "proven",
            measured={"depth": round(deepest.depth, 5)},
        )


def _is_arbitrary_pose(robot: Facts, pair: tuple[str, str], overlap: Overlap) -> bool:
    """Return whether neither a leg nor a keyframe defines the pose in which two bodies overlap."""
    first, second = (robot.body_of[name].index for name in pair)
    if robot.model.keyframe or not robot.leg_bodies.isdisjoint((first, second)):
        return False
    if overlap.has_mesh:
        return True
    between = set(ancestors(robot.bodies, first)) ^ set(ancestors(robot.bodies, second))
    ranges = (joint.range for k in between if (joint := robot.bodies[k].joint) is not None)
    return any(
        limits is not None and not limits[0] + _MIN_RANGE < 0 < limits[1] - _MIN_RANGE
        for limits in ranges
    )


def _group_by_pair(robot: Facts, overlaps: list[Overlap]) -> dict[tuple[str, str], Overlap]:
    """Return the deepest overlap of each pair of bodies."""
    by_pair: dict[tuple[str, str], Overlap] = {}
    for overlap in overlaps:  # sorted by depth, deepest first
        pair = robot.body_of[overlap.first.link].name, robot.body_of[overlap.second.link].name
        by_pair.setdefault(pair, overlap)
    return by_pair


@rule("COL006", "overlap-in-range", "note", certainty="likely")
def overlap_in_range(robot: Facts) -> Violations:
    """Two bodies overlap in a large part of the joint range.

    Exploration reaches every part of the range. If two bodies overlap in most of it, the joint
    range or a collision shape is larger than on the real robot. Bodies that overlap at the default
    pose are left to COL005.

    Fix:
        Compare the joint limits and the collision shapes with the real robot.

    Source:
        Counted over joint positions that are evenly distributed within the limits (Kronecker
        sequence).
    """
    if not robot.joints:
        raise CannotCheckError("there are no moving joints")
    positions = dict[str, Matrix]()
    for index, joint in enumerate(robot.joints):
        lower, upper = joint_range(joint)
        if upper - lower > MAX_LIMITED_RANGE:
            lower, upper = -_DEFAULT_RANGE, _DEFAULT_RANGE
        # Multiples of the square roots of different primes are evenly distributed modulo 1.
        samples = np.arange(1, _NUM_SAMPLES + 1) * math.sqrt(_PRIMES[index % len(_PRIMES)]) % 1
        positions[joint.name] = np.asarray(lower + (upper - lower) * samples, dtype=np.float64)
    counts: Counter[tuple[str, str]] = Counter()
    for overlaps in robot.overlap_scene.sweep(positions, _NUM_SAMPLES):
        deepest = _group_by_pair(robot, overlaps)
        counts.update(pair for pair, overlap in deepest.items() if overlap.depth > _MAX_OVERLAP)
    wrong = {finding.subject for finding in findings_of(robot, "COL005", "COL009")}
    for pair, number in counts.items():
        share = number / _NUM_SAMPLES
        if share > _MAX_OVERLAP_SHARE and wrong.isdisjoint((" and ".join(pair), *pair)):
            got, expected = contrast(share, _MAX_OVERLAP_SHARE, ".0%")
            yield Violation(
                element=Part(" and ".join(pair), robot.tree.links[pair[0]].source),
                message=f"part of the joint range in which {pair[0]} and {pair[1]} overlap: got "
                f"{got}; expected at most {expected}",
                measured={"share": share},
            )

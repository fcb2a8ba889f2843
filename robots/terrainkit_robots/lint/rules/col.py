"""Rules on collision shapes (COL)."""

import math
from collections import Counter
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body, BodyShape
from terrainkit_robots.analysis.bodies.kinematics import ancestors
from terrainkit_robots.analysis.bodies.shapes import has_bounds, min_height
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.legs import Leg
from terrainkit_robots.analysis.legs.standing_pose import joint_range
from terrainkit_robots.export.canonical import has_floating_base
from terrainkit_robots.lint.rule import Severity, Violation, rule
from terrainkit_robots.text import contrast, count

if TYPE_CHECKING:
    from terrainkit_robots.analysis.bodies.overlap import Overlap
    from terrainkit_robots.transforms import Matrix

_MAX_OVERLAP = 0.001
"""Overlap above which simulators push two bodies apart [m]."""

_MAX_OVERLAP_ERROR = 0.01
"""Overlap above which the contact force throws a robot of common size off its feet [m]."""

_MIN_FOOT_DEPTH = 0.005
"""How much lower a shape without contacts may be than those with contacts [m], such as a rubber
skin."""

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


def _has_contacts(body: Body) -> bool:
    return any(placed.geometry.contacts for placed in body.collisions)


def _disabled_shapes(body: Body) -> list[BodyShape]:
    """Return the primitive shapes of a body whose contacts are disabled (MJCF only)."""
    return [
        placed
        for placed in (*body.collisions, *body.visuals)
        if not placed.geometry.contacts and placed.geometry.shape not in ("mesh", "unknown")
    ]


@rule("COL001", "no-foot-collision", "error", needs=("legs",))
def no_foot_collision(robot: Facts) -> Iterator[Violation]:
    """A foot has no collision shape.

    A link without a collision shape passes through the ground. A robot whose feet have only visual
    shapes sinks until its shanks or its trunk touch the ground.

    Fix:
        Give the foot, or the shank that it is fixed to, a <collision>; a sphere or a box is best.

    Source:
        All simulators compute contacts from collision shapes only.
    """
    if not any(_has_contacts(body) for body in robot.bodies):
        return  # reported by COL003
    for leg in robot.legs:
        body = robot.bodies[leg.limb.chain[-1]]
        shapes = ""
        if not _has_contacts(body):
            # COL007 reports shapes with disabled contacts.
            shapes = "" if _disabled_shapes(body) else "0"
        elif _is_visual_only(leg, body, robot):
            shapes = f"0, and those of {body.top.name} end above it"
        if shapes:
            yield Violation(
                subject=leg.foot,
                source=robot.tree.links[leg.foot].source,
                message=f"collision shapes of foot {leg.foot}: got {shapes}; expected 1 or more",
                certainty="likely",
            )


def _is_visual_only(leg: Leg, body: Body, robot: Facts) -> bool:
    """Return whether the foot link has only visual shapes, below all collision shapes."""
    link = robot.tree.links[leg.foot]
    if link is body.top or not link.visuals or link.collisions:
        return False
    pose = body.zero_pose
    position = (pose @ body.poses[body.links.index(link)])[:3, 3]
    floor = min(min_height(placed, pose, robot.meshes) for placed in body.collisions)
    return floor > float(position[2])


@rule("COL002", "no-trunk-collision", "warning", needs=("legs",))
def no_trunk_collision(robot: Facts) -> Iterator[Violation]:
    """The trunk has no collision shape.

    Episodes usually terminate on contact of the trunk. Without a collision shape this contact never
    occurs: a fallen robot lies with its trunk in the ground and keeps collecting rewards. It is a
    note if only the feet collide, which is a choice for speed.

    Fix:
        Give the trunk a <collision>; one box is sufficient.

    Source:
        legged_gym's terminate_after_contacts_on and Isaac Lab's illegal_contact refer to the base.
    """
    # A body that several legs share is no part of a leg. The trunk of a planar model is the last
    # body of a chain of slides.
    used = Counter(index for leg in robot.legs for index in leg.limb.chain)
    rest = [body for body in robot.bodies if used[body.index] != 1]
    if any(_has_contacts(body) for body in rest) or robot.bodies[0].virtual:
        return
    colliding = {body.index for body in robot.bodies if _has_contacts(body)}
    if colliding:
        trunk = robot.bodies[0]
        yield Violation(
            subject=trunk.name,
            source=robot.tree.links[trunk.name].source,
            severity="info" if colliding <= {leg.limb.chain[-1] for leg in robot.legs} else None,
            message=f"collision shapes of trunk {trunk.name} and all other bodies outside of the "
            "legs: got 0; expected 1 or more",
            certainty="likely",
        )


@rule("COL003", "no-collision", "error")
def no_collision(robot: Facts) -> Iterator[Violation]:
    """The robot has no collision shapes.

    It falls through the ground and has no contacts. Without legs and a free base it is a warning,
    and a note in MJCF, where contacts are disabled on purpose: pendulums, swimmers and reachers
    need none.

    Fix:
        Give the links <collision> elements; primitives are faster and more stable than meshes.

    Source:
        All simulators compute contacts from collision shapes only.
    """
    if robot.bodies and not any(_has_contacts(body) for body in robot.bodies):
        severity: Severity | None = None if has_floating_base(robot) else "warning"
        if robot.model.kind == "mjcf":
            severity = "info"
        yield Violation(
            subject=robot.model.title,
            source=robot.model.source,
            severity=None if robot.legs else severity,
            message=f"collision shapes of {count(len(robot.links), 'link')}: got 0; expected 1 or "
            "more",
        )


@rule("COL004", "invalid-size", "error")
def invalid_size(robot: Facts) -> Iterator[Violation]:
    """The size of a shape is zero or negative.

    MuJoCo rejects the shape; PhysX treats it as a point or drops it, so that the part has no
    contacts.

    Fix:
        Give the shape the size of the part, or remove it.

    Source:
        MuJoCo: `size 0 must be positive in geom`.
    """
    for link in robot.links:
        for kind, shapes in (("collision", link.collisions), ("visual", link.visuals)):
            for shape in shapes:
                invalid = [size for size in shape.size if size <= 0]
                if invalid and shape.shape not in ("mesh", "plane"):
                    yield Violation(
                        subject=link.name,
                        source=shape.size_source or shape.source,
                        message=f"size of a {kind} {shape.shape} of link {link.name}: got "
                        f"{invalid[0]:g} m; expected more than 0 m",
                        severity="error" if kind == "collision" else "warning",
                        measured={"size": invalid[0]},
                    )


@rule("COL005", "overlap", "warning")
def overlap(robot: Facts) -> Iterator[Violation]:
    """Two bodies that are not neighbors overlap at the default pose.

    Simulators ignore contacts between a body and its parent only. All other overlaps are pushed
    apart from the first step on: the robot jumps, jitters, or becomes unstable. Primitives are
    compared as they are, meshes by their convex hulls, as in most simulators. An overlap above 1 mm
    is a warning, and above 10 mm an error on a robot with legs. The severity is one level lower if
    a convex hull is involved, since other simulators may use the mesh itself or its convex parts.
    Without a keyframe, it is a note on arms, grippers and hands if a convex hull is involved or if
    zero is at the end or outside of the range of a joint between the two bodies: nobody starts them
    there.

    Fix:
        Shrink or move one of the shapes, or disable contacts of this pair (<exclude> in MJCF,
        self_collisions = 1 in legged_gym).

    Source:
        MuJoCo's collision filter (computation, `Selection`); depth by mj_geomDistance.
    """
    if not robot.bodies:
        raise CannotCheckError("there is no tree of links")
    for pair, deepest in _group_by_pair(robot, robot.overlap_scene.detect(robot.positions)).items():
        if deepest.depth <= _MAX_OVERLAP:
            continue
        got, expected = contrast(1000 * deepest.depth, 1000 * _MAX_OVERLAP, ".1f")
        # Fixed-base arms often disable contacts of pairs that always touch, so no error for them.
        levels: tuple[Severity, ...] = ("info", "warning", "error" if robot.legs else "warning")
        level = 1 + (deepest.depth > _MAX_OVERLAP_ERROR) - deepest.has_mesh
        if _is_arbitrary_pose(robot, pair, deepest):
            level = 0
        yield Violation(
            subject=" and ".join(pair),
            source=deepest.second.geometry.source,
            message=f"overlap of {'the convex hulls of ' if deepest.has_mesh else ''}"
            f"{deepest.first.link} and {deepest.second.link} at the default pose: got "
            f"{got} mm; expected at most {expected} mm",
            severity=levels[level],
            certainty="likely" if deepest.has_mesh else "proven",
            measured={"depth": round(deepest.depth, 5)},
        )


def _is_arbitrary_pose(robot: Facts, pair: tuple[str, str], overlap: "Overlap") -> bool:
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


def _group_by_pair(robot: Facts, overlaps: "list[Overlap]") -> "dict[tuple[str, str], Overlap]":
    """Return the deepest overlap of each pair of bodies."""
    by_pair: dict[tuple[str, str], Overlap] = {}
    for each in overlaps:  # sorted by depth, deepest first
        pair = robot.body_of[each.first.link].name, robot.body_of[each.second.link].name
        by_pair.setdefault(pair, each)
    return by_pair


@rule("COL006", "overlap-in-range", "info")
def overlap_in_range(robot: Facts) -> Iterator[Violation]:
    """Two bodies overlap in a large part of the joint range.

    Exploration reaches every part of the range. If two bodies overlap in most of it, the joint
    range or a collision shape is larger than that of the real robot.

    Fix:
        Compare the joint limits and the collision shapes with the real robot.

    Source:
        Counted over joint positions that are evenly distributed within the limits (Kronecker
        sequence).
    """
    if not robot.joints:
        raise CannotCheckError("there are no moving joints")
    positions: dict[str, Matrix] = {}
    for index, joint in enumerate(robot.joints):
        lower, upper = joint_range(joint)
        if upper - lower > 4 * np.pi:
            lower, upper = -_DEFAULT_RANGE, _DEFAULT_RANGE
        # Multiples of the square roots of different primes are evenly distributed modulo 1.
        samples = np.arange(1, _NUM_SAMPLES + 1) * math.sqrt(_PRIMES[index % len(_PRIMES)]) % 1
        positions[joint.name] = np.asarray(lower + (upper - lower) * samples, dtype=np.float64)
    counts: Counter[tuple[str, str]] = Counter()
    for overlaps in robot.overlap_scene.sweep(positions, _NUM_SAMPLES):
        deepest = _group_by_pair(robot, overlaps)
        counts.update(pair for pair, each in deepest.items() if each.depth > _MAX_OVERLAP)
    for pair, number in counts.items():
        share = number / _NUM_SAMPLES
        if share > _MAX_OVERLAP_SHARE:
            got, expected = contrast(share, _MAX_OVERLAP_SHARE, ".0%")
            yield Violation(
                subject=" and ".join(pair),
                source=robot.tree.links[pair[0]].source,
                message=f"part of the joint range in which {pair[0]} and {pair[1]} overlap: got "
                f"{got}; expected at most {expected}",
                certainty="likely",
                measured={"share": share},
            )


@rule("COL007", "foot-contacts-disabled", "error", needs=("legs",))
def foot_contacts_disabled(robot: Facts) -> Iterator[Violation]:
    """The contacts of a foot are disabled.

    A geom with contype 0 and conaffinity 0 is only visual. The robot sinks until another geom
    touches the ground.

    Fix:
        Give the geom of the foot, or its default class, contype="1" or conaffinity="1".

    Source:
        MuJoCo's XML reference, geom: contype, conaffinity.
    """
    for leg in robot.legs:
        body = robot.bodies[leg.limb.chain[-1]]
        pose, meshes = body.zero_pose, robot.meshes
        disabled = [
            (min_height(placed, pose, meshes), placed)
            for placed in _disabled_shapes(body)
            if has_bounds(placed.geometry, meshes)
        ]
        enabled = [
            min_height(placed, pose, meshes)
            for placed in body.collisions
            if placed.geometry.contacts and has_bounds(placed.geometry, meshes)
        ]
        if not disabled:
            continue
        height, placed = min(disabled, key=lambda pair: pair[0])
        if enabled and height > min(enabled) - _MIN_FOOT_DEPTH:
            continue
        yield Violation(
            subject=placed.geometry.name or placed.link,
            source=placed.geometry.source,
            message=f"contacts of the {placed.geometry.shape} of {placed.link}, the lowest shape "
            "of a leg: got contype 0 and conaffinity 0; expected one of them above 0",
            certainty="likely",
        )

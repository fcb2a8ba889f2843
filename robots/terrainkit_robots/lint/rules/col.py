"""Collision shapes: whether the robot can touch what it should, and only that."""

import math
from collections import Counter
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body, Placed
from terrainkit_robots.analysis.bodies.shapes import has_extent, lowest
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.legs import Leg
from terrainkit_robots.analysis.legs.standing_pose import range_of
from terrainkit_robots.lint.rule import Severity, Violation, rule
from terrainkit_robots.transforms import Matrix

if TYPE_CHECKING:
    from terrainkit_robots.analysis.bodies.overlap import Overlap

_SLIGHT = 0.001
"""Overlap from which simulators push bodies apart: MuJoCo's solver starts at contact [m]."""

_DEEP = 0.01
"""Overlap from which the push throws a robot of ordinary size off its feet [m]."""

_SHORT = 0.005
"""How much lower a shape without contacts may be than those with, such as a rubber's skin [m]."""

_SAMPLES = 64
"""Positions of all joints that are tried for overlaps."""

_PRIMES = [n for n in range(2, 542) if all(n % k for k in range(2, math.isqrt(n) + 1))]
"""The first hundred, one for each joint."""

_LARGE_SHARE = 0.5
"""Share of the joint range from which an overlap is told: the arms of a humanoid meet its trunk in
40 % of theirs."""

_WIDE = 1.5
"""A joint without limits is sampled within +- this [rad]."""


def _has_contacts(body: Body) -> bool:
    return any(placed.geometry.contacts for placed in body.collisions)


def _silent(body: Body) -> list[Placed]:
    """Return shapes that could collide, but have their contacts switched off; MJCF only."""
    return [
        placed
        for placed in (*body.collisions, *body.visuals)
        if not placed.geometry.contacts and placed.geometry.shape not in ("mesh", "unknown")
    ]


@rule("COL001", "no-foot-collision", "error", needs=("legs",))
def no_foot_collision(robot: Facts) -> Iterator[Violation]:
    """A leg has nothing to stand on: no collision shape on its foot.

    What has no collision shape falls through the ground. A robot whose feet are only drawn sinks in
    to its shanks or its trunk, and no reward will teach it to walk.

    Fix:
        Give the foot, or the shank it is fixed to, a <collision>; a sphere or a box is best.

    Source:
        Every simulator takes contacts from collision shapes alone.
    """
    if not any(_has_contacts(body) for body in robot.bodies):
        return  # COL003
    for leg in robot.legs:
        body = robot.bodies[leg.limb.chain[-1]]
        link = robot.tree.links[leg.foot]
        if not _has_contacts(body):
            if not _silent(body):  # else COL007
                yield Violation(
                    subject=leg.foot,
                    source=link.source,
                    message=(
                        f"{leg.foot}, the foot of a leg, has 0 collision shapes; wanted 1 or more"
                    ),
                    certainty="likely",
                )
        elif _bare(leg, body, robot):
            yield Violation(
                subject=leg.foot,
                source=link.source,
                message=(
                    f"{leg.foot}, the foot of a leg, is drawn, but has 0 collision shapes, and "
                    f"those of {body.top.name} end above it; wanted 1 or more"
                ),
                certainty="likely",
            )


def _bare(leg: Leg, body: Body, robot: Facts) -> bool:
    """Return whether the foot is a link of its own that is drawn where nothing collides."""
    link = robot.tree.links[leg.foot]
    if link is body.top or not link.visuals or link.collisions:
        return False
    pose = robot.at_zero[body.index]
    place = (pose @ body.poses[body.links.index(link)])[:3, 3]
    floor = min(lowest(placed, pose, robot.meshes) for placed in body.collisions)
    return floor > float(place[2])


@rule("COL002", "no-trunk-collision", "warning", needs=("legs",))
def no_trunk_collision(robot: Facts) -> Iterator[Violation]:
    """The trunk has no collision shape.

    The usual termination, a contact of the trunk, never happens then: a robot that fell lies with
    its trunk in the ground and goes on collecting rewards.

    Fix:
        Give the trunk a <collision>; one box will do.

    Source:
        legged_gym's terminate_after_contacts_on and Isaac Lab's illegal_contact both name the base.
    """
    # A body that several legs hang from is no leg, and a planar walker's trunk hangs from slides.
    used = Counter(index for leg in robot.legs for index in leg.limb.chain)
    rest = [body for body in robot.bodies if used[body.index] != 1]
    if any(_has_contacts(body) for body in rest) or robot.bodies[0].virtual:
        return
    if any(_has_contacts(body) for body in robot.bodies):
        trunk = robot.bodies[0]
        yield Violation(
            subject=trunk.name,
            source=robot.tree.links[trunk.name].source,
            message=f"{trunk.name}, the trunk, has 0 collision shapes, and so has all that is no "
            "leg; wanted 1 or more",
            certainty="likely",
        )


@rule("COL003", "no-collision", "error")
def no_collision(robot: Facts) -> Iterator[Violation]:
    """The robot has no collision shape at all.

    It falls through every ground, and touches nothing.

    Fix:
        Give the links <collision> elements; primitives are faster and steadier than meshes.

    Source:
        Every simulator takes contacts from collision shapes alone.
    """
    if robot.bodies and not any(_has_contacts(body) for body in robot.bodies):
        yield Violation(
            subject=robot.model.title,
            source=robot.model.source,
            message=f"none of the {len(robot.links)} links has a collision shape; wanted 1 or more",
        )


@rule("COL004", "bad-size", "error")
def bad_size(robot: Facts) -> Iterator[Violation]:
    """A shape has a size that is zero or negative.

    MuJoCo refuses it, PhysX makes it a point or drops it, and what was meant to touch the ground
    does not.

    Fix:
        Give the half of a centimetre or more that the part has; take the shape away if it has none.

    Source:
        MuJoCo: `size 0 must be positive in geom`.
    """
    for link in robot.links:
        for kind, shapes in (("collision", link.collisions), ("visual", link.visuals)):
            for shape in shapes:
                wrong = [size for size in shape.size if size <= 0]
                if wrong and shape.shape not in ("mesh", "plane"):
                    yield Violation(
                        subject=link.name,
                        source=shape.size_source or shape.source,
                        message=(
                            f"a {kind} {shape.shape} of {link.name} has a size of "
                            f"{wrong[0]:g} m; wanted more than 0"
                        ),
                        severity="error" if kind == "collision" else "warning",
                        measured={"size": wrong[0]},
                    )


@rule("COL005", "overlap", "warning")
def overlap(robot: Facts) -> Iterator[Violation]:
    """Two bodies that are not neighbours are inside each other where the robot starts.

    Simulators filter contacts between a body and its parent, and no others. Every other overlap is
    pushed apart from the first step on: the robot jumps, jitters, or explodes. Primitives are
    compared as they are, meshes by their convex hull, as most simulators do. Over 1 mm is a
    warning, over 10 mm an error on a robot with legs. Where a hull takes part it is one step less,
    since other simulators may use the mesh itself, or pieces of it.

    Fix:
        Shrink or move one of the shapes, or switch the contact of this pair off (<exclude> in MJCF,
        self_collisions = 1 in legged_gym).

    Source:
        MuJoCo's collision filter (computation, `Selection`); depth by mj_geomDistance.
    """
    if not robot.bodies:
        raise CannotCheckError("there is no tree of links")
    for pair, worst in _worst(robot, robot.overlaps.overlaps(robot.positions)).items():
        if worst.depth <= _SLIGHT:
            continue
        # An arm is bolted down, and its drivers keep pairs that always touch out of the check.
        steps: tuple[Severity, ...] = ("info", "warning", "error" if robot.legs else "warning")
        what = "the convex hulls of " if worst.hulls else ""
        first, second = worst.first.link, worst.second.link
        yield Violation(
            subject=" and ".join(pair),
            source=worst.second.geometry.source,
            message=(
                f"{what}{first} and {second} are {1000 * worst.depth:.1f} mm inside each other at "
                f"the default pose; wanted at most {1000 * _SLIGHT:.0f} mm"
            ),
            severity=steps[1 + (worst.depth > _DEEP) - worst.hulls],
            certainty="likely" if worst.hulls else "proven",
            measured={"depth": round(worst.depth, 5)},
        )


def _worst(robot: Facts, overlaps: "list[Overlap]") -> "dict[tuple[str, str], Overlap]":
    """Return the deepest overlap of each pair of bodies."""
    worst: dict[tuple[str, str], Overlap] = {}
    for found in overlaps:
        names = robot.body_of[found.first.link].name, robot.body_of[found.second.link].name
        worst.setdefault(names, found)
    return worst


@rule("COL006", "overlap-in-range", "info")
def overlap_in_range(robot: Facts) -> Iterator[Violation]:
    """Two bodies overlap over a large part of the joint range.

    Exploration reaches every part of the range. Where bodies overlap in much of it, the range is
    wider than the robot's, or a collision shape larger.

    Fix:
        Compare the joint limits with the robot's, and the shapes with its parts.

    Source:
        Counted over positions spread evenly within the limits, a Kronecker sequence.
    """
    if not robot.joints:
        raise CannotCheckError("there are no moving joints")
    positions = {}
    for index, joint in enumerate(robot.joints):
        lower, upper = range_of(joint)
        if upper - lower > 4 * np.pi:
            lower, upper = -_WIDE, _WIDE
        positions[joint.name] = lower + (upper - lower) * _spread(index)
    counts: Counter[tuple[str, str]] = Counter()
    for found in robot.overlaps.sweep(positions, _SAMPLES):
        counts.update(pair for pair, w in _worst(robot, found).items() if w.depth > _SLIGHT)
    for pair, count in counts.items():
        share = count / _SAMPLES
        if share > _LARGE_SHARE:
            yield Violation(
                subject=" and ".join(pair),
                source=robot.tree.links[pair[0]].source,
                message=(
                    f"{pair[0]} and {pair[1]} overlap in {share:.0%} of the joint range; wanted "
                    f"at most {_LARGE_SHARE:.0%}"
                ),
                certainty="likely",
                measured={"share": share},
            )


def _spread(dimension: int) -> Matrix:
    """Return numbers from 0 to 1, evenly spread with those of other dimensions, shape (_SAMPLES,).

    Multiples of the square root of a prime, of which no two have a common factor.
    """
    prime = _PRIMES[dimension % len(_PRIMES)]
    return np.asarray(np.arange(1, _SAMPLES + 1) * math.sqrt(prime) % 1)


@rule("COL007", "foot-contacts-off", "error", needs=("legs",))
def foot_contacts_off(robot: Facts) -> Iterator[Violation]:
    """The shape of a foot is there, but its contacts are switched off.

    With contype and conaffinity 0 a geom is only drawn. The robot sinks in until something else
    touches the ground.

    Fix:
        Give the foot's geom contype="1" or conaffinity="1", or the class it takes them from.

    Source:
        MuJoCo's XML reference, geom: contype, conaffinity.
    """
    for leg in robot.legs:
        body = robot.bodies[leg.limb.chain[-1]]
        pose = robot.at_zero[body.index]
        off = [(lowest(p, pose, robot.meshes), p) for p in _silent(body) if _known(p, robot)]
        on = [
            lowest(p, pose, robot.meshes)
            for p in body.collisions
            if p.geometry.contacts and _known(p, robot)
        ]
        if not off:
            continue
        depth, placed = min(off, key=lambda pair: pair[0])
        if on and depth > min(on) - _SHORT:
            continue
        yield Violation(
            subject=placed.geometry.name or placed.link,
            source=placed.geometry.source,
            message=(
                f"the {placed.geometry.shape} of {placed.link}, the lowest shape of a leg, has "
                "contype 0 and conaffinity 0; wanted contacts on a foot"
            ),
            certainty="likely",
        )


def _known(placed: Placed, robot: Facts) -> bool:
    return has_extent(placed.geometry, robot.meshes)

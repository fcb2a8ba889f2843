"""Limbs: chains of bodies from the trunk to a leaf, and how much each one looks like a leg.

The score and its thresholds were tried on 60 robots: quadrupeds, humanoids, hexapods, arms, hands,
drones and cars, as published, and with names that say nothing.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.contact import sole
from terrainkit_robots.analysis.bodies.kinematics import ancestors, axis_in_trunk
from terrainkit_robots.analysis.bodies.shapes import bounds, lowest
from terrainkit_robots.description.model import Joint
from terrainkit_robots.transforms import Matrix

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts

_NEAR, _NEARISH = 0.12, 0.25
"""How far above the ground a foot may end, as a share of the robot's height at zero."""

_HELD_UP = 0.5
"""A limb that ends this share of the robot's height above what carries it, wheels or a pedestal, is
an arm. A leg that is folded at zero ends less high above the belly."""

_MIRRORED = 0.05
"""How far apart a leaf and another's mirror image may be, as a share of the robot's size."""

_APART = 0.5
"""Of two limbs that share joints, at least this share of each one's length is its own."""

_LEG_WORDS = re.compile(
    r"(?<!al)leg|foot|feet|toe|calf|thigh|shank|shin|knee|ankle|(?<![csw])hip|femur|tibia|tarsus"
    r"|coxa|(?<!tor)(?<!con)sole|haa|hfe|kfe"
)
_OTHER_WORDS = re.compile(
    r"arm(?!at)|hand(?!le)|finger|thumb|wrist|elbow|shoulder|grip|palm|head|neck|tail|wheel|rotor"
    r"|prop(?!r)|camera|mcp|knuckle|distal"
)

_TURN = 0.25
"""A body whose center of mass is this share of its radius of gyration or less away from the axis
about which it turns without end is a wheel."""

_MOST_JOINTS = 32
"""A chain of more joints is no leg, but a tail, a snake or a rope."""

_MOST_LIMBS = 64
"""More leaves than this are no limbs; the lowest are looked at."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Chain:
    """Bodies from the trunk to a leaf."""

    chain: tuple[int, ...]
    """Indices of its bodies, from the one below the trunk to the leaf."""

    joints: tuple[Joint, ...]
    """Joints with one degree of freedom along it, from the trunk."""

    points: Matrix
    """A point of the axis of each of these joints, all joints at 0, in the trunk's frame, shape
    (joints, 3) [m]."""

    tip: Matrix
    """Middle of the points that would touch the ground first, all joints at 0, in the trunk's
    frame, shape (3,) [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Limb(Chain):
    """A chain, and whether it is a leg."""

    score: float
    """How much it looks like a leg; one from 1.5 on is taken for a leg."""

    words: bool
    """Whether its names speak of legs more than of anything else."""


def find_limbs(facts: "Facts") -> tuple[Limb, ...]:
    """Return the limbs of a robot, in the order of its bodies."""
    leaves = _leaves(facts)
    if not leaves:
        return ()
    lower, upper = _extent(facts)
    ground = min(float(leaf.tip[2]) for leaf in leaves)
    height = max(float(upper[2]) - min(float(lower[2]), ground), 1e-6)
    size = max(float(np.linalg.norm(upper - lower)), 1e-6)
    rest = _lowest_of_the_rest(facts, leaves)
    bolted = 0.5 * _bolted(facts)

    def stands(foot: float) -> float:
        above, held_up = (foot - ground) / height, foot - rest > _HELD_UP * height
        return (above <= _NEARISH) / 2 + (above <= _NEAR) / 2 - held_up - bolted

    return tuple(
        _scored(leaf, leaves, facts.bodies, size, stands(float(leaf.tip[2]))) for leaf in leaves
    )


def _lowest_of_the_rest(facts: "Facts", leaves: Sequence[Chain]) -> float:
    """Return the lowest point of what belongs to no limb, such as a pedestal or wheels [m]."""
    limbs = {index for leaf in leaves for index in leaf.chain}
    return min(
        (
            lowest(shape, facts.at_zero[body.index], facts.meshes)
            for body in facts.bodies
            if body.index not in limbs
            for shape in body.collisions
        ),
        default=np.inf,
    )


def forks(one: Chain, other: Chain, size: float) -> bool:
    """Return whether two limbs are one that forks, as with toes or a closed loop that was cut.

    Legs that share a waist or a spine are two: what they share is the smaller part of both, or
    they are mirrored and long.

    Args:
        one: A limb.
        other: Another.
        size: Diagonal of the robot [m].
    """
    shared = sum(a is b for a, b in zip(one.joints, other.joints, strict=False))
    if not shared:
        return False
    apart = [_length(limb, shared) / max(_length(limb, 0), 1e-9) for limb in (one, other)]
    if min(apart) < _APART:
        return True
    return 2 * shared >= min(len(one.joints), len(other.joints)) and not _alike(one, other, size)


def _length(limb: Chain, start: int) -> float:
    """Return the length of a limb from a joint to its tip, as far as its hinges bend it [m]."""
    hinges = [
        point
        for joint, point in zip(limb.joints[start:], limb.points[start:], strict=True)
        if joint.kind != "prismatic"
    ]
    path = np.array([*hinges, limb.tip])
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def _leaves(facts: "Facts") -> list[Chain]:
    bodies = facts.bodies
    parents = {body.parent for body in bodies}
    driven = _driven(facts)
    leaves = []
    for body in bodies[1:]:
        if body.index in parents:
            continue
        chain = ancestors(bodies, body.index)
        hinged = [i for i in chain if (j := bodies[i].joint) is not None and j.moves]
        joints = [j for i in hinged if (j := bodies[i].joint) is not None]
        # A wheel that spins at the end does not bend the limb.
        bending = joints[:-1] if joints and _is_wheel(bodies[hinged[-1]]) else joints
        if len(joints) <= _MOST_JOINTS and sum(id(joint) in driven for joint in bending) >= 2:
            tip = sole(body, facts.at_zero[body.index], facts.meshes).mean(axis=0)
            points = [axis_in_trunk(bodies[i], facts.at_zero[i])[0] for i in hinged]
            leaves.append(
                Chain(chain=tuple(chain), joints=tuple(joints), points=np.array(points), tip=tip)
            )
    return sorted(leaves, key=lambda leaf: float(leaf.tip[2]))[:_MOST_LIMBS]


def _driven(facts: "Facts") -> set[int]:
    """Return the joints that a motor drives, or may drive through a tendon, by id."""
    tendons = any(not actuator.joint for actuator in facts.model.actuators)
    return {id(joint) for joint in (facts.joints if tendons else facts.actuated)}


def _is_wheel(body: Body) -> bool:
    """Return whether a body turns without end, balanced on its axis."""
    joint = body.joint
    assert joint is not None
    if joint.kind != "continuous":
        return False
    arm = body.center - joint.anchor
    aside = float(np.linalg.norm(arm - (arm @ joint.direction) * joint.direction))
    spread = float(np.clip(np.trace(body.inertia) / 2, 0, None))
    return body.mass <= 0 or aside <= _TURN * float(np.sqrt(spread / body.mass))


def _extent(facts: "Facts") -> tuple[Matrix, Matrix]:
    """Return the lower and upper corner of a box around the robot at zero."""
    corners = [pose[:3, 3] for pose in facts.at_zero]
    for body, pose in zip(facts.bodies, facts.at_zero, strict=True):
        box = bounds(body.collisions, facts.meshes)
        if box is not None:
            grid = np.array([[x, y, z] for x in box[:, 0] for y in box[:, 1] for z in box[:, 2]])
            corners += list(grid @ pose[:3, :3].T + pose[:3, 3])
    return np.min(corners, axis=0), np.max(corners, axis=0)


def _bolted(facts: "Facts") -> bool:
    """Return whether the root is a link that stands for the world."""
    return bool(facts.tree.order) and facts.tree.order[0] == facts.bodies[0].top.name == "world"


def _scored(
    leaf: Chain,
    leaves: Sequence[Chain],
    bodies: Sequence[Body],
    size: float,
    score: float,
) -> Limb:
    names = [link.name for i in leaf.chain for link in bodies[i].links]
    leggy, other = _words([*names, *(joint.name for joint in leaf.joints)])
    score += 0.5 * any(_is_twin(leaf, twin, size) for twin in leaves)
    score += 0.5 if leggy > other else -1.0 if other > leggy else 0.0
    return Limb(
        chain=leaf.chain,
        joints=leaf.joints,
        points=leaf.points,
        tip=leaf.tip,
        score=score,
        words=leggy > other,
    )


def _words(names: Sequence[str]) -> tuple[int, int]:
    """Return how many names speak of legs, and how many of other limbs and of none."""
    apart = [re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower() for name in names]
    rest = [name for name in apart if not _LEG_WORDS.search(name)]
    return len(apart) - len(rest), sum(bool(_OTHER_WORDS.search(name)) for name in rest)


def _is_twin(leaf: Chain, twin: Chain, size: float) -> bool:
    return twin is not leaf and _alike(leaf, twin, size) and not forks(leaf, twin, size)


def _alike(one: Chain, other: Chain, size: float) -> bool:
    """Return whether two limbs are mirror images of each other."""
    # One joint of a leg may have been turned into a fixed one, which is a finding of its own.
    if abs(len(other.joints) - len(one.joints)) > 1:
        return False
    return any(
        float(np.linalg.norm(one.tip * flip - other.tip)) < _MIRRORED * size
        for flip in (np.array([1, -1, 1]), np.array([-1, 1, 1]))
    )

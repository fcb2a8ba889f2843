"""Detect limbs, the chains of bodies from the trunk to a leaf, and score how leg-like they are.

The score and its thresholds were calibrated on 60 published robots: quadrupeds, humanoids,
hexapods, arms, hands, drones and cars, with their own names and with meaningless ones.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body, center_of_mass
from terrainkit_robots.analysis.bodies.contact import contact_points, convex_hull, margin
from terrainkit_robots.analysis.bodies.kinematics import ancestors, joint_axis
from terrainkit_robots.analysis.bodies.shapes import bounds, min_height
from terrainkit_robots.analysis.legs.wheels import is_leg_wheel
from terrainkit_robots.description.model import WORLD, Joint
from terrainkit_robots.mesh.mesh_cache import Meshes
from terrainkit_robots.text import group
from terrainkit_robots.transforms import Matrix

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts

# Two of three criteria: near the ground, a mirror image, names of legs.
MIN_LEG_SCORE = 1.5
"""Score from which a limb counts as a leg."""

_OTHER_NAME_COST = 1.0
"""Cost of names of other limbs, if the robot stands without this one."""

# A foot near the ground scores 1, or 0.5 if it is only low, as that of a leg with a wrong length; a
# mirror image scores 0.5, names of legs 0.5.
_NEAR_GROUND, _LOW = 0.12, 0.25
"""Height of a foot above the ground over the height of the robot at zero."""

_MIN_ARM_HEIGHT = 0.5
"""A limb that ends this high above the rest of the robot, such as wheels or a pedestal, is an arm.
Over the height of the robot. A leg that is folded at zero ends lower above the belly."""

_MAX_MIRROR_ERROR = 0.05
"""Distance of a leaf to the mirror image of another one, at most, over the size of the robot."""

_MIN_SURROUNDING = 4
"""Number of equal limbs around the center of mass, at least, that are legs at any height."""

_MIN_SEPARATE_LENGTH = 0.5
"""Unshared length over length, at least, of each of two limbs that share joints."""

_LEG_NAME = re.compile(
    r"(?<!al)leg|foot|feet|toe|calf|thigh|shank|shin|knee|ankle|(?<![csw])hip|femur|tibia|tarsus"
    r"|coxa|(?<!tor)(?<!con)sole|haa|hfe|kfe"
)
_OTHER_NAME = re.compile(
    r"arm(?!at)|hand(?!le)|wrist|elbow|shoulder|head|neck|tail|wheel|rotor|prop(?!r)|camera"
)
"""Names of limbs that carry a robot only if it has too few other legs to stand on."""

_FINGER_NAME = re.compile(
    r"finger|thumb|grip|palm|mcp|knuckle|distal|index|pinky|(?<![a-z])ring(?![a-z])"
)
"""Names of fingers: a hand that points down is built like a robot on legs."""

_HAND_NAME = re.compile(r"hand(?!le)|palm|gripper")
"""Name of a trunk whose limbs are fingers."""

_MAX_JOINTS = 32
"""A chain of more joints is a tail, a snake or a rope."""

_MAX_LIMBS = 64
"""Number of leaves that are considered, from the lowest upward."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Chain:
    """Bodies from the trunk to a leaf."""

    chain: tuple[int, ...]
    """Indices of its bodies, from below the trunk to the leaf."""

    joints: tuple[Joint, ...]
    """Its joints with one degree of freedom, from the trunk."""

    points: Matrix
    """A point of the axis of each of these joints in the frame of the trunk, all joints at 0,
    shape (joints, 3) [m]."""

    tip: Matrix
    """Center of the points that touch the ground first in the frame of the trunk, all joints at 0,
    shape (3,) [m]."""

    has_wheel: bool
    """Whether its last joint turns a wheel."""

    linkage: int | None = None
    """Number of the limb that it forms with other chains, since loops connect them. None without
    loops."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Limb(Chain):
    """A chain and its score."""

    score: float
    """How leg-like it is. A limb with at least 1.5 is a leg."""

    has_leg_names: bool
    """Whether more of its names suggest a leg than anything else."""

    is_named_otherwise: bool
    """Whether its names suggest another limb than a leg."""


def detect_limbs(robot: "Facts", actuated: Sequence[Joint]) -> tuple[Limb, ...]:
    """Return the limbs of a robot in the order of its bodies.

    Args:
        robot: The robot.
        actuated: Joints that an actuator moves, directly or perhaps through a tendon.
    """
    bodies, meshes = robot.bodies, robot.meshes
    if not bodies:
        return ()
    lower, upper = _robot_bounds(bodies, meshes)
    size = max(float(np.linalg.norm(upper - lower)), 1e-6)
    chains = _join_loops(_chains(bodies, meshes), robot, size)
    leaves = _leaves(chains, bodies, actuated)
    if not leaves:
        return ()
    ground = min(float(leaf.tip[2]) for leaf in leaves)
    height = max(float(upper[2]) - min(float(lower[2]), ground), 1e-6)
    in_limbs = {index for leaf in leaves for index in leaf.chain}
    rest = min(  # the lowest point outside of the limbs, such as a pedestal or wheels
        (
            min_height(shape, body.zero_pose, meshes)
            for body in bodies
            if body.index not in in_limbs
            for shape in body.collisions
        ),
        default=np.inf,
    )
    surrounding = _surrounding(leaves, bodies, size)
    # The slides of a planar model move its base.
    is_planar = any(body.parent == 0 and body.virtual for body in bodies)
    is_fixed_base = robot.tree.order[0] == bodies[0].top.name == WORLD and not is_planar

    def height_score(leaf: Chain) -> float:
        foot = float(leaf.tip[2])
        if leaf in surrounding and leaf.points[0][2] - _length(leaf, 0) < rest:
            return 1.0  # it reaches the ground, also if it is stretched sideways at zero
        ratio = (foot - ground) / height
        is_arm = foot - rest > _MIN_ARM_HEIGHT * height
        return (ratio <= _LOW) / 2 + (ratio <= _NEAR_GROUND) / 2 - is_arm - is_fixed_base / 2

    limbs = [
        _make_limb(leaf, leaves, bodies, size, height_score(leaf), leaf in surrounding)
        for leaf in leaves
    ]
    return _without_needless_limbs(limbs, bodies)


def _surrounding(chains: Sequence[Chain], bodies: Sequence[Body], size: float) -> list[Chain]:
    """Return the lowest chain and its copies if they are all around the robot, as in a spider."""
    lowest = chains[0]
    tolerance = _MAX_MIRROR_ERROR * size

    def shape(chain: Chain) -> Matrix:
        """Return the heights of start and tip and the length of a chain, shape (3,) [m]."""
        return np.array([chain.points[0][2], chain.tip[2], _length(chain, 0)])

    def is_copy(other: Chain) -> bool:
        is_equal = bool((np.abs(shape(lowest) - shape(other)) < tolerance).all())
        return is_equal and len(other.joints) == len(lowest.joints)

    copies = [chain for chain in chains if is_copy(chain)]
    center = center_of_mass(bodies, [body.zero_pose for body in bodies])[:2]
    starts = convex_hull(np.array([copy.points[0][:2] for copy in copies]))
    is_around = len(starts) >= _MIN_SURROUNDING and margin(center, starts) > 0
    return copies if is_around else []


def _without_needless_limbs(limbs: Sequence[Limb], bodies: Sequence[Body]) -> tuple[Limb, ...]:
    """Return the limbs; those that are named otherwise are no legs unless they carry the robot.

    They do if the mass is above the tips of all legs, but not above the tips of the other ones.
    """
    legs = [limb for limb in limbs if limb.score >= MIN_LEG_SCORE]
    center = center_of_mass(bodies, [body.zero_pose for body in bodies])[:2]

    def carry(tips: Sequence[Matrix]) -> bool:
        polygon = convex_hull(np.reshape(tips, (-1, 3))[:, :2])
        return len(polygon) >= 3 and margin(center, polygon) > 0

    if carry([limb.tip for limb in legs]) and not carry(
        [limb.tip for limb in legs if not limb.is_named_otherwise]
    ):
        return tuple(limbs)
    return tuple(
        replace(limb, score=limb.score - _OTHER_NAME_COST) if limb.is_named_otherwise else limb
        for limb in limbs
    )


def is_branch(one: Chain, other: Chain, size: float) -> bool:
    """Return whether two chains are branches of one limb, such as toes or a cut closed loop.

    Legs that share a waist or a spine are separate: the shared part is the smaller one in both, or
    the legs are mirrored and long.

    Args:
        one: A chain.
        other: Another chain.
        size: Diagonal of the robot [m].
    """
    if one.linkage is not None and one.linkage == other.linkage:
        return True
    shared = sum(a is b for a, b in zip(one.joints, other.joints, strict=False))
    if not shared:
        return False
    separate = [_length(limb, shared) / max(_length(limb, 0), 1e-9) for limb in (one, other)]
    if min(separate) < _MIN_SEPARATE_LENGTH:
        return True
    is_short = 2 * shared >= min(len(one.joints), len(other.joints))
    return is_short and not _is_mirror_image(one, other, size)


def _length(limb: Chain, start: int) -> float:
    """Return the length of a limb from a joint over its hinges to its tip [m]."""
    hinges = [
        point
        for joint, point in zip(limb.joints[start:], limb.points[start:], strict=True)
        if joint.kind != "prismatic"
    ]
    path = np.array([*hinges, limb.tip])
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def _chains(bodies: Sequence[Body], meshes: Meshes) -> list[Chain]:
    """Return the chain to each end."""
    chains = []
    for body in _ends(bodies, meshes):
        chain = ancestors(bodies, body.index)
        moving = [i for i in chain if (j := bodies[i].joint) is not None and j.moves]
        joints = [j for i in moving if (j := bodies[i].joint) is not None]
        # A wheel at the end does not bend the limb.
        has_wheel = bool(joints) and is_leg_wheel(bodies[moving[-1]], meshes)
        if joints and len(joints) <= _MAX_JOINTS:
            tip = contact_points(body, body.zero_pose, meshes).mean(axis=0)
            points = [joint_axis(bodies[i], bodies[i].zero_pose)[0] for i in moving]
            chains.append(
                Chain(
                    chain=tuple(chain),
                    joints=tuple(joints),
                    points=np.array(points),
                    tip=tip,
                    has_wheel=has_wheel,
                )
            )
    return chains


def _ends(bodies: Sequence[Body], meshes: Meshes) -> list[Body]:
    """Return the bodies without children, or instead of them a foot that touches the ground first.

    A foot carries rods or toes and no longer chains.
    """
    children = group((body.parent or 0, body.index) for body in bodies[1:])

    def bottom(index: int) -> float:
        body = bodies[index]
        return float(contact_points(body, body.zero_pose, meshes)[:, 2].min())

    ends = {body.index for body in bodies[1:]} - set(children)
    feet = {
        index: carried
        for index, carried in children.items()
        if index > 0 and len(carried) > 1 and ends.issuperset(carried)
        if bottom(index) < min(map(bottom, carried))
    }
    ends -= {index for carried in feet.values() for index in carried}
    return [bodies[index] for index in sorted(ends | set(feet))]


def _join_loops(chains: Sequence[Chain], robot: "Facts", size: float) -> list[Chain]:
    """Return the chains with the numbers of the limbs that loops join them to.

    A loop joins the branches of each body that it moves. A waist joins no limbs: it carries limbs
    that are mirror images.
    """
    numbers: dict[int, int] = {}
    for number, loop in enumerate(robot.loops):
        ends = [set(ancestors(robot.bodies, index)) for index in loop.bodies]
        joined = {
            k
            for index in ends[0] ^ ends[1]
            if (side := [k for k, chain in enumerate(chains) if index in chain.chain])
            and not any(
                _is_mirror_image(chains[a], chains[b], size) for a, b in combinations(side, 2)
            )
            for k in side
        }
        before = {numbers[k] for k in joined if k in numbers}
        joined |= {k for k, other in numbers.items() if other in before}
        numbers |= dict.fromkeys(joined, number)
    return [replace(chain, linkage=numbers.get(k)) for k, chain in enumerate(chains)]


def _leaves(
    chains: Sequence[Chain], bodies: Sequence[Body], actuated: Sequence[Joint]
) -> list[Chain]:
    """Return the chains with at least two actuated joints, in all of their branches together."""
    actuated_ids = {id(joint) for joint in actuated}
    driven: dict[int | tuple[int, ...], set[int]] = {}

    def limb(chain: Chain) -> int | tuple[int, ...]:
        return chain.chain if chain.linkage is None else chain.linkage

    for chain in chains:
        # A single motor bends a four-bar leg; the wheel is the second one.
        count = len(chain.joints) - (chain.has_wheel and chain.linkage is None)
        own = map(id, chain.joints[:count])
        driven.setdefault(limb(chain), set()).update(actuated_ids.intersection(own))
    leaves = [chain for chain in chains if len(driven[limb(chain)]) >= 2]
    # A body without mass and collision is a picture of a linkage beside the leg that it follows.
    ends = [bodies[leaf.chain[-1]] for leaf in leaves]
    solid = [leaf for leaf, end in zip(leaves, ends, strict=True) if end.mass > 0 or end.collisions]
    return sorted(solid or leaves, key=lambda leaf: float(leaf.tip[2]))[:_MAX_LIMBS]


def _robot_bounds(bodies: Sequence[Body], meshes: Meshes) -> tuple[Matrix, Matrix]:
    """Return the lower and upper corner of the bounding box of the robot at zero."""
    shapes = (
        replace(shape, pose=body.zero_pose @ shape.pose)
        for body in bodies
        for shape in body.collisions
    )
    corners = [body.zero_pose[:3, 3] for body in bodies]
    corners += list(box) if (box := bounds(shapes, meshes)) is not None else []
    return np.min(corners, axis=0), np.max(corners, axis=0)


def _make_limb(
    leaf: Chain,
    leaves: Sequence[Chain],
    bodies: Sequence[Body],
    size: float,
    score: float,
    surrounds: bool,
) -> Limb:
    links = [link.name for i in leaf.chain for link in bodies[i].links]
    names = [
        re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()
        for name in (*links, *(joint.name for joint in leaf.joints))
    ]
    # Legs of a robot on wheels are often named after them.
    is_leg = [_LEG_NAME.search(name) or (leaf.has_wheel and "wheel" in name) for name in names]
    rest = [name for name, leg in zip(names, is_leg, strict=True) if not leg]
    leg_names = len(names) - len(rest)
    fingers = sum(bool(_FINGER_NAME.search(name)) for name in rest)
    other_names = fingers + sum(
        bool(_OTHER_NAME.search(name)) and not _FINGER_NAME.search(name) for name in rest
    )
    has_image = surrounds or any(
        other is not leaf
        and _is_mirror_image(leaf, other, size)
        and not is_branch(leaf, other, size)
        for other in leaves
    )
    score += 0.5 * has_image
    is_other = other_names > leg_names
    is_hand = any(_HAND_NAME.search(link.name.lower()) for link in bodies[0].links)
    is_finger = (is_other and 2 * fingers > other_names) or (is_hand and not leg_names)
    score += 0.5 * (leg_names > other_names) - _OTHER_NAME_COST * is_finger
    return Limb(
        **vars(leaf),
        score=score,
        has_leg_names=leg_names > other_names,
        is_named_otherwise=is_other and not is_finger,
    )


def _is_mirror_image(one: Chain, other: Chain, size: float) -> bool:
    """Return whether two limbs are mirror images of each other."""
    # One joint of a leg may have become fixed, which is a violation of its own.
    if abs(len(other.joints) - len(one.joints)) > 1:
        return False
    return any(
        float(np.linalg.norm(one.tip * flip - other.tip)) < _MAX_MIRROR_ERROR * size
        # Left and right, or front and rear; which of them is y depends on how the robot faces.
        for flip in (np.array([1, -1, 1]), np.array([-1, 1, 1]))
    )

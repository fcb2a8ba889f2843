"""Detect assemblies that are mounted twice as they are, instead of mirrored."""

import math
from collections.abc import Sequence

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.shapes import shape_key
from terrainkit_robots.analysis.symmetry.mirror_pairs import MirrorPair
from terrainkit_robots.description.model import Joint
from terrainkit_robots.transforms import Matrix

_MIN_PAIRS = 2
"""Number of moving bodies from which two chains are assemblies."""

_RELATIVE_TOLERANCE = 1e-3
"""Relative difference of masses, centers of mass and inertias of copies: rounding."""

_ABSOLUTE_TOLERANCE = 1e-4
"""Difference of positions [m] and directions of copies: rounding."""


def copied_pairs(pairs: Sequence[MirrorPair]) -> tuple[MirrorPair, ...]:
    """Return the pairs that belong to two equal assemblies, such as the arms of a dual-arm robot.

    The bodies of both assemblies are equal in their own frames: meshes, inertials, joints and
    limits. Equal bodies that are symmetric themselves are mirror images as well.

    Args:
        pairs: The pairs of mirrored joints, parents first.
    """
    top_of: dict[tuple[int | None, int | None], int] = {}
    assemblies: dict[int, list[MirrorPair]] = {}
    for pair in pairs:
        left, right = pair.left.body, pair.right.body
        top = top_of.get((left.parent, right.parent), left.index)
        top_of[left.index, right.index] = top
        assemblies.setdefault(top, []).append(pair)
    return tuple(
        pair
        for members in assemblies.values()
        if len(members) >= _MIN_PAIRS and all(map(_is_copy, members))
        # The poses of the first bodies are where the assemblies are mounted.
        if all(_same(p.left.body.origin, p.right.body.origin) for p in members[1:])
        for pair in members
    )


def _is_copy(pair: MirrorPair) -> bool:
    left, right = pair.left.body, pair.right.body
    a, b = pair.left.joint, pair.right.joint
    return (
        math.isclose(left.mass, right.mass, rel_tol=_RELATIVE_TOLERANCE)
        and _same(left.center, right.center)
        and np.allclose(
            left.inertia,
            right.inertia,
            rtol=0,
            atol=_RELATIVE_TOLERANCE * float(np.abs(left.inertia).max()),
        )
        and _same(a.direction, b.direction)
        and _limits(a) == _limits(b)
        and _shapes(left) == _shapes(right)
    )


def _same(one: Matrix, other: Matrix) -> bool:
    return bool(np.allclose(one, other, rtol=0, atol=_ABSOLUTE_TOLERANCE))


def _limits(joint: Joint) -> tuple[float | None, ...]:
    limit = joint.limit
    return () if limit is None else (limit.lower, limit.upper, limit.effort, limit.velocity)


def _shapes(body: Body) -> list[object]:
    return [shape_key(placed.geometry) for placed in (*body.collisions, *body.visuals)]

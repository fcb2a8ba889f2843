"""Detect inertias that are placeholders."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.inertia.physical import MIN_INERTIA, is_in_range, is_zero
from terrainkit_robots.description.model import Link
from terrainkit_robots.transforms import Matrix


def placeholder_inertias(bodies: Sequence[Body]) -> list[tuple[Matrix, list[Link]]]:
    """Return the placeholders, shape (3, 3) [kg m2], and their links, at most one per body.

    Args:
        bodies: All bodies of the robot.

    Returns:
        Each placeholder [kg m2], shape (3, 3), with the links that have it.
    """
    links = {body.index: body.main_link for body in bodies if body.mass > MIN_INERTIA}
    groups: dict[tuple[float, ...], list[int]] = {}
    for index, link in links.items():
        inertia = link.inertial.inertia if link.inertial else None
        if inertia is not None and is_in_range(inertia) and not is_zero(inertia):
            groups.setdefault(tuple(float(x) for x in inertia.flat), []).append(index)
    found = []
    for elements, indices in groups.items():
        inertia = np.reshape(elements, (3, 3))
        members = {i: links[i] for i in indices}
        # Left and right parts have the same numbers, so two bodies are no placeholder.
        is_majority = len(indices) >= max(3, math.ceil(len(links) / 2))
        if is_identity(inertia) or (is_majority and _are_different(members, inertia, bodies)):
            found.append((inertia, list(members.values())))
    return found


def _are_different(links: Mapping[int, Link], inertia: Matrix, bodies: Sequence[Body]) -> bool:
    """Return whether links with the same inertia are not copies of one part."""
    masses = {link.inertial.mass for link in links.values() if link.inertial}
    if len(masses) == 1 and not _is_round(inertia):
        return False
    for index, link in links.items():
        parent = links.get(bodies[index].parent or 0)
        if parent not in (None, link) and _shapes(parent) != (_shapes(link) or None):
            return True
    return False


def _is_round(inertia: Matrix) -> bool:
    """Return whether an inertia is spherical, or diagonal with at most two digits."""
    # CAD programs write many digits, and products that are not exactly zero.
    moments = np.diag(inertia)
    if (inertia != np.diag(moments)).any():
        return False
    return len(set(moments)) == 1 or all(float(f"{x:.2g}") == x for x in moments)


def _shapes(link: Link) -> Counter[tuple[str, tuple[float, ...], str]]:
    return Counter(
        (shape.shape, shape.size, shape.mesh.filename if shape.mesh else "")
        for shape in (*link.collisions, *link.visuals)
    )


def is_identity(inertia: Matrix) -> bool:
    """Return whether an inertia is 1 kg m2 about every axis."""
    return np.array_equal(inertia, np.eye(3))

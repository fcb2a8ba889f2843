"""Detect inertias that are placeholders."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.inertia.physical import MIN_INERTIA, is_in_range, is_zero
from terrainkit_robots.description.model import Link


def placeholder_inertias(bodies: Sequence[Body]) -> list[list[Link]]:
    """Return groups of links with the same placeholder inertia, at most one link per body."""
    links = {body.index: body.main_link for body in bodies if body.mass > MIN_INERTIA}
    groups: dict[tuple[float, ...], list[int]] = {}
    for index, link in links.items():
        inertia = link.inertial.inertia if link.inertial else None
        if inertia is not None and is_in_range(inertia) and not is_zero(inertia):
            groups.setdefault(tuple(float(x) for x in inertia.flat), []).append(index)
    found = []
    for indices in groups.values():
        members = {i: links[i] for i in indices}
        is_majority = len(indices) >= max(3, math.ceil(len(links) / 2))
        if is_identity(links[indices[0]]) or (is_majority and _are_different(members, bodies)):
            found.append(list(members.values()))
    return found


def _are_different(links: Mapping[int, Link], bodies: Sequence[Body]) -> bool:
    """Return whether links with the same inertia are not copies of one part."""
    masses = {link.inertial.mass for link in links.values() if link.inertial}
    if len(masses) == 1 and not _is_round(next(iter(links.values()))):
        return False
    for index, link in links.items():
        parent = links.get(bodies[index].parent or 0)
        if parent not in (None, link) and _shapes(parent) != (_shapes(link) or None):
            return True
    return False


def _is_round(link: Link) -> bool:
    """Return whether an inertia is spherical, or diagonal with at most two digits."""
    assert link.inertial is not None
    assert link.inertial.inertia is not None
    moments = np.diag(link.inertial.inertia)
    if (link.inertial.inertia != np.diag(moments)).any():
        return False
    return len(set(moments)) == 1 or all(float(f"{x:.2g}") == x for x in moments)


def _shapes(link: Link) -> Counter[tuple[str, tuple[float, ...], str]]:
    return Counter(
        (shape.shape, shape.size, shape.mesh.filename if shape.mesh else "")
        for shape in (*link.collisions, *link.visuals)
    )


def is_identity(link: Link) -> bool:
    """Return whether the inertia of a link is 1 kg m2 about every axis."""
    assert link.inertial is not None
    return np.array_equal(link.inertial.inertia, np.eye(3))  # type: ignore[arg-type]

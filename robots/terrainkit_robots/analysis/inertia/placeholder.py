"""Placeholders: inertias that nobody took from the part."""

import math
from collections import Counter
from collections.abc import Mapping

import numpy as np

from terrainkit_robots.analysis.bodies.main_link import main_link
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.inertia.physical import NOTHING, in_reach, is_zero
from terrainkit_robots.description.model import Link


def placeholders(robot: Facts) -> list[list[Link]]:
    """Return the groups of links, one a body at most, whose inertia is a placeholder."""
    links = {body.index: main_link(body) for body in robot.bodies if body.mass > NOTHING}
    groups: dict[tuple[float, ...], list[int]] = {}
    for index, link in links.items():
        inertia = link.inertial.inertia if link.inertial else None
        if inertia is not None and in_reach(inertia) and not is_zero(inertia):
            groups.setdefault(tuple(float(x) for x in inertia.flat), []).append(index)
    found = []
    for indices in groups.values():
        members = {i: links[i] for i in indices}
        most = len(indices) >= max(3, math.ceil(len(links) / 2))
        if is_identity(links[indices[0]]) or (most and _differ(robot, members)):
            found.append(list(members.values()))
    return found


def _differ(robot: Facts, links: Mapping[int, Link]) -> bool:
    """Return whether bodies of one inertia are not one part that is used again and again."""
    masses = {link.inertial.mass for link in links.values() if link.inertial}
    if len(masses) == 1 and not _looks_made_up(next(iter(links.values()))):
        return False
    for index, link in links.items():
        parent = links.get(robot.bodies[index].parent or 0)
        if parent not in (None, link) and _shapes_of(parent) != (_shapes_of(link) or None):
            return True
    return False


def _looks_made_up(link: Link) -> bool:
    """Return whether an inertia is that of a ball, or has no products and two digits at most."""
    assert link.inertial is not None
    assert link.inertial.inertia is not None
    moments = np.diag(link.inertial.inertia)
    if (link.inertial.inertia != np.diag(moments)).any():
        return False
    return len(set(moments)) == 1 or all(float(f"{x:.2g}") == x for x in moments)


def _shapes_of(link: Link) -> Counter[tuple[str, tuple[float, ...], str]]:
    return Counter(
        (shape.shape, shape.size, shape.mesh.filename if shape.mesh else "")
        for shape in (*link.collisions, *link.visuals)
    )


def is_identity(link: Link) -> bool:
    """Return whether an inertia is that of 1 kg m2 about every axis."""
    assert link.inertial is not None
    return np.array_equal(link.inertial.inertia, np.eye(3))  # type: ignore[arg-type]

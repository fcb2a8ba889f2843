"""Repairs of inertias: what to write into the file instead."""

from collections.abc import Iterator

import numpy as np

from terrainkit_robots.analysis.bodies.shapes import bounds
from terrainkit_robots.analysis.cached_fact import per_robot
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.inertia.physical import (
    box_inertia,
    gyration_radius,
    is_zero,
    nearest_physical,
    principal_moments,
    triangle_ratio,
)
from terrainkit_robots.analysis.symmetry.mirror_pairs import partners
from terrainkit_robots.description.fix import Edit, Fix, RemoveAttribute, SetAttribute
from terrainkit_robots.description.model import Inertial, Link
from terrainkit_robots.transforms import Matrix

_SAME_MASS = 0.02
"""Share by which masses may differ for a link to take the inertia of its mirror image."""


def repair(robot: Facts, link: Link) -> Fix | None:
    """Return how to give a link an inertia that a body can have; None if that fails.

    The best one is that of its mirror image, the next the nearest to what is written. Where nothing
    can be kept, as of zeros, the link is taken for a solid box around its body.
    """
    inertial = link.inertial
    if inertial is None or inertial.inertia is None:
        return None
    source = inertial.inertia_source or inertial.source
    if source.element is None or source == link.source:
        return None  # it cannot be written, or MuJoCo made it up
    for inertia, what in (
        (_mirrored(robot, link), "that of its mirror image"),
        (_nearest(robot, link, inertial.inertia), "the nearest one that a body can have"),
        (_of_a_box(robot, link, inertial), "that of a solid box around the body"),
    ):
        if inertia is not None:
            return Fix(
                safety="unsafe",
                description=f"Replace the inertia of link {link.name} by {what}.",
                edits=tuple(_edits(inertial, inertia)),
            )
    return None


def _is_diagonal(inertia: Matrix) -> bool:
    return bool(np.abs(inertia - np.diag(np.diag(inertia))).max() <= 1e-12 * np.abs(inertia).max())


def _mirrored(robot: Facts, link: Link) -> Matrix | None:
    """Return the inertia of the mirror image, if that is sound, in the frame of the <inertial>."""
    body = robot.body_of.get(link.name)
    index = None if body is None else partners(robot).get(body.index)
    if body is None or index is None or len(robot.bodies[index].links) != len(body.links):
        return None
    place, other = _place(robot, link), robot.bodies[index].links[_numbers(robot)[link.name]]
    mass, its = _mass(link), _mass(other)
    if other.inertial is None or other.inertial.inertia is None or not its > 0:
        return None
    inertia, moments = other.inertial.inertia, principal_moments(other.inertial.inertia)
    if moments[0] <= 0 or triangle_ratio(moments) < 1 or abs(mass - its) > _SAME_MASS * its:
        return None
    normal = robot.mirror.normal
    turn = place.T @ (np.eye(3) - 2 * np.outer(normal, normal)) @ _place(robot, other)
    return np.asarray(turn @ inertia @ turn.T)


@per_robot
def _numbers(robot: Facts) -> dict[str, int]:
    """Return which of its body's links each one is."""
    return {link.name: number for body in robot.bodies for number, link in enumerate(body.links)}


def _mass(link: Link) -> float:
    return (link.inertial.mass if link.inertial else None) or 0.0


def _place(robot: Facts, link: Link) -> Matrix:
    """Return the axes of the link's inertia in the trunk's frame, all joints at 0, shape (3, 3)."""
    body = robot.body_of[link.name]
    assert link.inertial is not None
    pose = robot.at_zero[body.index] @ body.poses[_numbers(robot)[link.name]] @ link.inertial.origin
    return np.asarray(pose[:3, :3])


def _nearest(robot: Facts, link: Link, inertia: Matrix) -> Matrix | None:
    """Return the nearest physical inertia, unless the body is too small for it.

    One number that is far too large makes the nearest of all six far too large.
    """
    if is_zero(inertia):
        return None  # nothing is near to it but nothing
    nearest, body, mass = nearest_physical(inertia), robot.body_of.get(link.name), _mass(link)
    box = None if body is None else bounds(body.collisions or body.visuals, robot.meshes)
    if nearest is None or box is None or not mass > 0:
        return nearest
    radius = gyration_radius(principal_moments(nearest), mass)
    return nearest if radius <= np.linalg.norm(box[1] - box[0]) / 2 else None


def _of_a_box(robot: Facts, link: Link, inertial: Inertial) -> Matrix | None:
    """Return the inertia of a box as large as the link's body, in the frame of its <inertial>."""
    body = robot.body_of.get(link.name)
    box = None if body is None else bounds(body.collisions or body.visuals, robot.meshes)
    if body is None or box is None or (box[1] - box[0]).min() <= 0 or not _mass(link) > 0:
        return None
    turn = (body.poses[_numbers(robot)[link.name]] @ inertial.origin)[:3, :3]
    return np.asarray(turn.T @ box_inertia(_mass(link), box[1] - box[0]) @ turn)


def _edits(inertial: Inertial, inertia: Matrix) -> Iterator[Edit]:
    """Yield the edits that write an inertia, given in the frame of the <inertial>."""
    source = inertial.inertia_source or inertial.source
    if not inertial.attribute:
        for name, number in zip(_NAMES, _six(inertia), strict=True):
            yield SetAttribute(source=source, name=name, value=number)
    elif inertial.attribute == "diaginertia" and _is_diagonal(inertia):
        yield SetAttribute(source=source, name="diaginertia", value=" ".join(_six(inertia)[:3]))
    else:  # which has no axes of its own
        turn = inertial.origin[:3, :3]
        full = " ".join(_six(turn @ inertia @ turn.T))
        yield SetAttribute(source=source, name="fullinertia", value=full)
        for name in (inertial.attribute, inertial.axes_attribute):
            if name not in ("", "fullinertia"):
                yield RemoveAttribute(source=source, name=name)


_NAMES = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


def _six(inertia: Matrix) -> list[str]:
    places = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return [f"{inertia[place] + 0.0:.10g}" for place in places]

"""Sound inertia: links whose inertia every reader takes, where the robot as a whole has no defect.

Rules judge what moves as one. MuJoCo judges each link, and without any tolerance: it refuses a
sensor of 10 g without an inertia on a trunk of 60 kg, and a plate whose last digit was rounded.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from terrainkit_robots.analysis.inertia.merged_inertia import merged_inertia
from terrainkit_robots.analysis.inertia.physical import (
    MIN_INERTIA,
    is_in_range,
    principal_moments,
    triangle_ratio,
)
from terrainkit_robots.description.model import Inertial, Link
from terrainkit_robots.text import names
from terrainkit_robots.transforms import Matrix, invert_poses

if TYPE_CHECKING:
    from terrainkit_robots.analysis.bodies.bodies import Body

_ROUNDED = 0.99
"""Moments that miss the triangle inequality by less were rounded, or belong to a plate; those that
miss it by more are an error of the robot, which is left as it is."""

_THINNEST = 1e-6
"""Smallest second moment of a rounded plate, as a share of the largest: more than ten digits lose
when the plate is turned, and nothing that is felt."""


def with_valid_inertia(
    bodies: Sequence["Body"], links: Sequence[Link], notes: list[str]
) -> list[Link]:
    """Return links with inertias that are taken, and note what was changed.

    The mass of a link whose inertia no reader takes goes to the heaviest link that it is fixed to,
    with which it moves as before. Where that does not help, all stays as it is. An inertia that is
    not written is one of zero.

    Args:
        bodies: What moves as one.
        links: Links of the robot, in any order.
        notes: Gets a sentence for each body that was changed.
    """
    known = {link.name: link for link in links}
    for body in bodies:
        poses = {link.name: pose for link, pose in zip(body.links, body.poses, strict=True)}
        mine = {name: _rounded_up(_written(known[name])) for name in poses if name in known}
        known |= _gathered(mine, poses, notes)
    return [known[link.name] for link in links]


def _is_sound(inertia: Matrix) -> bool:
    moments = principal_moments(inertia)
    return bool(moments[0] > MIN_INERTIA) and triangle_ratio(moments) >= 1


def _has_mass(inertial: Inertial | None) -> bool:
    return inertial is not None and inertial.mass is not None and 0 < inertial.mass < np.inf


def _is_refused(link: Link) -> bool:
    """Return whether a link has a mass, and an inertia that is known and not taken."""
    inertial = link.inertial
    if inertial is None or inertial.inertia is None or not _has_mass(inertial):
        return False
    return is_in_range(inertial.inertia) and not _is_sound(inertial.inertia)


def _written(link: Link) -> Link:
    """Return a link whose mass has an inertia, be it one of zero."""
    inertial = link.inertial
    if inertial is None or inertial.inertia is not None or not _has_mass(inertial):
        return link
    return replace(link, inertial=replace(inertial, inertia=np.zeros((3, 3))))


def _rounded_up(link: Link) -> Link:
    """Return a link whose inertia is not thinner than a plate, if rounding may have made it so."""
    inertia = link.inertial.inertia if link.inertial else None
    if inertia is None or not _has_mass(link.inertial) or not is_in_range(inertia):
        return link
    moments = principal_moments(inertia)
    if moments[0] <= MIN_INERTIA or not _ROUNDED <= triangle_ratio(moments) < 1 + _THINNEST:
        return link
    second, axes = np.linalg.eigh(np.trace(inertia) / 2 * np.eye(3) - inertia)
    kept = (axes * np.maximum(second, _THINNEST * second.max())) @ axes.T
    assert link.inertial is not None
    plate = replace(link.inertial, inertia=np.trace(kept) * np.eye(3) - kept)
    return replace(link, inertial=plate)


def _gathered(
    links: Mapping[str, Link], poses: Mapping[str, Matrix], notes: list[str]
) -> Mapping[str, Link]:
    """Return the links of a body, with the masses of those that are refused on the heaviest."""
    refused = [name for name, link in links.items() if _is_refused(link)]
    weighed = [name for name, link in links.items() if _has_mass(link.inertial)]
    if not refused or len(weighed) < 2:
        return links
    heaviest = max(weighed, key=lambda name: _mass(links[name]))
    moved = [name for name in refused if name != heaviest]
    back = invert_poses(poses[heaviest])
    inertials = {name: links[name].inertial for name in (heaviest, *moved)}
    whole = merged_inertia((part, back @ poses[name]) for name, part in inertials.items() if part)
    if whole is None or whole.inertia is None or not moved or not _is_sound(whole.inertia):
        return links
    notes.append(
        f"put the mass of {names(moved)} on {heaviest}, which they are fixed to: MuJoCo takes no "
        "mass without an inertia"
    )
    made = dict(links) | {name: replace(links[name], inertial=None) for name in moved}
    return made | {heaviest: replace(links[heaviest], inertial=whole)}


def _mass(link: Link) -> float:
    return (link.inertial.mass if link.inertial else None) or 0.0

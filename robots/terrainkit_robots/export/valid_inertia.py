"""Make the inertia of each link valid where the inertia of the whole body is.

Lint rules check rigid bodies. MuJoCo checks each link without tolerance: it rejects a sensor of 10
g without inertia on a trunk of 60 kg, and a plate with a rounded last digit.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
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

_MIN_ROUNDED_RATIO = 0.99
"""Moments that violate the triangle inequality by less are rounded or belong to a plate. A larger
violation is an error of the robot and is kept."""

_MIN_MOMENT_RATIO = 1e-6
"""Smallest second moment of a rounded plate, as a share of the largest. It is more than ten digits
lose under rotation, and has no effect on the dynamics."""


def with_valid_inertia(
    bodies: Sequence[Body], links: Sequence[Link], changes: list[str]
) -> list[Link]:
    """Return links with valid inertia, and note the changes.

    A link without a valid inertia passes its mass to the heaviest link that it is fixed to, which
    does not change the motion. If that does not help, the links are unchanged. A missing inertia
    counts as zero.

    Args:
        bodies: Rigid bodies of the robot.
        links: Links of the robot in any order.
        changes: List to which a sentence is appended for each body that is changed.
    """
    updated = {link.name: link for link in links}
    for body in bodies:
        poses = {link.name: pose for link, pose in zip(body.links, body.poses, strict=True)}
        body_links = {name: _corrected(updated[name]) for name in poses if name in updated}
        updated |= _merge_into_heaviest(body_links, poses, changes)
    return [updated[link.name] for link in links]


def _is_valid(inertia: Matrix) -> bool:
    moments = principal_moments(inertia)
    return bool(moments[0] > MIN_INERTIA) and triangle_ratio(moments) >= 1


def _has_mass(inertial: Inertial | None) -> bool:
    return inertial is not None and inertial.mass is not None and 0 < inertial.mass < np.inf


def _is_rejected(link: Link) -> bool:
    """Return whether a link has a mass and an invalid inertia."""
    inertial = link.inertial
    if inertial is None or inertial.inertia is None or not _has_mass(inertial):
        return False
    return is_in_range(inertial.inertia) and not _is_valid(inertial.inertia)


def _corrected(link: Link) -> Link:
    """Return a link whose mass has an inertia, a slightly larger one if it is rounded."""
    inertial = link.inertial
    if inertial is None or not _has_mass(inertial):
        return link
    inertia = np.zeros((3, 3)) if inertial.inertia is None else inertial.inertia
    if is_in_range(inertia):
        inertia = _without_rounding(inertia)
    return replace(link, inertial=replace(inertial, inertia=inertia))


def _without_rounding(inertia: Matrix) -> Matrix:
    """Return a slightly larger inertia if rounding made it invalid."""
    moments = principal_moments(inertia)
    if (
        moments[0] <= MIN_INERTIA
        or not _MIN_ROUNDED_RATIO <= triangle_ratio(moments) < 1 + _MIN_MOMENT_RATIO
    ):
        return inertia
    # The second moments of mass are tr(I) / 2 - I. A plate has one of 0, rounded to a negative
    # number.
    second, axes = np.linalg.eigh(np.trace(inertia) / 2 * np.eye(3) - inertia)
    second_moments = (axes * np.maximum(second, _MIN_MOMENT_RATIO * second.max())) @ axes.T
    plate: Matrix = np.trace(second_moments) * np.eye(3) - second_moments
    return plate


def _merge_into_heaviest(
    links: Mapping[str, Link], poses: Mapping[str, Matrix], changes: list[str]
) -> Mapping[str, Link]:
    """Return the links of a body, with rejected masses moved to the heaviest link."""
    rejected = [name for name, link in links.items() if _is_rejected(link)]
    with_mass = {
        name: link.inertial.mass or 0.0
        for name, link in links.items()
        if link.inertial is not None and _has_mass(link.inertial)
    }
    if not rejected or len(with_mass) < 2:
        return links
    heaviest = max(with_mass, key=with_mass.__getitem__)
    merged = [name for name in rejected if name != heaviest]
    to_heaviest = invert_poses(poses[heaviest])
    inertials = {name: links[name].inertial for name in (heaviest, *merged)}
    total = merged_inertia(
        (part, to_heaviest @ poses[name]) for name, part in inertials.items() if part
    )
    if total is None or total.inertia is None or not merged or not _is_valid(total.inertia):
        return links
    changes.append(
        f"moved the mass of {names(merged)} to {heaviest}, to which they are fixed: MuJoCo "
        "rejects masses without inertia"
    )
    result = dict(links) | {name: replace(links[name], inertial=None) for name in merged}
    return result | {heaviest: replace(links[heaviest], inertial=total)}

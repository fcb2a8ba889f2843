"""Compute the inertial of MJCF bodies from compiled geoms, and apply the compiler's limits."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from terrainkit_robots.description.model import Inertial, Link, Source
from terrainkit_robots.transforms import Matrix


def geom_inertial(
    source: Source, compiled: tuple[float, Matrix, Matrix], missing: Sequence[float]
) -> Inertial | None:
    """Return the inertial that MuJoCo computes from geoms; None if they have no mass.

    Args:
        source: Location of the body.
        compiled: Mass [kg], pose and moments of inertia [kg m2] of the compiled geoms.
        missing: Masses of the geoms whose inertia is not compiled [kg].
    """
    mass, pose, moments = compiled
    if missing:
        return Inertial(source=source, mass=mass + sum(missing), inertia=np.full((3, 3), np.nan))
    if mass == 0:
        return None
    axes, origin = pose[:3, :3], np.eye(4)
    origin[:3, 3] = pose[:3, 3]
    inertia = axes @ np.diag(moments) @ axes.T
    return Inertial(source=source, mass=mass, origin=origin, inertia=inertia)


def apply_minimums(link: Link, least: float, least_moment: float) -> Inertial | None:
    """Return the inertial of a link with the compiler's minimum mass [kg] and inertia [kg m2].

    Negative values are kept.
    """
    inertial = link.inertial
    if link.virtual or max(least, least_moment) <= 0:
        return inertial
    if inertial is None:
        return Inertial(source=link.source, mass=least, inertia=np.eye(3) * least_moment)
    mass, inertia = inertial.mass, inertial.inertia
    if mass is not None and 0 <= mass < least:
        mass = least
    if inertia is not None and np.isfinite(inertia).all():
        moments, axes = np.linalg.eigh(inertia)
        small = (moments >= 0) & (moments < least_moment)
        inertia = axes @ np.diag(np.where(small, least_moment, moments)) @ axes.T
    return replace(inertial, mass=mass, inertia=inertia)


def scale_to_total_mass(links: Sequence[Link], total: float) -> tuple[Link, ...]:
    """Return links with masses scaled to a total mass [kg], if the file sets one."""
    masses = [link.inertial.mass for link in links if link.inertial is not None]
    known = sum(mass for mass in masses if mass is not None)
    if not (total > 0 and known > 0 and math.isfinite(known)) or None in masses:
        return tuple(links)
    factor = total / known
    return tuple(
        replace(link, inertial=_scaled(link.inertial, factor)) if link.inertial else link
        for link in links
    )


def _scaled(inertial: Inertial, factor: float) -> Inertial:
    mass, inertia = inertial.mass, inertial.inertia
    return replace(
        inertial,
        mass=None if mass is None else mass * factor,
        inertia=None if inertia is None else inertia * factor,
    )

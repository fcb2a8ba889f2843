"""Compute the inertia of MJCF bodies from their geoms, as MuJoCo does."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from terrainkit_robots.description.model import Inertial, Source
from terrainkit_robots.transforms import Matrix


@dataclass(frozen=True, kw_only=True, eq=False)
class Solid:
    """A shape with mass."""

    mass: float
    """Mass [kg]; NaN if it depends on a mesh file."""

    pose: Matrix
    """Pose in the body frame, shape (4, 4) [m]."""

    moments: Matrix
    """Principal moments of inertia along the axes of the shape, shape (3,) [kg m2]; NaN if they
    depend on a mesh file."""


def make_solid(
    shape: str, size: Sequence[float], pose: Matrix, *, mass: float, density: float
) -> Solid | None:
    """Return the solid of a shape; None if it has no mass.

    Args:
        shape: Kind of the shape.
        size: MuJoCo's size parameters [m].
        pose: Pose in the body frame, shape (4, 4) [m].
        mass: Mass [kg]; NaN to compute it from the density.
        density: Density [kg/m3].
    """
    massless = mass == 0 or (np.isnan(mass) and density == 0)
    if massless or shape == "plane" or min(size, default=1) <= 0:
        return None
    volume, moments = _unit_volume_and_moments(shape, size)
    mass = float(density * volume) if np.isnan(mass) else mass
    return Solid(mass=mass, pose=pose, moments=mass * moments)


def _unit_volume_and_moments(shape: str, size: Sequence[float]) -> tuple[float, Matrix]:
    """Return the volume [m3] and the moments of inertia for unit mass; NaN if unknown."""
    match shape:
        case "sphere":
            r = size[0]
            return 4 / 3 * np.pi * r**3, np.full(3, 2 / 5 * r**2)
        case "box":
            x, y, z = np.square(size)
            return 8 * float(np.prod(size)), np.array([y + z, x + z, x + y]) / 3
        case "ellipsoid":
            x, y, z = np.square(size)
            return 4 / 3 * np.pi * float(np.prod(size)), np.array([y + z, x + z, x + y]) / 5
        case "cylinder":
            r, half = size
            across = r**2 / 4 + half**2 / 3
            return 2 * np.pi * r**2 * half, np.array([across, across, r**2 / 2])
        case "capsule":
            return _capsule(*size)
    return np.nan, np.full(3, np.nan)


def _capsule(r: float, half: float) -> tuple[float, Matrix]:
    caps, middle = 4 / 3 * np.pi * r**3, 2 * np.pi * r**2 * half
    volume = caps + middle
    if not volume > 0:
        return volume, np.zeros(3)
    # the center of a half ball is 3/8 r from its flat side, which is `half` from the center
    across_ends = 2 / 5 * r**2 + half**2 + 3 / 4 * r * half
    across = caps * across_ends + middle * (r**2 / 4 + half**2 / 3)
    along = caps * 2 / 5 * r**2 + middle * r**2 / 2
    return volume, np.array([across, across, along]) / volume


def sum_solids(solids: Sequence[Solid], source: Source) -> Inertial | None:
    """Return the inertia of a body made of solids; None if there are none.

    Unknown values are NaN.
    """
    if not solids:
        return None
    mass = sum(each.mass for each in solids)
    unknown = Inertial(source=source, mass=mass, inertia=np.full((3, 3), np.nan))
    if not mass > 0 or not np.isfinite(mass):
        return unknown
    center = sum((each.mass * each.pose[:3, 3] for each in solids), start=np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for each in solids:
        rotation, arm = each.pose[:3, :3], each.pose[:3, 3] - center
        inertia += rotation @ np.diag(each.moments) @ rotation.T
        inertia += each.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))  # parallel axes
    if not np.isfinite(inertia).all():
        return unknown
    origin = np.eye(4)
    origin[:3, 3] = center
    return Inertial(source=source, mass=mass, origin=origin, inertia=inertia)

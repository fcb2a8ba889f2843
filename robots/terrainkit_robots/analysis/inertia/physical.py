"""Check whether a rigid body can have an inertia, and find the nearest inertia that it can have.

The inertia I and the second moments S of a body have the same information: I = trace(S) 1 - S. No
mass distribution has a negative second moment along any axis. For the principal moments this is
the triangle inequality e0 + e1 >= e2.
"""

import numpy as np

from terrainkit_robots.transforms import Matrix

MIN_INERTIA = 1e-14
"""Masses [kg] and moments [kg m2] up to this count as zero. MuJoCo rejects smaller moments of a
fullinertia, as in URDF, and masses up to 1e-15 kg."""

MAX_INERTIA = 1e12
"""Masses [kg] and moments [kg m2] from this on are invalid, and are not used in computations."""

_MIN_MOMENT_RATIO = 1e-3
"""Smallest over largest second moment of a repaired inertia: a plate that is thirty times as wide
as thick. For an exact plate, rounding decides whether MuJoCo accepts it."""


def is_zero(inertia: Matrix) -> bool:
    """Return whether all elements of an inertia count as zero."""
    return bool((np.abs(inertia) <= MIN_INERTIA).all())


def is_in_range(inertia: Matrix) -> bool:
    """Return whether all elements of an inertia are finite and below MAX_INERTIA."""
    return bool((np.abs(inertia) < MAX_INERTIA).all())


def principal_moments(inertia: Matrix) -> Matrix:
    """Return the principal moments of an inertia.

    Args:
        inertia: Inertia [kg m2], shape (3, 3).

    Returns:
        Principal moments [kg m2], ascending, shape (3,).
    """
    return np.asarray(np.linalg.eigvalsh(inertia))


def triangle_ratio(principal: Matrix) -> float:
    """Return the ratio (e0 + e1) / e2 of principal moments.

    It is 1 for a flat plate or a thin rod, 2 for a ball, and less than 1 for no physical body.

    Args:
        principal: Principal moments e0, e1 and e2 [kg m2], ascending, shape (3,).
    """
    return float((principal[0] + principal[1]) / principal[2])


def nearest_physical(inertia: Matrix) -> Matrix | None:
    """Return the physical inertia with the nearest second moments and the same principal axes.

    Args:
        inertia: Symmetric matrix [kg m2], shape (3, 3).

    Returns:
        Inertia [kg m2], shape (3, 3); None if no second moment is positive.
    """
    if principal_moments(inertia)[2] <= 0:
        inertia = -inertia  # every sign is wrong
    # The second moments of mass, S = tr(I) / 2 - I, must not be negative. This is equivalent to the
    # triangle inequality of the principal moments, and I = tr(S) - S turns them back.
    moments, axes = np.linalg.eigh(np.trace(inertia) / 2 * np.eye(3) - inertia)
    largest = float(moments.max())
    if not 0 < largest < np.inf:
        return None
    clipped = np.maximum(moments, _MIN_MOMENT_RATIO * largest)
    second = (axes * clipped) @ axes.T
    return np.asarray(np.trace(second) * np.eye(3) - second)


def box_inertia(mass: float, size: Matrix) -> Matrix:
    """Return the inertia of a solid box about its center, shape (3, 3) [kg m2].

    Args:
        mass: Mass [kg].
        size: Side lengths, shape (3,) [m].
    """
    squares = size**2
    # m (b^2 + c^2) / 12 about the axis along side a.
    return np.asarray(np.diag(mass / 12 * (squares.sum() - squares)))


def gyration_radius(principal: Matrix, mass: float) -> float:
    """Return the largest radius of gyration of a body.

    Args:
        principal: Principal moments [kg m2], ascending, shape (3,).
        mass: Mass [kg].

    Returns:
        Radius [m], or 0 if it is undefined.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        radius = float(np.sqrt(max(float(principal[2]), 0.0) / mass)) if mass > 0 else 0.0
    return radius if np.isfinite(radius) else 0.0

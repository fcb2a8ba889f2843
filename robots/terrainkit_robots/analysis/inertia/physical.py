"""Inertia that a rigid body can have, and the nearest one to an inertia that none can.

A body's inertia I and its second moments S hold the same: I = trace(S) 1 - S. No mass distribution
has a negative second moment along any axis; for the principal moments that is the triangle
inequality e0 + e1 >= e2.
"""

import numpy as np

from terrainkit_robots.transforms import Matrix

NOTHING = 1e-15
"""MuJoCo's mjMINVAL: mass [kg] and moments [kg m2] up to this are none to it."""

LARGEST = 1e12
"""Mass [kg] or moment [kg m2] beyond which a number is no robot's, and is not reckoned with."""

_THINNEST = 1e-3
"""Smallest second moment that a repaired inertia keeps, as a share of the largest: a plate thirty
times as wide as it is thick. Of an exact plate, the last digit decides whether MuJoCo takes it."""


def is_zero(inertia: Matrix) -> bool:
    """Return whether all of an inertia is nothing."""
    return bool((np.abs(inertia) <= NOTHING).all())


def in_reach(inertia: Matrix) -> bool:
    """Return whether an inertia can be reckoned with: numbers, and not beyond all robots."""
    return bool((np.abs(inertia) < LARGEST).all())


def principal_moments(inertia: Matrix) -> Matrix:
    """Return the principal moments of an inertia, ascending, shape (3,) [kg m2]."""
    return np.asarray(np.linalg.eigvalsh(inertia))


def triangle_ratio(principal: Matrix) -> float:
    """Return (e0 + e1) / e2 of principal moments in ascending order.

    It is 1 for a flat plate or a thin rod, 2 for a ball, and less than 1 for nothing that exists.
    """
    return float((principal[0] + principal[1]) / principal[2])


def nearest_physical(inertia: Matrix) -> Matrix | None:
    """Return the physical inertia whose second moments are nearest, shape (3, 3) [kg m2].

    The axes stay; None where nothing of the inertia can be kept.
    """
    if principal_moments(inertia)[2] <= 0:
        inertia = -inertia  # every sign is wrong
    moments, axes = np.linalg.eigh(np.trace(inertia) / 2 * np.eye(3) - inertia)
    largest = float(moments.max())
    if not 0 < largest < np.inf:
        return None
    kept = np.maximum(moments, _THINNEST * largest)
    second = (axes * kept) @ axes.T
    return np.asarray(np.trace(second) * np.eye(3) - second)


def box_inertia(mass: float, sides: Matrix) -> Matrix:
    """Return the inertia of a solid box about its middle, shape (3, 3) [kg m2].

    Args:
        mass: Its mass [kg].
        sides: Its side lengths, shape (3,) [m].
    """
    squares = sides**2
    return np.asarray(np.diag(mass / 12 * (squares.sum() - squares)))


def gyration_radius(principal: Matrix, mass: float) -> float:
    """Return the largest radius of gyration of a body [m], or 0 where that is not a number."""
    with np.errstate(over="ignore", invalid="ignore"):
        radius = float(np.sqrt(max(float(principal[2]), 0.0) / mass)) if mass > 0 else 0.0
    return radius if np.isfinite(radius) else 0.0

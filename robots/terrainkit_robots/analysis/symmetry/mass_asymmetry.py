"""Compare the masses and centers of mass of mirrored bodies."""

import math

import numpy as np

from terrainkit_robots.analysis.symmetry.mirror import Mirror
from terrainkit_robots.analysis.symmetry.mirror_pairs import MirrorPair

MAX_MASS_DIFFERENCE = 0.02
"""Allowed relative difference of masses: cables and screws that CAD adds on one side only."""

_MIN_MASS_SHARE = 0.001
"""Share of the robot's mass. At the end of a leg, the whole mass of such a body shifts the robot's
center of mass by a thousandth of the leg's distance."""

MAX_COM_ERROR, _COM_ERROR_SHARE = 0.002, 0.1
"""Allowed distance of a center of mass from the mirrored one: a constant [m] plus a share of the
radius of gyration."""


def has_valid_masses(pair: MirrorPair) -> bool:
    """Return whether both bodies have valid masses; the INR rules report the others."""
    bodies = pair.left.body, pair.right.body
    inertials = [link.inertial for body in bodies for link in body.links]
    masses = [inertial.mass for inertial in inertials if inertial is not None]
    valid = all(mass is not None and mass >= 0 for mass in masses)
    return valid and min(body.mass for body in bodies) > 0


def is_negligible(pair: MirrorPair, total: float) -> bool:
    """Return whether both bodies are too light for a difference to matter, such as gears.

    Args:
        pair: The mirrored joints.
        total: Mass of the robot [kg].
    """
    return max(pair.left.body.mass, pair.right.body.mass) < _MIN_MASS_SHARE * total


def com_error(mirror: Mirror, pair: MirrorPair) -> float:
    """Return the distance of a center of mass from the mirrored one [m]."""
    return float(np.linalg.norm(mirror.image(pair.left.arm) - pair.right.arm))


def max_com_error(pair: MirrorPair) -> float:
    """Return the allowed distance of two bodies with mass [m]."""
    radii = [
        math.sqrt(max(float(body.principal[2]), 0.0) / body.mass)
        for body in (pair.left.body, pair.right.body)
    ]
    return MAX_COM_ERROR + _COM_ERROR_SHARE * min(radii)


def is_merged(pair: MirrorPair) -> bool:
    """Return whether one of two bodies has several links with mass."""
    return any(
        sum(link.inertial is not None and bool(link.inertial.mass) for link in body.links) > 1
        for body in (pair.left.body, pair.right.body)
    )

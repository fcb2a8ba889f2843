"""Numbers as a robot's file has them: ten digits, and nothing where there is nothing."""

from collections.abc import Sequence

import numpy as np

from terrainkit_robots.transforms import Matrix

DIGITS = 10
"""Significant digits: a tenth of a nanometer on a robot of a meter."""

_NOTHING = 1e-12
"""A length [m] or angle [rad] below this is what rounding leaves of zero."""


def number_text(values: float | Sequence[float] | Matrix) -> str:
    """Return numbers with a space between."""
    flat = np.atleast_1d(np.asarray(values, dtype=float)).ravel()
    return " ".join(f"{value + 0.0:.{DIGITS}g}" for value in flat)  # minus zero becomes zero


def place_text(values: Sequence[float] | Matrix) -> str:
    """Return lengths [m] or angles [rad] with a space between, without the noise of rounding."""
    flat = np.asarray(values, dtype=float)
    return number_text(np.where(np.abs(flat) < _NOTHING, 0.0, flat))

"""Format numbers for robot files."""

from collections.abc import Sequence

import numpy as np

from terrainkit_robots.transforms import Matrix

DIGITS = 10
"""Significant digits: a tenth of a nanometer on a robot of one meter."""

_NOTHING = 1e-12
"""Lengths [m] and angles [rad] below this are rounding errors of zero."""


def number_text(values: float | Sequence[float] | Matrix) -> str:
    """Return numbers separated by spaces."""
    flat = np.atleast_1d(np.asarray(values, dtype=float)).ravel()
    return " ".join(f"{value + 0.0:.{DIGITS}g}" for value in flat)  # turns -0 into 0


def place_text(values: Sequence[float] | Matrix) -> str:
    """Return lengths or angles separated by spaces, with rounding errors removed.

    Args:
        values: Lengths [m] or angles [rad].
    """
    flat = np.asarray(values, dtype=float)
    return number_text(np.where(np.abs(flat) < _NOTHING, 0.0, flat))

"""Find values that mark missing heights although the file does not say so."""

import numpy as np
from numpy.typing import NDArray

_MARKERS = (-32768.0, -32767.0, -9999.0, -99999.0)
"""What GDAL, SRTM and ESRI grids mark missing heights with."""

_LIMITS = (0.0, 32767.0, 65535.0, 4294967295.0)
"""Ends of integer types: markers only if they are far from all other values."""

_HUGE = 1e30
"""Beyond this, a value is a marker such as -3.4e38."""

_MIN_LEVELS = 16
"""Different heights of ground that is not a few flat steps."""

_MIN_GAP = 100.0
"""Smallest gap between the ground and a value that is no common marker [m]."""

_MAX_MARKERS = 3


def find_nodata(
    values: NDArray[np.float64], dtype: np.dtype[np.generic], scale: float
) -> dict[float, int]:
    """Return the values that likely mark missing heights, and how often they occur.

    Only the lowest and the highest value can be one. A common marker has to be beyond the others by
    a tenth of their range, the end of an integer type by ten times and any other value by a hundred
    times their range and 100 m.

    Args:
        values: Values of a file, NaN where they are known to be missing.
        dtype: Type of the values in the file.
        scale: Meters per unit.
    """
    found: dict[float, int] = {}
    rest = values[~np.isnan(values)]
    while rest.size and len(found) < _MAX_MARKERS:
        for value in (rest.min(), rest.max()):
            others = rest[rest != value]
            if _is_marker(float(value), others, scale, dtype):
                found[float(value)] = rest.size - others.size
                rest = others
                break
        else:
            break
    return found


def _is_marker(
    value: float, others: NDArray[np.float64], scale: float, dtype: np.dtype[np.generic]
) -> bool:
    if abs(value) >= _HUGE:
        return True
    if dtype.itemsize == 1 or not others.size:
        return value in _MARKERS
    low, high = float(others.min()), float(others.max())
    gap, span = max(low - value, value - high), high - low
    if value in _MARKERS:
        return gap > span / 10
    is_limit = value in _LIMITS and dtype.kind in "iu" and (value > 0 or dtype.kind == "u")
    is_far = gap > 10 * span if is_limit else gap > 100 * span and gap * scale > _MIN_GAP
    return is_far and np.unique(others[:: max(1, others.size // 10_000)]).size >= _MIN_LEVELS

"""Gradient and steps: the two parts of a height difference between neighboring columns."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.feasibility.node_arrays import FloatArray

SLOPE_LENGTH = 0.1
"""Length over which ground is steep to both sides if it is a slope [m]; otherwise it is a step. A
tread of twice this length is level ground between two steps."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Gradient:
    """The change per column along x and y that continues on both sides of each node."""

    x: FloatArray
    """Slope along x at each node [m per column], shape (nx, ny, m)."""

    y: FloatArray
    """Slope along y at each node [m per column], shape (nx, ny, m)."""

    diagonal: FloatArray
    """Larger slope along the two diagonals [m per column of the diagonal], shape (nx, ny, m). On
    the ridge of a pyramid, only a diagonal continues on both sides."""

    def slope(self, spacing: float) -> FloatArray:
        """Return the slope at each node.

        Args:
            spacing: Distance between two columns [m].

        Returns:
            Rise over run, shape (nx, ny, m).
        """
        # Diagonal neighbors are sqrt(2) columns apart.
        return np.maximum(np.hypot(self.x, self.y), self.diagonal / 2**0.5) / spacing


def gradient_of(floor: FloatArray, spacing: float) -> Gradient:
    """Return the gradient of floors.

    Args:
        floor: Heights of the floors [m], shape (nx, ny, m), NaN where there are fewer than m.
        spacing: Distance between two columns [m].
    """
    lag = max(1, round(SLOPE_LENGTH / spacing))
    diagonals = (_slope(floor, (lag, lag)), _slope(floor, (lag, -lag)))
    return Gradient(
        x=_slope(floor, (lag, 0)),
        y=_slope(floor, (0, lag)),
        diagonal=np.maximum(*np.abs(diagonals)),
    )


def _slope(floor: FloatArray, lag: tuple[int, int]) -> FloatArray:
    """Return the smaller of the slopes to both sides, with the sign of the slope behind.

    Where they differ in sign, as on a ridge or in a valley, both must continue for twice the lag;
    else the slope is 0, as on rough ground.

    Args:
        floor: Floors [m], shape (nx, ny, m).
        lag: Columns along x and y to the place with which a column is compared.
    """
    behind, ahead = _shift(floor, -1, lag), _shift(floor, 1, lag)
    far_behind, far_ahead = _shift(floor, -2, lag), _shift(floor, 2, lag)
    before, after = floor - behind, ahead - floor
    least = np.minimum(np.abs(before), np.abs(after))
    # All comparisons with NaN are False.
    same = before * after > 0
    before2, after2 = behind - far_behind, far_ahead - ahead
    bent = (before * after < 0) & (before * before2 > 0) & (after * after2 > 0)
    least = np.where(same, least, np.minimum(least, np.minimum(np.abs(before2), np.abs(after2))))
    return np.where(same | bent, np.copysign(least, before), 0.0) / max(map(abs, lag))


def _shift(floor: FloatArray, times: int, lag: tuple[int, int]) -> FloatArray:
    """Return the floors `times` the lag away, NaN beyond the patch, shape (nx, ny, m)."""
    (nx, ny), (di, dj) = floor.shape[:2], (times * lag[0], times * lag[1])
    shifted = np.full_like(floor, np.nan)
    if abs(di) < nx and abs(dj) < ny:
        shifted[max(-di, 0) : nx - max(di, 0), max(-dj, 0) : ny - max(dj, 0)] = floor[
            max(di, 0) : nx - max(-di, 0), max(dj, 0) : ny - max(-dj, 0)
        ]
    return shifted


def step(
    rise: FloatArray, slope: NDArray[np.floating], other: NDArray[np.floating]
) -> NDArray[np.float64]:
    """Return the part of a height difference that no slope explains [m].

    Args:
        rise: Height difference from one node to the next [m].
        slope: Slope at the first node in this direction [m per column].
        other: Slope at the second node.
    """
    explained = np.maximum(
        np.where(slope * rise > 0, np.abs(slope), 0.0),
        np.where(other * rise > 0, np.abs(other), 0.0),
    )
    return np.asarray(np.copysign(np.maximum(np.abs(rise) - explained, 0.0), rise))

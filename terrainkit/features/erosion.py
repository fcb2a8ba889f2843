"""Erosion of heights by gravity and by water."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

RAIN = 0.01
"""Water that falls on each sample in an iteration [m]."""

CAPACITY = 0.5
"""Sediment that a unit of moving water carries on a slope of 1."""

RATE = 0.3
"""Fraction of the free capacity that is eroded, or of the excess that is deposited."""

EVAPORATION = 0.3
"""Fraction of the water that evaporates in an iteration."""

TALUS = 0.6
"""Steepest slope on which loose material rests, rise over run."""


def erode(heights: NDArray[np.float64], cell: float, iterations: int) -> NDArray[np.float64]:
    """Return `heights` after erosion; no material enters or leaves.

    Each iteration moves loose material down slopes steeper than `TALUS` (thermal erosion), and lets
    rain flow to the lower neighbors, pick up sediment where it is fast and drop it where it is slow
    (hydraulic erosion). Both follow Musgrave, Kolb and Mace, "The synthesis and rendering of eroded
    fractal terrains", 1989.

    Args:
        heights: Heights [m], shape (nx, ny).
        cell: Distance between two samples [m].
        iterations: Number of iterations.
    """
    ground = heights.copy()
    water, sediment = np.zeros_like(ground), np.zeros_like(ground)
    for _ in range(iterations):
        drops = [np.maximum(drop - TALUS * cell, 0.0) for drop in _drops(ground)]
        # Four neighbors exchange at once. A share of 1/4 could overshoot; half of it does not.
        ground += _exchange(0.125 * drop for drop in drops)
        water += RAIN
        drops = [np.maximum(drop, 0.0) for drop in _drops(ground + water)]
        total = drops[0] + drops[1] + drops[2] + drops[3]
        # Moving half of a difference would level two samples. Since all samples exchange water at
        # once, half of that keeps the surface from oscillating.
        moving = np.minimum(water, 0.25 * total)
        capacity = CAPACITY * moving * np.minimum(total / cell, 1.0)
        change = RATE * (sediment - capacity)
        ground += change
        sediment -= change
        share = moving / np.maximum(water * np.maximum(total, 1e-12), 1e-12)
        sediment += _exchange(share * sediment * drop for drop in drops)
        share = moving / np.maximum(total, 1e-12)
        water += _exchange(share * drop for drop in drops)
        water *= 1 - EVAPORATION
    return ground + sediment


def _drops(surface: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return the height of each sample above its four neighbors; 0 beyond the edges."""
    along_x = np.pad(surface[:-1] - surface[1:], ((0, 1), (0, 0)))
    along_y = np.pad(surface[:, :-1] - surface[:, 1:], ((0, 0), (0, 1)))
    return [along_x, -np.roll(along_x, 1, axis=0), along_y, -np.roll(along_y, 1, axis=1)]


def _exchange(outflow: Iterable[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return the change of each sample for flows to its four neighbors, in the order of `_drops`.

    Nothing flows beyond the edges, where the drops are 0.
    """
    change: NDArray[np.float64] = np.zeros(())
    for flow, (shift, axis) in zip(outflow, ((1, 0), (-1, 0), (1, 1), (-1, 1)), strict=True):
        change = change - flow + np.roll(flow, shift, axis=axis)
    return change

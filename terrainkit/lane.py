"""Positions along a lane: a patch that a robot crosses along x from a flat start."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrainkit.grid import Grid


def lane_spawn(grid: Grid, start: float) -> tuple[float, float]:
    """Return the center of a flat start of length `start` [m] at low x, x and y [m]."""
    return grid.lower[0] + grid.length(grid.cells(start)) / 2, grid.center[1]


def lane_positions(grid: Grid, start: float, length: float, gap: float) -> NDArray[np.float64]:
    """Return the x of the first edge of as many elements as fit behind the start [m], shape (n,).

    Args:
        grid: Grid of the patch.
        start: Length of the flat start [m].
        length: Length of an element along x [m].
        gap: Distance between two elements, and at least behind the last one [m].
    """
    first = grid.length(grid.cells(start))
    number = max(0, int((grid.size[0] - first + 1e-9) // (length + gap)))
    return np.float64(grid.lower[0] + first) + np.arange(number) * (length + gap)


def lane_goals(grid: Grid, x: ArrayLike) -> NDArray[np.float64]:
    """Return goals on the ground at `x` [m], in the middle of the lane and along x, (k, 4)."""
    x = np.atleast_1d(np.asarray(x, dtype=float))
    return np.column_stack([x, np.full(len(x), grid.center[1]), np.full(len(x), np.nan), 0 * x])

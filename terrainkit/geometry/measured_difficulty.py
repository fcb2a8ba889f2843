"""Measure the difficulty of the ground of a patch from its heights."""

import numpy as np
from numpy.typing import NDArray

STEP_LENGTH = 0.3
"""Longest step of a robot [m]."""

MAX_STEP_HEIGHT = 0.5
"""Height difference at which the measure saturates, since no leg bridges it [m]."""


def measured_difficulty(heights: NDArray[np.float32], cell: float, start: float) -> float:
    """Return the difficulty of the ground of a patch [m]: 0 for flat ground.

    It is the mean of `min(|h(p + d) - h(p)|, L)` over all samples p and steps d along x and y of up
    to `STEP_LENGTH`, plus the mean of `min(|h(p) - start|, L)` over all samples, with
    L = `MAX_STEP_HEIGHT`. The first term measures slopes, risers and edges within one step. The
    second measures the height to climb and the depth of holes. The measure is our own.

    Solids do not count. Heights alone do not tell whether a robot goes over or under a solid: a
    lower bar is harder to pass, but a lower tread is easier to climb.

    Args:
        heights: Heights of a patch [m], shape (nx, ny).
        cell: Distance between two samples [m].
        start: Height of the spawn origin [m].
    """
    total, count = 0.0, 0
    for n in range(1, max(1, round(STEP_LENGTH / cell)) + 1):
        for step in (heights[n:] - heights[:-n], heights[:, n:] - heights[:, :-n]):
            total, count = total + _clipped_sum(step), count + step.size
    away = _clipped_sum(heights - np.float32(start)) / heights.size
    return (total / count if count else 0.0) + away


def _clipped_sum(change: NDArray[np.float32]) -> float:
    # Summed in double precision, since a map has millions of differences.
    return float(np.minimum(np.abs(change), MAX_STEP_HEIGHT).sum(dtype=np.float64))

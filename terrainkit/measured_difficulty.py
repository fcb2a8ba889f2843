"""Measures: how hard the ground is, from its heights alone."""

import numpy as np
from numpy.typing import NDArray

STRIDE = 0.3
"""Length of a step that a robot takes [m]."""

LEG = 0.5
"""Change of height beyond which more makes no difference: no leg bridges it [m]."""


def measured_difficulty(heights: NDArray[np.float32], cell: float, start: float) -> float:
    r"""Return how hard a patch is to walk [m]: 0 for level ground, growing with everything else.

    .. math:: H = \operatorname{mean}_{p, \delta} \min(|h(p + \delta) - h(p)|, L)
                + \operatorname{mean}_p \min(|h(p) - h_0|, L)

    over all samples p and steps :math:`\delta` along x and y of up to `STRIDE`, with L = `LEG`. The
    first term is what a single step meets: grades, risers, edges. The second is what lies beyond
    many of them: the height to climb, and the holes with no ground to step on. Our own measure.

    Args:
        heights: Heights of a patch [m], shape (nx, ny).
        cell: Distance between two samples [m].
        start: Height that the robot starts from [m].
    """
    total, count = 0.0, 0
    for n in range(1, max(1, round(STRIDE / cell)) + 1):
        for step in (heights[n:] - heights[:-n], heights[:, n:] - heights[:, :-n]):
            total, count = total + _clipped_sum(step), count + step.size
    away = _clipped_sum(heights - np.float32(start)) / heights.size
    return (total / count if count else 0.0) + away


def _clipped_sum(change: NDArray[np.float32]) -> float:
    return float(np.minimum(np.abs(change), LEG).sum(dtype=np.float64))

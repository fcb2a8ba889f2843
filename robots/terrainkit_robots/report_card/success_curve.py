"""Fit a curve to the successes of a policy over the hardness of a test."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from terrainkit_robots.transforms import FloatArray

SHARES = (0.9, 0.5)
"""Success at which the curve is read."""


def fit_success(
    hardness: Sequence[float] | FloatArray, crossed: Sequence[int] | FloatArray, starts: int
) -> dict[float, NDArray[np.float64]]:
    """Fit a logistic curve to the success over the hardness.

    The curve falls from 1 - lapse to 0; the lapse is the share of failures that do not depend on
    the hardness. Its middle, width and lapse have a posterior distribution on a grid. Due to the
    prior, counts without overlap have a finite width, and if all or none cross, the middle is
    beyond the hardest or the easiest value.

    Args:
        hardness: Hardness of each value, 0 to 1.
        crossed: Number of robots that crossed it.
        starts: Number of robots that started on each.

    Returns:
        For each of `SHARES`, the hardness with this success: its median and the ends of its 95 %
        interval, shape (3,), limited to 0 and 1.
    """
    middle, width, lapse = np.meshgrid(
        np.linspace(-0.2, 1.2, 113), np.geomspace(0.005, 0.2, 20), np.arange(0, 0.5, 0.02)
    )
    log_weight = 15 * np.log(1 - lapse)  # the prior: few failures on easy values
    for value, number in zip(hardness, crossed, strict=True):
        success = np.clip((1 - lapse) * expit((middle - value) / width), 1e-9, 1 - 1e-9)
        log_weight += number * np.log(success) + (starts - number) * np.log(1 - success)
    weight = np.exp(log_weight - log_weight.max())
    quantiles = {}
    for share in SHARES:
        # A curve that begins below the share has it before any value.
        ratio = np.maximum((1 - lapse) / share - 1, 1e-300)
        place = (middle + width * np.log(ratio)).ravel()
        order = np.argsort(place)
        total = np.cumsum(weight.ravel()[order])
        index = np.searchsorted(total, np.array([0.5, 0.025, 0.975]) * total[-1])
        quantiles[share] = np.clip(place[order][index], 0.0, 1.0)
    return quantiles

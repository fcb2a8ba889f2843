"""Queries of the space above the ground: scans, clearance and free intervals."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

Direction = Literal["down", "up"]

CONTACT = 1e-4
"""Gap below which a solid touches the ground or another solid [m]."""


def first_surface(
    heights: NDArray[np.float64],
    bounds: NDArray[np.float64],
    z: NDArray[np.float64],
    direction: Direction,
) -> NDArray[np.float64]:
    """Return the z of the first surface that a vertical ray meets [m], NaN where there is none.

    A ray that starts inside a solid meets the solid's far side, as MuJoCo's `mj_ray` does.

    Args:
        heights: Height of the ground under each start [m], shape (n,).
        bounds: Bottom and top of the solids on each line [m], shape (n, k, 2), padded with NaN.
        z: Height of each start [m], shape (n,).
        direction: Direction of the rays.
    """
    surfaces = np.concatenate([heights[:, None], bounds[..., 0], bounds[..., 1]], axis=1)
    if direction == "down":
        found = np.max(surfaces, axis=1, where=surfaces <= z[:, None], initial=-np.inf)
    else:
        found = np.min(surfaces, axis=1, where=surfaces >= z[:, None], initial=np.inf)
    return np.where(np.isfinite(found), found, np.nan)


def free_intervals(
    heights: NDArray[np.float64], bounds: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the free intervals above the ground on each vertical line.

    Args:
        heights: Height of the ground on each line [m], shape (n,).
        bounds: Bottom and top of the solids on each line [m], shape (n, k, 2), in the order of the
            bottoms, padded with NaN.

    Returns:
        Floor and ceiling of each interval [m], shape (n, m, 2), upward, padded with NaN. The
        ceiling of the last one is inf. Gaps of less than `CONTACT` are closed.
    """
    bottom, top = bounds[..., 0], bounds[..., 1]
    tops = np.column_stack([heights, np.where(np.isnan(top), -np.inf, top)])
    floor = np.maximum.accumulate(tops, axis=1)
    bottoms = np.where(np.isnan(bottom), np.inf, bottom)
    ceiling = np.column_stack([bottoms, np.full(len(heights), np.inf)])
    intervals = np.dstack([floor, ceiling])
    # The padding repeats the last interval.
    is_last = np.isinf(ceiling)
    free = (ceiling > floor + CONTACT) & (np.cumsum(is_last, axis=1) <= 1)
    most = int(free.sum(axis=1).max(initial=1))
    order = np.argsort(~free, axis=1, kind="stable")[:, :most]
    chosen = np.take_along_axis(intervals, order[..., None], axis=1)
    return np.where(np.take_along_axis(free, order, axis=1)[..., None], chosen, np.nan)


def clearance(
    heights: NDArray[np.float64], bounds: NDArray[np.float64], step_height: float
) -> NDArray[np.float64]:
    """Return the free height above the ground on vertical lines.

    Args:
        heights: Height of the ground on each line [m], shape (n,).
        bounds: Bottom and top of the solids on each line [m], shape (n, k, 2), padded with NaN.
        step_height: Height above the ground up to which the top of a solid is a floor, too [m].

    Returns:
        Free height above the highest of these floors [m], shape (n,): inf under the open sky, 0
        where a higher solid covers the ground.
    """
    intervals = free_intervals(heights, bounds)
    is_low = intervals[..., 0] <= heights[:, None] + (step_height + CONTACT)  # NaN is False
    highest = np.maximum(is_low.sum(axis=1) - 1, 0)
    floor, ceiling = np.take_along_axis(intervals, highest[:, None, None], axis=1)[:, 0].T
    return np.where(is_low.any(axis=1), ceiling - floor, 0.0)

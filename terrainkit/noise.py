"""Noise on a coarse lattice, interpolated to the cells of a patch."""

import math

import numpy as np
from numpy.typing import NDArray

from terrainkit.grid import Grid


def lattice_noise(
    plot: Grid, spacing: float, amplitude: float, step: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Return uniform noise between `-amplitude` and `amplitude` [m], shape `plot.shape`.

    A height is drawn at each node of a lattice that spans the patch, and interpolated bilinearly
    in between, as Isaac Gym's `random_uniform_terrain` does. The pattern of draws depends on
    neither `amplitude` nor `step`.

    Args:
        plot: Cells to fill.
        spacing: Distance between two nodes [m], adjusted so that a whole number spans the patch.
        amplitude: Largest height [m].
        step: Heights drawn are multiples of this [m]; with 0 they are any number.
        rng: Where the draws come from.
    """
    intervals = [max(1, round(extent / spacing)) for extent in plot.size]
    nodes = rng.random((intervals[0] + 1, intervals[1] + 1))
    if step > 0:
        levels = math.floor(amplitude / step + 1e-9)  # the margin is for 0.05 / 0.005
        nodes = (np.floor(nodes * (2 * levels + 1)) - levels) * step
    else:
        nodes = (2 * nodes - 1) * amplitude
    for k in (0, 1):
        nodes = _interpolate(nodes, plot.shape[k], axis=k)
    return nodes


def _interpolate(nodes: NDArray[np.float64], n: int, axis: int) -> NDArray[np.float64]:
    # Elementwise sums, not a matrix product: BLAS may round differently on another machine.
    position = (np.arange(n) + 0.5) * ((nodes.shape[axis] - 1) / n)
    below = position.astype(np.int64)
    weight = position - below
    weight = weight[:, None] if axis == 0 else weight
    low, high = np.take(nodes, below, axis), np.take(nodes, below + 1, axis)
    between: NDArray[np.float64] = low + weight * (high - low)
    return between

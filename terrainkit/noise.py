"""Noise on a coarse node_grid, interpolated to the cells of a patch."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.grid import Grid
from terrainkit.parameter import Realized

STEP = 0.005
"""Heights are multiples of it unless told: Isaac Gym's own vertical scale [m]."""


@dataclass(frozen=True, kw_only=True)
class ValueNoise:
    """Uniform noise drawn at the nodes of a node_grid, like Isaac Gym's `random_uniform_terrain`.

    A whole number of intervals spans the patch, and a whole number of steps the amplitude.
    """

    amplitude: float
    """Largest height above or below 0 [m]."""

    step: float
    """Heights drawn are multiples of this [m]; below a micrometre they are any number."""

    spacing: float
    """Distance between two nodes [m]."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return the noise [m], shape `grid.shape`; interpolated bilinearly between nodes.

        How many draws it takes, and their pattern, depend on the spacing alone.
        """
        x, y = self._intervals(grid)
        nodes = rng.random((x + 1, y + 1))
        if self._levels is None:
            nodes = (2 * nodes - 1) * self.amplitude
        else:
            nodes = (np.floor(nodes * (2 * self._levels + 1)) - self._levels) * self.step
        for k in (0, 1):
            nodes = _interpolate(nodes, grid.shape[k], axis=k)
        return nodes

    def realized(self, grid: Grid) -> dict[str, Realized]:
        """Return amplitude and spacing as they are on `grid`."""
        counts = zip(grid.size, self._intervals(grid), strict=True)
        x, y = (round(extent / count, 9) for extent, count in counts)
        largest = self.amplitude if self._levels is None else round(self._levels * self.step, 9)
        return {"amplitude": largest, "spacing": x if x == y else (x, y)}

    @property
    def _levels(self) -> int | None:
        if self.step < 1e-6:
            return None
        return math.floor(self.amplitude / self.step + 1e-9)  # the margin is for 0.05 / 0.005

    def _intervals(self, grid: Grid) -> tuple[int, int]:
        # Nodes closer than the cells would be drawn and never seen.
        spacing = max(self.spacing, grid.cell)
        x, y = (max(1, math.floor(extent / spacing + 0.5 + 1e-9)) for extent in grid.size)
        return x, y


def _interpolate(nodes: NDArray[np.float64], n: int, axis: int) -> NDArray[np.float64]:
    # Elementwise sums, not a matrix product: BLAS may round differently on another machine.
    position = (np.arange(n) + 0.5) * ((nodes.shape[axis] - 1) / n)
    below = position.astype(np.int64)
    weight = position - below
    weight = weight[:, None] if axis == 0 else weight
    low, high = np.take(nodes, below, axis), np.take(nodes, below + 1, axis)
    between: NDArray[np.float64] = low + weight * (high - low)
    return between

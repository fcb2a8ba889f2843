"""Value noise: random heights on coarse nodes, interpolated to the cells of a patch."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.geometry.grid import Grid
from terrainkit.terrain import Terrain
from terrainkit.terrain.parameter import Value

STEP = 0.005
"""Default step of the heights [m], the vertical scale of Isaac Gym."""


@dataclass(frozen=True, kw_only=True)
class ValueNoise:
    """Uniform noise at equidistant nodes, like `random_uniform_terrain` of Isaac Gym.

    The patch is a whole number of intervals, and the amplitude a whole number of steps.
    """

    amplitude: float
    """Largest height above or below 0 [m]."""

    step: float
    """Step of the sampled heights [m]; below a micrometer, heights are continuous."""

    spacing: float
    """Distance between two nodes [m]."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return the noise [m], shape `grid.shape`, interpolated bilinearly between nodes.

        The number of random numbers depends only on the spacing.
        """
        x, y = self._intervals(grid)
        nodes = rng.random((x + 1, y + 1))
        if self._levels is None:
            nodes = (2 * nodes - 1) * self.amplitude
        else:
            nodes = (np.floor(nodes * (2 * self._levels + 1)) - self._levels) * self.step
        along_x = _interpolate(nodes, grid.shape[0])
        along_y = _interpolate(np.ascontiguousarray(along_x.T), grid.shape[1])
        return np.ascontiguousarray(along_y.T)

    def realized(self, grid: Grid) -> dict[str, Value]:
        """Return amplitude and spacing as realized on `grid`."""
        counts = zip(grid.size, self._intervals(grid), strict=True)
        x, y = (round(extent / count, 9) for extent, count in counts)
        largest = self.amplitude if self._levels is None else round(self._levels * self.step, 9)
        return {"amplitude": largest, "spacing": x if x == y else (x, y)}

    @property
    def _levels(self) -> int | None:
        if self.step < 1e-6:
            return None
        return math.floor(self.amplitude / self.step + 1e-9)  # rounding of 0.05 / 0.005

    def _intervals(self, grid: Grid) -> tuple[int, int]:
        # Nodes closer than the cells would have no effect.
        spacing = max(self.spacing, grid.cell)
        x, y = (max(1, math.floor(extent / spacing + 0.5 + 1e-9)) for extent in grid.size)
        return x, y


class RoughGround(Terrain):
    """The parent class of terrains with value noise around a flat platform.

    It is no dataclass: a subclass declares the fields among its own, which keeps their order.
    """

    amplitude: float
    """Largest height above or below the ground without noise [m]."""

    step: float
    """Step of the random heights [m]."""

    spacing: float
    """Distance between two random heights [m]."""

    platform: float
    """Side of the flat square at the center [m]."""

    def realized(self, grid: Grid) -> dict[str, Value]:
        """Return the realized parameters: whole steps, and whole intervals across the patch."""
        return super().realized(grid) | self._noise().realized(grid)

    def noise(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return the noise [m], which fades to 0 at the platform over one spacing."""
        fade = grid.fade(grid.centered(self.platform), self.spacing)
        return self._noise().heights(grid, rng) * fade

    def _noise(self) -> ValueNoise:
        return ValueNoise(amplitude=self.amplitude, step=self.step, spacing=self.spacing)


def _interpolate(nodes: NDArray[np.float64], n: int) -> NDArray[np.float64]:
    """Return the values at n cells along the first axis, between equidistant nodes."""
    # Elementwise sums, not a matrix product: BLAS may round differently on another machine.
    position = (np.arange(n) + 0.5) * ((len(nodes) - 1) / n)
    below = position.astype(np.int64)
    between = np.diff(nodes, axis=0)[below]
    between *= (position - below)[:, None]
    between += nodes[below]
    return between

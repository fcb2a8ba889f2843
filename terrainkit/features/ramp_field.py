"""Fields of equal rectangles along a lane."""

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import make_ramps, max_number
from terrainkit.features.lane import Lane, lane_goals
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids
from terrainkit.terrain import FlatTerrain, Goals, parameter


@dataclass(frozen=True, kw_only=True)
class RampField(FlatTerrain, Lane):
    """The parent class of lanes with equal ramps as solids on flat ground, and a goal behind."""

    grade: float = parameter.scalar(0.09, 0.268)
    """Rise over run of a ramp; 0.268 is 15 degrees."""

    end: float = parameter.length(1.0)
    """Minimum length of the flat strip behind the ramps along x [m]."""

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return the ramps, in as many whole rows as fit."""
        lower, i, j = self._ramp_grid(grid)
        rise = self.grade * self.ramp_size()[0] * self.high_corners(i, j)
        return make_ramps(lower, lower + np.array(self.ramp_size()), rise)

    def goals(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Goals:
        """Return a goal in the middle of the flat strip behind the ramps."""
        lower, _, _ = self._ramp_grid(grid)
        return lane_goals(grid, (lower[:, 0].max() + self.ramp_size()[0] + grid.upper[0]) / 2)

    @abstractmethod
    def ramp_size(self) -> tuple[float, float]:
        """Return the sides of a ramp along x and y [m]."""

    @abstractmethod
    def high_corners(self, i: NDArray[np.int64], j: NDArray[np.int64]) -> NDArray[np.integer]:
        """Return whether each corner of each ramp is high, counterclockwise, 0 or 1.

        Args:
            i: Number of each ramp along x, shape (n,).
            j: Number of each ramp along y, shape (n,).
        """

    def _ramp_grid(
        self, grid: Grid
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
        """Return as many ramps as fit along x between two strips, and along y.

        Returns:
            Corners with the smallest x and y [m], shape (n, 2), and the numbers of the ramps along
            x and y, shapes (n,). The field is centered along y.

        Raises:
            ConfigError: if no ramp fits.
        """
        name, size = self.kind(), self.ramp_size()
        first = grid.length(grid.cells(self.start))
        extent = grid.size[0] - first - grid.length(grid.cells(self.end)), grid.size[1]
        nx, ny = (max_number(name, side, n) for side, n in zip(size, extent, strict=True))
        if min(nx, ny) < 1:
            raise ConfigError(
                f"{name}: got elements of {size[0]:g} m x {size[1]:g} m between strips of "
                f"{self.start:g} m and {self.end:g} m; expected elements that fit in a patch of "
                f"{grid.extent}"
            )
        i, j = (index.ravel() for index in np.indices((nx, ny)))
        x = grid.lower[0] + first + i * size[0]
        return np.column_stack([x, grid.center[1] + (j - ny / 2) * size[1]]), i, j

"""Ramps whose edges meet."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit import parameter
from terrainkit.features.blocks import make_ramps
from terrainkit.features.lane import lane_goals, lane_spawn
from terrainkit.features.ramp_field import ramp_cells
from terrainkit.grid import Grid
from terrainkit.solids import Solids
from terrainkit.terrain import Terrain


@dataclass(frozen=True, kw_only=True)
class ContinuousRamps(Terrain):
    """Ramps up and down along a lane, whose edges meet; neighboring rows alternate.

    They pitch a robot, and roll it where two rows meet, as the continuous ramps of response-robot
    tests do. The robot is spawned at low x, and the goal is behind the ramps. The ramps are solids;
    the ground is flat.
    """

    grade: float = parameter.scalar(0.09, 0.268)
    """Rise over run of a ramp; 0.268 is 15 degrees."""

    length: float = parameter.size(0.6)
    """Length of a ramp along x [m]."""

    width: float = parameter.size(1.2)
    """Width of a row of ramps [m]."""

    start: float = parameter.length(2.0)
    """Length of the flat start along x [m]."""

    end: float = parameter.length(1.0)
    """Minimum length of the flat strip behind the ramps along x [m]."""

    def spawn(self, grid: Grid) -> tuple[float, float]:
        """Return the center of the flat start."""
        return lane_spawn(grid, self.start)

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return flat ground."""
        return np.zeros(grid.shape)

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return the ramps, in as many whole rows as fit."""
        lower, i, j = self._layout(grid)
        rise = self.grade * self.length * ((i + j)[:, None] % 2 == [[1, 0, 0, 1]])
        return make_ramps(lower, lower + np.array([self.length, self.width]), rise)

    def goals(
        self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator
    ) -> NDArray[np.floating]:
        """Return a goal in the middle of the flat strip behind the ramps."""
        lower, _, _ = self._layout(grid)
        return lane_goals(grid, (lower[:, 0].max() + self.length + grid.upper[0]) / 2)

    def _layout(
        self, grid: Grid
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
        size = self.length, self.width
        return ramp_cells("continuous_ramps", grid, self.start, self.end, size)

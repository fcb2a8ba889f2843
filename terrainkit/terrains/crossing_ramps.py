"""Ramps along and across a lane."""

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

_RAISED = np.array([[0, 1, 1, 0], [0, 0, 1, 1], [1, 0, 0, 1], [1, 1, 0, 0]])
"""Corners that are raised, counterclockwise, for ramps that rise toward +x, +y, -x and -y."""


@dataclass(frozen=True, kw_only=True)
class CrossingRamps(Terrain):
    """Square ramps along and across a lane in a checkerboard; their edges do not meet.

    They are the crossing ramps of response-robot tests. The robot is spawned at low x, and the goal
    is behind the ramps. The ramps are solids; the ground is flat.
    """

    grade: float = parameter.scalar(0.09, 0.268)
    """Rise over run of a ramp; 0.268 is 15 degrees."""

    side: float = parameter.size(0.6)
    """Side of a ramp [m]."""

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
        """Return the ramps; the direction of each is a quarter turn from that of its neighbors."""
        lower, i, j = self._layout(grid)
        direction = (i + j) % 2 + 2 * ((i // 2 + j // 2) % 2)
        return make_ramps(lower, lower + self.side, self.grade * self.side * _RAISED[direction])

    def goals(
        self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator
    ) -> NDArray[np.floating]:
        """Return a goal in the middle of the flat strip behind the ramps."""
        lower, _, _ = self._layout(grid)
        return lane_goals(grid, (lower[:, 0].max() + self.side + grid.upper[0]) / 2)

    def _layout(
        self, grid: Grid
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
        return ramp_cells("crossing_ramps", grid, self.start, self.end, (self.side, self.side))

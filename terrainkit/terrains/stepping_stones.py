"""Stepping stones over deep holes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit import parameter
from terrainkit.grid import Grid
from terrainkit.terrain import Terrain


@dataclass(frozen=True, kw_only=True)
class SteppingStones(Terrain):
    """Square stones in rows along y with random offsets, around a flat platform.

    Stones are truncated at the edge of the patch.
    """

    stone: float = parameter.length(1.575, 0.075)
    """Side of a stone [m]."""

    distance: float = parameter.length(0.1)
    """Gap between neighboring stones [m]."""

    variation: float = parameter.height(0.0)
    """Maximum height of a stone above or below 0 [m]."""

    depth: float = parameter.height(10.0)
    """Depth of the holes [m]."""

    platform: float = parameter.platform(4.0)
    """Side of the flat square at the center [m]."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the stones; rows are `stone` wide along x, with gaps of `distance`."""
        stone, distance = grid.cells(self.stone), grid.cells(self.distance)
        pitch = stone + distance
        shifts = (rng.random(grid.shape[0]) * pitch).astype(np.int64)
        tops = (2 * rng.random(grid.shape) - 1) * self.variation
        row, x = np.divmod(np.arange(grid.shape[0])[:, None], pitch)
        column, y = np.divmod(np.arange(grid.shape[1])[None, :] + shifts[row], pitch)
        ground = np.where((x < stone) & (y < stone), tops[row, column % grid.shape[1]], -self.depth)
        ground[grid.centered_slices(grid.centered(self.platform))] = 0.0
        return ground

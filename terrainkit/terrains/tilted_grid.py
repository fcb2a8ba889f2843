"""A grid of square tiles that are tilted."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.geometry.grid import Grid
from terrainkit.terrain import parameter
from terrainkit.terrains.random_grid import RandomGrid


@dataclass(frozen=True, kw_only=True)
class TiltedGrid(RandomGrid):
    """Square tiles at random heights and with random tilts around a flat platform.

    The tiles are centered. The remaining cells at the edges, at least one, are at height 0. In mode
    curriculum, the rows of a column differ only in the scale of the heights and tilts.
    """

    has_column_seed: ClassVar[bool] = True

    # mjlab: tiles of 1 m, up to 0.15 m above or below and 20 degrees about x and y.
    height: float = parameter.height(0.02, 0.15)
    """Largest height of the middle of a tile above or below 0 [m]."""

    grade: float = parameter.grade(0.05, 0.36)
    """Largest rise over run of a tile along x and along y."""

    block: float = parameter.length(1.0)
    """Side of a tile [m]."""

    def blocks(
        self, grid: Grid, number: tuple[int, int], rng: np.random.Generator
    ) -> NDArray[np.floating]:
        """Return the heights of the cells of `number` tiles along x and y [m]."""
        side = grid.cells(self.block)
        level = super().blocks(grid, number, rng)
        grades = self.grade * (2 * rng.random((2, *number)) - 1)
        along_x = np.broadcast_to(grid.cell * (np.arange(side) - (side - 1) / 2), (side, side)).T
        return level + np.kron(grades[0], along_x) + np.kron(grades[1], along_x.T)

"""A grid of square blocks at random heights."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrain import Terrain, parameter


@dataclass(frozen=True, kw_only=True)
class RandomGrid(Terrain):
    """Square blocks at random heights around a flat platform.

    The blocks are centered. The remaining cells at the edges, at least one, are at height 0. In
    mode curriculum, the rows of a column differ only in `height`.
    """

    has_column_seed: ClassVar[bool] = True

    # mjlab's heights and cells; Isaac Lab has 0.05 m to 0.2 m on cells of 0.45 m.
    height: float = parameter.height(0.0, 0.3)
    """Largest height of a block above or below 0 [m]."""

    block: float = parameter.length(0.4)
    """Side of a block [m]."""

    platform: float = parameter.platform(2.0, sloped_edge=True)
    """Side of the flat square at the center [m]."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the blocks, with the platform cleared."""
        side = grid.cells(self.block)
        number = (grid.shape[0] - 2) // side, (grid.shape[1] - 2) // side
        if min(number) < 1:
            raise ConfigError(
                f"{self.kind()}: no block of {self.block:g} m fits in a rim of {grid.cell:g} m in "
                f"a patch of {grid.extent}"
            )
        ground = np.zeros(grid.shape)
        extent = (number[0] * side, number[1] * side)
        ground[grid.centered_slices(extent)] = self.blocks(grid, number, rng)
        ground[grid.centered_slices(grid.centered(self.platform))] = 0.0
        return ground

    def blocks(
        self, grid: Grid, number: tuple[int, int], rng: np.random.Generator
    ) -> NDArray[np.floating]:
        """Return the heights of the cells of `number` blocks along x and y [m]."""
        side = grid.cells(self.block)
        return np.kron(self.height * (2 * rng.random(number) - 1), np.ones((side, side)))

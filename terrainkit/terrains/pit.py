"""A square pit."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.geometry.grid import Grid
from terrainkit.terrain import Terrain, parameter
from terrainkit.terrain.parameter import Value


@dataclass(frozen=True, kw_only=True)
class Pit(Terrain):
    """A square pit with vertical walls.

    The robot is spawned at the bottom and climbs out. The outermost cells of the patch are at
    height 0: where it is not wider than the pit, the pit is narrower.
    """

    has_random_heights: ClassVar[bool] = False

    # legged_gym: a square of 4 m that is 1 m deep at difficulty 1.
    depth: float = parameter.height(0.0, 1.0)
    """Depth of the pit [m]."""

    side: float = parameter.platform(4.0)
    """Side of the pit [m]."""

    def realized(self, grid: Grid) -> dict[str, Value]:
        """Return the realized parameters: the pit ends before the edge of the patch."""
        x, y = (grid.length(n) for n in self._cells(grid))
        return super().realized(grid) | {"side": x if x == y else (x, y)}

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return 0, and `-depth` inside the pit."""
        ground = np.zeros(grid.shape)
        ground[grid.centered_slices(self._cells(grid))] = -self.depth
        return ground

    def _cells(self, grid: Grid) -> tuple[int, int]:
        """Return the cells of the pit along x and y."""
        return grid.centered(self.side, margin=1)

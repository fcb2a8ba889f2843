"""A gap around a platform."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrain import Terrain, parameter
from terrainkit.terrain.parameter import Value


@dataclass(frozen=True, kw_only=True)
class Gap(Terrain):
    """A gap of constant width around a central platform, with flat ground beyond it.

    Where a side of the patch is too short for both, the platform is shorter along it.
    """

    has_random_heights: ClassVar[bool] = False

    # legged_gym: a gap of 1 m at difficulty 1, around a platform of 3 m.
    width: float = parameter.length(0.0, 1.0, allow_zero=True)
    """Width of the gap [m]."""

    depth: float = parameter.height(5.0)
    """Depth of the floor of the gap [m]."""

    platform: float = parameter.platform(3.0)
    """Side of the flat square at the center [m]."""

    def realized(self, grid: Grid) -> dict[str, Value]:
        """Return the realized parameters: the platform leaves space for the gap."""
        x, y = (grid.length(n) for n in self._cells(grid))
        return super().realized(grid) | {"platform": x if x == y else (x, y)}

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return 0, and `-depth` in the rings of the gap."""
        width = grid.cells(self.width, minimum=0)
        if min(platform := self._cells(grid)) == 0:
            raise ConfigError(
                f"{self._got('width')}; expected at most "
                f"{grid.length(max(0, (min(grid.shape) - 3) // 2)):g} m, with ground on both sides "
                f"in a patch of {grid.extent}"
            )
        return grid.by_ring(platform, lambda k: np.where((k > 0) & (k <= width), -self.depth, 0.0))

    def _cells(self, grid: Grid) -> tuple[int, int]:
        """Return the cells of the platform along x and y."""
        return grid.centered(self.platform, margin=grid.cells(self.width, minimum=0) + 1)

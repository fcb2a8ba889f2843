"""A gap around a platform."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.geometry.grid import Grid
from terrainkit.terrain import Terrain, parameter
from terrainkit.terrain.parameter import Value


@dataclass(frozen=True, kw_only=True)
class Gap(Terrain):
    """A gap of constant width around a central platform, with flat ground beyond it."""

    has_random_heights: ClassVar[bool] = False

    # legged_gym: a gap of 1 m at difficulty 1, around a platform of 3 m.
    width: float = parameter.length(0.0, 1.0, allow_zero=True)
    """Width of the gap [m]; it ends at the edge of the patch."""

    depth: float = parameter.height(5.0)
    """Depth of the floor of the gap [m]."""

    platform: float = parameter.platform(3.0)
    """Side of the flat square at the center [m]."""

    def realized(self, grid: Grid) -> dict[str, Value]:
        """Return the realized parameters: the gap ends at the edge of the patch."""
        width, block = grid.cells(self.width, minimum=0), grid.centered(self.platform)
        x, y = (grid.length(min(width, margin)) for margin in grid.margin(block))
        return super().realized(grid) | {"width": x if x == y else (x, y)}

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return 0, and `-depth` in the rings of the gap."""
        width = grid.cells(self.width, minimum=0)
        return grid.by_ring(
            grid.centered(self.platform),
            lambda k: np.where((k > 0) & (k <= width), -self.depth, 0.0),
        )

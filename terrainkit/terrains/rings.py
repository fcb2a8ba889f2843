"""Nested rings."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.features.pit_ground import PitTerrain
from terrainkit.geometry.grid import Grid
from terrainkit.terrain import parameter


@dataclass(frozen=True, kw_only=True)
class Rings(PitTerrain):
    """Nested square rings at random heights in a pit around a platform.

    The robot crosses the gaps between them on its way outward. The outermost cells of the patch are
    at height 0.
    """

    has_random_heights: ClassVar[bool] = True

    gap: float = parameter.length(0.1, 0.4)
    """Width of the gaps [m]."""

    width: float = parameter.length(0.8, 0.4)
    """Width of the rings [m]."""

    variation: float = parameter.height(0.0, 0.1)
    """Largest height of a ring above or below 0 [m]."""

    depth: float = parameter.height(1.0)
    """Depth of the pit [m]."""

    platform: float = parameter.platform(2.0)
    """Side of the flat square at the center [m]."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the rings; a ring at the edge is truncated."""
        gap, width = grid.cells(self.gap), grid.cells(self.width)
        number, place = np.divmod(grid.rings(grid.centered(self.platform)) - 1, gap + width)
        tops = self.variation * (2 * rng.random(max(grid.shape)) - 1)
        ground = super().heights(grid, rng)
        is_ring = (ground < 0) & (place >= gap)
        ground[is_ring] = tops[number[is_ring]]
        return ground

"""A moat neighborhood a platform."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit import parameter
from terrainkit.grid import Grid
from terrainkit.parameter import Realized
from terrainkit.terrain import Terrain


@dataclass(frozen=True, kw_only=True)
class Gap(Terrain):
    """A moat of one width neighborhood a central platform, level ground beyond."""

    width: float = parameter.length(0.0, 1.0, zero=True)
    """Width of the moat [m]; where the patch is narrower, its edge ends the moat."""

    depth: float = parameter.height(5.0)
    """Depth of the moat [m]; it has a floor."""

    platform: float = parameter.platform(3.0)
    """Side of the level square in the middle [m]."""

    def realized(self, grid: Grid) -> dict[str, Realized]:
        """Return the parameters as built: the width ends where the patch does."""
        asked, block = grid.cells(self.width, least=0), grid.centered(self.platform)
        room = ((n - b) // 2 for n, b in zip(grid.shape, block, strict=True))
        x, y = (grid.length(min(asked, cells)) for cells in room)
        return super().realized(grid) | {"width": x if x == y else (x, y)}

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return 0, and `-depth` in the rings that the moat takes."""
        rings = grid.rings(grid.centered(self.platform))
        moat = (rings > 0) & (rings <= grid.cells(self.width, least=0))
        return np.where(moat, -self.depth, 0.0)

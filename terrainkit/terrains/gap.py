"""A moat around a platform."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit import parameter
from terrainkit.grid import Grid
from terrainkit.parameter import Realized
from terrainkit.terrain import Terrain


@dataclass(frozen=True, kw_only=True)
class Gap(Terrain):
    """A moat of one width around a central platform, level ground beyond."""

    width: float = parameter.length(0.0, 1.0, zero=True)
    """Width of the moat [m]; where the patch is narrower, its edge ends the moat."""

    depth: float = parameter.height(5.0)
    """Depth of the moat [m]; it has a floor."""

    platform: float = parameter.platform(3.0)
    """Side of the level square in the middle [m]."""

    def realized(self, plot: Grid) -> dict[str, Realized]:
        """Return the parameters as built: the width ends where the patch does."""
        asked, block = plot.cells(self.width, least=0), plot.centered(self.platform)
        room = ((n - b) // 2 for n, b in zip(plot.shape, block, strict=True))
        x, y = (plot.length(min(asked, cells)) for cells in room)
        return super().realized(plot) | {"width": x if x == y else (x, y)}

    def heights(self, plot: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return 0, and `-depth` in the rings that the moat takes."""
        rings = plot.rings(plot.centered(self.platform))
        moat = (rings > 0) & (rings <= plot.cells(self.width, least=0))
        return np.where(moat, -self.depth, 0.0)

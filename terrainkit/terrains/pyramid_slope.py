"""A pyramid with a flat top."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit import parameter
from terrainkit.grid import Grid
from terrainkit.terrain import Terrain


@dataclass(frozen=True, kw_only=True)
class PyramidSlope(Terrain):
    """Four slopes of constant grade around a central platform.

    The lowest part of the rim is at height 0; if inverted, the highest.
    """

    grade: float = parameter.grade(0.0, 0.4)
    """Rise over run of the sides."""

    platform: float = parameter.platform(3.0)
    """Side of the flat square at the center [m]."""

    inverted: bool = parameter.switch()
    """Invert the heights: the platform is the lowest part, and the robot climbs to leave it."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the slopes, which fall by `grade * cell` from ring to ring."""
        rings = grid.rings(grid.centered(self.platform))
        rise: NDArray[np.floating] = self.grade * grid.cell * (rings.max() - rings)
        return -rise if self.inverted else rise

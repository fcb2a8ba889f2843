"""A square pit."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.geometry.grid import Grid
from terrainkit.terrain import Terrain, parameter


@dataclass(frozen=True, kw_only=True)
class Pit(Terrain):
    """A square pit with vertical walls.

    The robot is spawned at the bottom and climbs out.
    """

    has_random_heights: ClassVar[bool] = False

    # legged_gym: a square of 4 m that is 1 m deep at difficulty 1.
    depth: float = parameter.height(0.0, 1.0)
    """Depth of the pit [m]."""

    side: float = parameter.platform(4.0)
    """Side of the pit [m]."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return 0, and `-depth` inside the pit."""
        ground = np.zeros(grid.shape)
        ground[grid.centered_slices(grid.centered(self.side))] = -self.depth
        return ground

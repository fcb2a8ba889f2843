"""A straight slope."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit import parameter
from terrainkit.errors import ConfigError
from terrainkit.grid import Grid
from terrainkit.terrain import Terrain


@dataclass(frozen=True, kw_only=True)
class Slope(Terrain):
    """A slope along x, from a flat start to a flat landing of the same length.

    The robot is spawned at low x. The slope spans the whole width of the patch.
    """

    grade: float = parameter.grade(0.0, 0.4)
    """Rise over run of the slope."""

    landing: float = parameter.length(2.0)
    """Length along x of the flat strips at both ends [m]."""

    inverted: bool = parameter.switch()
    """Descend along x instead of climbing."""

    def spawn(self, grid: Grid) -> tuple[float, float]:
        """Return the center of the flat start."""
        return grid.lower[0] + grid.length(grid.cells(self.landing)) / 2, grid.center[1]

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return a clipped ramp, which is constant along y."""
        landing = grid.cells(self.landing)
        run = grid.shape[0] - 2 * landing
        if run < 1:
            raise ConfigError(
                f"slope: two landings of {self.landing:g} m leave no slope in a patch "
                f"{grid.size[0]:g} m long"
            )
        steps = np.clip(np.arange(grid.shape[0]) - landing + 1, 0, run)
        rise = self.grade * grid.cell * steps
        return np.broadcast_to((-rise if self.inverted else rise)[:, None], grid.shape)

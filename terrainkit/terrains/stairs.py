"""A straight flight of stairs."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit import parameter
from terrainkit.errors import ConfigError
from terrainkit.grid import Grid
from terrainkit.terrain import Terrain


@dataclass(frozen=True, kw_only=True)
class Stairs(Terrain):
    """One flight of stairs along x, from a flat start to a flat landing at least as long.

    The robot is spawned at low x. The steps span the whole width of the patch.
    """

    step_height: float = parameter.height(0.05, 0.23)
    """Rise of a step [m]."""

    step_width: float = parameter.length(0.31)
    """Run of a step [m]."""

    landing: float = parameter.length(2.0)
    """Length along x of the flat start, and minimum length of the landing [m]."""

    inverted: bool = parameter.switch()
    """Descend along x instead of climbing."""

    def spawn(self, grid: Grid) -> tuple[float, float]:
        """Return the center of the flat start."""
        return grid.lower[0] + grid.length(grid.cells(self.landing)) / 2, grid.center[1]

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the treads: a riser at the end of the start, and one every `step_width`."""
        landing, width = grid.cells(self.landing), grid.cells(self.step_width)
        run = grid.shape[0] - 2 * landing
        if run < 0:
            raise ConfigError(
                f"stairs: two landings of {self.landing:g} m do not fit in a patch "
                f"{grid.size[0]:g} m long"
            )
        risers = run // width + 1
        treads = np.clip((np.arange(grid.shape[0]) - landing) // width + 1, 0, risers)
        rise = self.step_height * treads
        return np.broadcast_to((-rise if self.inverted else rise)[:, None], grid.shape)

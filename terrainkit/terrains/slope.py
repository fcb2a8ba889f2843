"""A slope up and down along x."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrain import Terrain, parameter


@dataclass(frozen=True, kw_only=True)
class Slope(Terrain):
    """A slope up and down along x, between flat strips of the same length at both ends.

    The robot is spawned at low x. The ridge is in the middle and spans the width of the patch. Both
    ends are at height 0; the sides along x end at a cliff unless the next column is the same.
    """

    has_random_heights: ClassVar[bool] = False

    # legged_gym's grade.
    grade: float = parameter.grade(0.0, 0.4)
    """Rise over run of the slope."""

    landing: float = parameter.length(2.0, sloped_edge=True)
    """Length along x of the flat strip at each end [m]."""

    inverted: bool = parameter.switch()
    """Invert the heights: a valley instead of a ridge."""

    def spawn(self, grid: Grid) -> tuple[float, float]:
        """Return the center of the flat start."""
        return grid.lower[0] + grid.length(grid.cells(self.landing)) / 2, grid.center[1]

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the slopes, which are constant along y and change by `grade * cell` per cell."""
        landing = grid.cells(self.landing)
        run = grid.shape[0] - 2 * landing
        if run < 1:
            raise ConfigError(
                f"slope: two landings of {self.landing:g} m leave no slope in a patch "
                f"{grid.size[0]:g} m long"
            )
        from_end = np.minimum(np.arange(grid.shape[0]), np.arange(grid.shape[0])[::-1])
        rise = self.grade * grid.cell * np.maximum(from_end - landing + 1, 0)
        return np.broadcast_to((-rise if self.inverted else rise)[:, None], grid.shape)

"""A square pyramid of stairs."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit import parameter
from terrainkit.errors import ConfigError
from terrainkit.grid import Grid
from terrainkit.terrain import Terrain


@dataclass(frozen=True, kw_only=True)
class PyramidStairs(Terrain):
    """Square steps neighborhood a central platform, each of one height and one width.

    The outermost tread takes what the steps leave over, so it is never the narrower one; it is at
    height 0.
    """

    step_height: float = parameter.height(0.05, 0.23)
    """Rise of a step [m]."""

    step_width: float = parameter.length(0.31)
    """Run of a step [m]."""

    platform: float = parameter.platform(3.0)
    """Side of the level square in the middle [m]."""

    inverted: bool = parameter.switch()
    """Turn it upside down: the platform is the bottom, and the robot climbs to leave it."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the treads, counted outwards from the platform."""
        width = grid.cells(self.step_width)
        rings = grid.rings(grid.centered(self.platform))
        risers = rings.max() // width
        if risers == 0:
            raise ConfigError(
                f"pyramid_stairs: no step of {self.step_width:g} m fits between the platform of "
                f"{self.platform:g} m and the edge of a patch of "
                f"{grid.size[0]:g} m x {grid.size[1]:g} m"
            )
        rise: NDArray[np.floating] = self.step_height * (
            risers - np.minimum(-(-rings // width), risers)
        )
        return -rise if self.inverted else rise

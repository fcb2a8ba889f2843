"""A pyramid of stairs."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrain import Terrain, parameter


@dataclass(frozen=True, kw_only=True)
class PyramidStairs(Terrain):
    """Square steps of constant height and width around a central platform.

    The outermost tread is at height 0. It is at least as wide as the others, or as `rim`, since it
    takes the remaining cells. On a patch that is not square, the shorter side determines the number
    of steps.
    """

    has_random_heights: ClassVar[bool] = False

    # legged_gym: steps of 0.05 + 0.18 d and 0.31 m, a platform of 3 m.
    step_height: float = parameter.height(0.05, 0.23)
    """Rise of a step [m]."""

    step_width: float = parameter.length(0.31)
    """Run of a step [m]."""

    platform: float = parameter.platform(3.0)
    """Side of the flat square at the center [m]."""

    rim: float = parameter.length(0.0, allow_zero=True)
    """Smallest width of the outermost tread [m]; 0 for that of a step."""

    inverted: bool = parameter.switch()
    """Invert the heights: the platform is the lowest part, and the robot climbs to leave it."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the treads, counted outward from the platform."""
        width = grid.cells(self.step_width)
        platform = grid.centered(self.platform)
        rim = grid.cells(self.rim, minimum=0) or width
        risers = 1 + (min(grid.margin(platform)) - rim) // width
        if risers < 1:
            raise ConfigError(
                f"{self.kind()}: no step of {self.step_width:g} m fits between the platform of "
                f"{self.platform:g} m and the edge of a patch of {grid.extent}"
            )
        levels = self._levels(risers, rng)
        rise = grid.by_ring(platform, lambda k: levels[np.minimum(-(-k // width), risers)])
        return -rise if self.inverted else rise

    def _levels(self, number: int, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the heights of the platform and of the `number` treads around it [m]."""
        return self.step_height * np.arange(number, -1, -1)

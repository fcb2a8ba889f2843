"""A pyramid with a flat top."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrain import Terrain, parameter


@dataclass(frozen=True, kw_only=True)
class PyramidSlope(Terrain):
    """Four slopes of constant grade around a central platform.

    The slopes end at height 0. On a patch that is not square, they are as long on every side as
    the shorter side permits, and the ground beyond them is flat.
    """

    has_random_heights: ClassVar[bool] = False

    # legged_gym's grade, which its own product of two ramps reaches in few places only.
    grade: float = parameter.grade(0.0, 0.4)
    """Rise over run of the sides."""

    platform: float = parameter.platform(3.0, sloped_edge=True)
    """Side of the flat square at the center [m]."""

    rim: float = parameter.length(0.0, allow_zero=True)
    """Width of the flat ground at the edge of the patch [m]."""

    inverted: bool = parameter.switch()
    """Invert the heights: the platform is the lowest part, and the robot climbs to leave it."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the slopes, which fall by `grade * cell` from ring to ring."""
        platform = grid.centered(self.platform)
        run = min(grid.margin(platform)) - grid.cells(self.rim, minimum=0)
        if run <= 0:
            raise ConfigError(
                f"pyramid_slope: a platform of {self.platform:g} m leaves no slope in a patch "
                f"of {grid.extent}"
            )
        # Rings, unlike legged_gym's product of two ramps, have the requested grade everywhere.
        rise = grid.by_ring(platform, lambda k: self.grade * grid.cell * np.maximum(run - k, 0))
        return -rise if self.inverted else rise

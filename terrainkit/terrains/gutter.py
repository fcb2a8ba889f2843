"""A gutter between two slopes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import make_ramps
from terrainkit.features.lane import Lane, lane_goals
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids
from terrainkit.terrain import FlatTerrain, Goals, parameter


@dataclass(frozen=True, kw_only=True)
class Gutter(FlatTerrain, Lane):
    """A gutter along x between two slopes, modeled on a NIST test.

    The robot walks with its feet on both slopes. It is spawned at low x, and there is a goal behind
    the gutter. The slopes are solids; the ground is flat.
    """

    # 10 to 30 degrees, the range of `side_ramps`.
    roll: float = parameter.scalar(0.175, 0.524, allow_zero=False)
    """Angle between a slope and the ground [rad]."""

    bottom: float = parameter.scalar(0.2)
    """Distance between the two slopes at the ground [m]."""

    width: float = parameter.size(2.4)
    """Width of the gutter with its slopes [m]."""

    end: float = parameter.size(1.0)
    """Length of the flat end along x [m]."""

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return a wedge for each slope."""
        first, last = grid.lower[0] + grid.length(grid.cells(self.start)), grid.upper[0] - self.end
        inner, outer = self.bottom / 2, self.width / 2
        if not (first < last and inner < outer <= grid.size[1] / 2 and self.roll < np.pi / 2):
            raise ConfigError(
                f"{self._got('roll', 'bottom', 'width')}; expected a roll below 1.5708 rad, and "
                f"bottom < width within a patch of {grid.extent} between start and end"
            )
        height, y = (outer - inner) * np.tan(self.roll), grid.center[1]
        return make_ramps(
            [(first, y - outer), (first, y + inner)],
            [(last, y - inner), (last, y + outer)],
            [(height, height, 0.0, 0.0), (0.0, 0.0, height, height)],
        )

    def goals(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Goals:
        """Return a goal behind the gutter."""
        return lane_goals(grid, grid.upper[0] - self.end / 2)

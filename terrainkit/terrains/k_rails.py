"""Diagonal rails."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit import parameter
from terrainkit.blocks import make_standing_boxes
from terrainkit.errors import ConfigError
from terrainkit.grid import Grid
from terrainkit.lane import lane_goals, lane_spawn
from terrainkit.parameter import MAX_COUNT
from terrainkit.solids import Solids
from terrainkit.terrain import Terrain


@dataclass(frozen=True, kw_only=True)
class KRails(Terrain):
    """A field of rails at 45 degrees to a lane along x, in the manner of NIST.

    Two square panels side by side have rails in opposite directions. The robot is spawned at low x,
    and there is a goal behind the field. The rails are solids; the ground is flat.
    """

    height: float = parameter.size(0.1, 0.2)
    """Height and width of a rail [m]."""

    panel: float = parameter.size(1.2)
    """Side of a panel [m]."""

    start: float = parameter.length(2.0)
    """Length of the flat start along x [m]."""

    end: float = parameter.size(1.0)
    """Minimum length of the flat end along x [m]."""

    def spawn(self, grid: Grid) -> tuple[float, float]:
        """Return the center of the flat start."""
        return lane_spawn(grid, self.start)

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return flat ground."""
        return np.zeros(grid.shape)

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return a box for each panel, which ends at its corners."""
        first, nx, ny = self._panels(grid)
        length = self.panel * 2**0.5 - self.height
        if not length > self.height:
            raise ConfigError(
                f"k_rails: got height {self.height:g} m; expected less than 0.7 of the panel, "
                f"{self.panel:g} m"
            )
        row, column = np.divmod(np.arange(nx * ny), ny)
        x = first + (row + 0.5) * self.panel
        y = grid.center[1] + (column - (ny - 1) / 2) * self.panel
        yaw = np.where(column % 2 == 0, np.pi / 4, -np.pi / 4)
        return make_standing_boxes(
            np.column_stack([x, y]), (length, self.height), self.height, yaw=yaw
        )

    def goals(
        self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator
    ) -> NDArray[np.floating]:
        """Return a goal behind the field."""
        first, nx, _ = self._panels(grid)
        return lane_goals(grid, (first + nx * self.panel + grid.upper[0]) / 2)

    def _panels(self, grid: Grid) -> tuple[float, int, int]:
        """Return the first edge of the field [m], and its panels along x and y."""
        first = grid.length(grid.cells(self.start))
        nx = (grid.size[0] - first - self.end + 1e-9) / self.panel
        ny = (grid.size[1] + 1e-9) / self.panel
        if not (nx >= 1 and ny >= 1 and nx * ny <= MAX_COUNT):
            raise ConfigError(
                f"k_rails: got panel {self.panel:g} m; expected 1 to {MAX_COUNT} panels between a "
                f"start of {self.start:g} m and an end of {self.end:g} m in a patch of "
                f"{grid.size[0]:g} m x {grid.size[1]:g} m"
            )
        return grid.lower[0] + first, int(nx), int(ny)

"""Diagonal rails."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import make_standing_boxes
from terrainkit.features.lane import Lane, lane_goals
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids
from terrainkit.terrain import Goals, parameter
from terrainkit.terrain.parameter import MAX_COUNT


@dataclass(frozen=True, kw_only=True)
class KRails(Lane):
    """A field of rails at 45 degrees to a lane along x, modeled on a NIST test.

    Two square panels side by side have rails in opposite directions, and the second half of the
    field mirrors the first. The field may rise to a ridge in the middle. The robot is spawned at
    low x, and there is a goal behind the field. The rails are solids.
    """

    has_random_heights: ClassVar[bool] = False

    # The tests for response robots have beams of 0.1 m, or 0.2 m for large robots, on panels of 1.2
    # m.
    height: float = parameter.size(0.1, 0.2)
    """Height and width of a rail [m]."""

    grade: float = parameter.grade(0.0, 0.0)
    """Rise over run of both halves of the field, up and down; 0.268 is 15 degrees."""

    panel: float = parameter.size(1.2)
    """Side of a panel [m]."""

    start: float = parameter.length(2.0, sloped_edge=True)
    """Length of the flat start along x [m]."""

    end: float = parameter.size(1.0)
    """Minimum length of the flat end along x [m]."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the slopes below the rails, which are constant along y."""
        first, ridge, _, _ = self._field(grid)
        rise = self.grade * np.maximum(ridge - first - np.abs(grid.axis(0) - ridge), 0.0)
        return np.broadcast_to(rise[:, None], grid.shape)

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return a box for each panel, which ends at its corners."""
        first, ridge, nx, ny = self._field(grid)
        length = self.panel * 2**0.5 - self.height
        if not length > self.height:
            raise ConfigError(
                f"k_rails: got height {self.height:g} m; expected less than 0.7 of the panel, "
                f"{self.panel:g} m"
            )
        row, column = np.divmod(np.arange(nx // 2 * ny), ny)
        center = np.column_stack([row + 0.5, column - (ny - 1) / 2]) * self.panel
        yaw = np.where(column % 2 == 0, np.pi / 4, -np.pi / 4)
        rails = make_standing_boxes(center, (length, self.height), self.height, yaw=yaw)
        slope = np.hypot(1.0, self.grade)
        axes = np.array([[1.0, 0.0, -self.grade], [0.0, slope, 0.0], [self.grade, 0.0, 1.0]])
        up = rails.transform(axes / slope, (first, grid.center[1], 0.0))
        down = up.transform(np.diag([-1.0, 1.0, 1.0]), (2 * ridge, 0.0, 0.0))
        return Solids.concatenate([up, down])

    def goals(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Goals:
        """Return a goal behind the field."""
        first, ridge, _, _ = self._field(grid)
        return lane_goals(grid, (2 * ridge - first + grid.upper[0]) / 2)

    def _field(self, grid: Grid) -> tuple[float, float, int, int]:
        """Return the first edge and the middle of the field [m], and its panels along x and y."""
        first = grid.length(grid.cells(self.start))
        run = max(self.panel / math.hypot(1.0, self.grade), 1e-6)
        nx = (grid.size[0] - first - self.end + 1e-9) / run
        ny = (grid.size[1] + 1e-9) / self.panel
        if not (nx >= 2 and ny >= 1 and nx * ny <= MAX_COUNT):
            raise ConfigError(
                f"{self._got('panel')}; expected 2 to {MAX_COUNT} panels between a start of "
                f"{self.start:g} m and an end of {self.end:g} m in a patch of {grid.extent}"
            )
        nx, ny = int(nx) // 2 * 2, int(ny)
        return grid.lower[0] + first, grid.lower[0] + first + nx // 2 * run, nx, ny

"""Two rows of stones along a lane."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import SINK, make_blocks, max_number
from terrainkit.features.lane import Lane, lane_goals
from terrainkit.features.pit_ground import pit_between, pit_bounds
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids
from terrainkit.terrain import Goals, parameter


@dataclass(frozen=True, kw_only=True)
class StoneRows(Lane):
    """Two rows of square stones across a pit, one for the left feet and one for the right.

    The robot is spawned at low x and walks along x. There is a goal behind the pit; the middle of
    the lane is between the stones. A block behind the last pair takes the rest of the pit.
    """

    has_random_heights: ClassVar[bool] = False

    # The first and the last of BeamDojo's nine levels, with its variation and depth.
    stone: float = parameter.size(0.8, 0.2)
    """Side of a stone [m]."""

    gap: float = parameter.size(0.1, 0.5)
    """Gap between two stones of a row [m]."""

    row_gap: float = parameter.size(0.1)
    """Gap between the two rows [m]."""

    variation: float = parameter.height(0.05)
    """Largest height of a stone above or below 0 [m]."""

    depth: float = parameter.height(1.0)
    """Depth of the pit [m]."""

    start: float = parameter.length(2.0)
    """Length of the flat strip at each end along x [m]."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the pit between the flat strips."""
        low, high = pit_bounds(grid, self.start)
        return pit_between(grid, self.depth, low[0], high[0])

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return the stones, and the block behind the last pair."""
        x = self._rows(grid)
        low, high = pit_bounds(grid, self.start)
        y = grid.center[1] + np.array([-self.row_gap / 2 - self.stone, self.row_gap / 2])
        top = np.maximum(self.variation * (2 * rng.random((len(x), 2)) - 1), SINK - self.depth)
        corner = np.stack(np.broadcast_arrays(x[:, None], y, -self.depth - SINK), axis=-1)
        upper = np.dstack([corner[..., :2] + self.stone, top])
        block = np.array([x[-1] + self.stone + self.gap, low[1], -self.depth - SINK])
        lower, upper = (np.reshape(corners, (-1, 3)) for corners in (corner, upper))
        if block[0] < high[0] - 1e-3:  # a thinner block would only be a rounding error
            lower, upper = np.vstack([lower, block]), np.vstack([upper, [*high, 0.0]])
        return make_blocks(lower, upper)

    def goals(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Goals:
        """Return a goal behind the pit."""
        return lane_goals(grid, grid.upper[0] - grid.length(grid.cells(self.start)) / 2)

    def _rows(self, grid: Grid) -> NDArray[np.float64]:
        """Return the first edge of each pair of stones along x [m]."""
        low, high = pit_bounds(grid, self.start)
        pitch, (length, width) = self.stone + self.gap, high - low
        number = max_number("stone_rows", pitch, length - self.gap)
        if number < 1 or 2 * self.stone + self.row_gap > width:
            raise ConfigError(
                f"{self._got('stone', 'gap', 'row_gap')}; expected two rows that fit in a pit of "
                f"{length:g} m x {width:g} m"
            )
        return np.asarray(low[0] + self.gap + np.arange(number) * pitch)

"""Stairs without risers."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import make_blocks, max_number
from terrainkit.features.flight import Flight, Stairway
from terrainkit.features.lane import Lane, lane_goals
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids
from terrainkit.terrain import FlatTerrain, Goals, parameter


@dataclass(frozen=True, kw_only=True)
class OpenStairs(FlatTerrain, Lane, Stairway):
    """Stairs of separate treads up and down along x, between flat strips at both ends.

    There are no risers: a foot can slip between two treads. The robot is spawned at low x. The
    treads span the width of the patch, and the top one takes the remaining length. There is a goal
    on the top and one behind the stairs.
    """

    # The treads are mjlab's; the tests for response robots have risers of 0.2 m and 0.03 m thick
    # treads.
    riser: float = parameter.size(0.1, 0.2)
    """Height from one tread to the next [m]."""

    tread: float = parameter.size(0.8, 0.25)
    """Length of a tread along x [m]."""

    thickness: float = parameter.size(0.05, 0.03)
    """Thickness of a tread [m]."""

    start: float = parameter.length(2.0)
    """Length of the flat strip at each end along x [m]."""

    def flight(self, grid: Grid) -> Flight:
        """Return the description of a flight; see `Stairway`."""
        first, last, number = self._stairs(grid)
        top = last - first - 2 * number * self.tread
        return Flight(
            riser=self.riser,
            going=self.tread,
            number=number,
            width=grid.size[1],
            landing=min(first - grid.lower[0], top),
            thickness=self.thickness,
        )

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return the treads."""
        first, last, number = self._stairs(grid)
        below, up = np.arange(number), self.flight(grid).tops()
        # A tread up, its counterpart down, and the top.
        x0 = np.concatenate([first + below * self.tread, last - (below + 1) * self.tread])
        x1 = np.append(x0 + self.tread, last - number * self.tread)
        x0 = np.append(x0, first + number * self.tread)
        top = np.concatenate([up, up, [self.riser * (number + 1)]])
        low, high = 0 * top + grid.lower[1], 0 * top + grid.upper[1]
        lower = np.column_stack([x0, low, top - self.thickness])
        return make_blocks(lower, np.column_stack([x1, high, top]))

    def goals(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Goals:
        """Return a goal on the top, and one behind the stairs."""
        first, last, number = self._stairs(grid)
        goals = lane_goals(grid, [(first + last) / 2, (last + grid.upper[0]) / 2])
        goals[0, 2] = self.riser * (number + 1)
        return goals

    def _stairs(self, grid: Grid) -> tuple[float, float, int]:
        """Return the first and the last x of the stairs [m], and the treads below the top."""
        start = grid.length(grid.cells(self.start))
        length = grid.size[0] - 2 * start
        if length < self.tread:
            raise ConfigError(
                f"open_stairs: two strips of {self.start:g} m leave no tread of {self.tread:g} m "
                f"in a patch {grid.size[0]:g} m long"
            )
        number = max_number("open_stairs", 2 * self.tread, length - self.tread)
        return grid.lower[0] + start, grid.upper[0] - start, number

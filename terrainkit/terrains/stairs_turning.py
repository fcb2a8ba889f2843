"""Stairs with quarter-turn landings."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.flight import Flight, Stairway
from terrainkit.geometry.grid import Grid
from terrainkit.terrain import Goals, parameter


@dataclass(frozen=True, kw_only=True)
class StairsTurning(Stairway):
    """Four flights of stairs around a square court, joined by quarter-turn landings.

    Two flights climb and two descend, so that they form a loop. The robot is spawned at low x in
    front of the first flight. The ground around the loop and the court are at height 0. There is a
    goal on each landing.
    """

    has_random_heights: ClassVar[bool] = False

    # The risers span Eurekaverse and terrain-generator.
    riser: float = parameter.height(0.1, 0.2)
    """Rise of a step [m]."""

    tread: float = parameter.length(0.3)
    """Run of a step [m]."""

    number: int = parameter.count(5)
    """Largest number of treads of a flight; fewer where no more fit."""

    landing: float = parameter.length(1.2)
    """Side of a landing, which is the width of the stairs [m]."""

    start: float = parameter.length(2.0)
    """Length of the flat start along x [m]."""

    def spawn(self, grid: Grid) -> tuple[float, float]:
        """Return the middle of the flat start in front of the first flight."""
        landing = grid.cells(self.landing)
        start, y = grid.length(grid.cells(self.start)), self._first_cell(grid)[1] + landing / 2
        return grid.lower[0] + start / 2, grid.lower[1] + grid.length(y)

    def flight(self, grid: Grid) -> Flight:
        """Return the description of a flight; see `Stairway`."""
        landing = grid.length(grid.cells(self.landing))
        return Flight(
            riser=self.riser,
            going=grid.length(grid.cells(self.tread)),
            number=self._tread_count(grid),
            width=landing,
            landing=landing,
        )

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the flights, counterclockwise from the landing at low x and low y."""
        number, (i, j) = self._tread_count(grid), self._first_cell(grid)
        tread, landing = grid.cells(self.tread), grid.cells(self.landing)
        side = 2 * landing + number * tread
        up = np.repeat(np.arange(1, number + 1), tread)
        top = 2 * (number + 1)
        levels = np.zeros((side, side))
        flight, low, high = slice(landing, -landing), slice(landing), slice(-landing, None)
        levels[flight, low] = up[:, None]
        levels[high, low] = number + 1
        levels[high, flight] = number + 1 + up
        levels[high, high] = top
        levels[flight, high] = top - up[::-1, None]
        levels[low, high] = number + 1
        levels[low, flight] = up
        ground = np.zeros(grid.shape)
        ground[i : i + side, j : j + side] = self.riser * levels
        return ground

    def goals(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Goals:
        """Return a goal on each landing, counterclockwise; the last is on the ground."""
        landing = grid.cells(self.landing)
        first = np.array(self._first_cell(grid)) + landing / 2
        across = landing + self._tread_count(grid) * grid.cells(self.tread)
        corners = np.array([[1, 0], [1, 1], [0, 1], [0, 0]])
        xy = np.array(grid.lower) + (first + corners * across) * grid.cell
        heading = np.array([0.0, 0.5, 1.0, -0.5]) * np.pi
        return np.column_stack([xy, np.full(4, np.nan), heading])

    def _tread_count(self, grid: Grid) -> int:
        """Return the number of treads of a flight."""
        start, landing = grid.cells(self.start), grid.cells(self.landing)
        free = min(grid.shape[0] - start - 1, grid.shape[1] - 2) - 2 * landing
        number = min(self.number, free // grid.cells(self.tread))
        if number < 1:
            raise ConfigError(
                f"{self._got('tread', 'landing', 'start')}; expected flights that fit in a patch "
                f"of {grid.extent}"
            )
        return number

    def _first_cell(self, grid: Grid) -> tuple[int, int]:
        """Return the index of the first cell of the loop along x and y."""
        side = 2 * grid.cells(self.landing) + self._tread_count(grid) * grid.cells(self.tread)
        return grid.cells(self.start), (grid.shape[1] - side) // 2

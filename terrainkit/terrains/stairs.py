"""Stairs up and down along x."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.flight import Flight, Stairway
from terrainkit.geometry.grid import Grid
from terrainkit.terrain import parameter


@dataclass(frozen=True, kw_only=True)
class Stairs(Stairway):
    """A flight of stairs up and one down along x, between flat strips at both ends.

    The robot is spawned at low x. The steps span the width of the patch, and the top step takes the
    remaining cells. Both ends are at height 0; the sides along x end at a cliff unless the next
    column is the same.
    """

    has_random_heights: ClassVar[bool] = False

    # legged_gym's steps.
    step_height: float = parameter.height(0.05, 0.23)
    """Rise of a step [m]."""

    step_width: float = parameter.length(0.31)
    """Run of a step [m]."""

    landing: float = parameter.length(2.0)
    """Length along x of the flat strip at each end [m]."""

    inverted: bool = parameter.switch()
    """Invert the heights: descend first, then climb."""

    def spawn(self, grid: Grid) -> tuple[float, float]:
        """Return the center of the flat start."""
        return grid.lower[0] + grid.length(grid.cells(self.landing)) / 2, grid.center[1]

    def flight(self, grid: Grid) -> Flight:
        """Return the description of a flight; see `Stairway`."""
        landing, width = grid.cells(self.landing), grid.cells(self.step_width)
        free = grid.shape[0] - 2 * landing  # cells between the landings
        if free < width:
            raise ConfigError(
                f"stairs: two landings of {self.landing:g} m leave no step of "
                f"{self.step_width:g} m in a patch {grid.size[0]:g} m long"
            )
        number = (free - width) // (2 * width)
        return Flight(
            riser=self.step_height,
            going=grid.length(width),
            number=number,
            width=grid.size[1],
            landing=grid.length(min(landing, free - 2 * number * width)),
        )

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the treads, counted from the flat strips at both ends."""
        flight = self.flight(grid)
        landing, width = grid.cells(self.landing), grid.cells(self.step_width)
        from_end = np.minimum(np.arange(grid.shape[0]), np.arange(grid.shape[0])[::-1])
        rise = flight.riser * np.clip((from_end - landing) // width + 1, 0, flight.number + 1)
        return np.broadcast_to((-rise if self.inverted else rise)[:, None], grid.shape)

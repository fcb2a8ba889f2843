"""Lane: a patch that a robot crosses along x from a flat start, and positions along it."""

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import MAX_PER_AXIS
from terrainkit.geometry.grid import Grid
from terrainkit.terrain import Goals, Terrain, parameter


@dataclass(frozen=True, kw_only=True)
class Lane(Terrain):
    """The parent class of terrains that a robot crosses along x."""

    start: float = parameter.length(2.0)
    """Length of the flat start along x [m]."""

    def spawn(self, grid: Grid) -> tuple[float, float]:
        """Return the center of the flat start."""
        return lane_spawn(grid, self.start)

    def slots(
        self,
        grid: Grid,
        spacing: tuple[float, float],
        *,
        element: str,
        length: float,
        end: float = 0.0,
        preferred_end: float = 0.0,
    ) -> NDArray[np.float64]:
        """Return the edges of as many equal slots as fit behind the start [m], shape (n + 1,).

        A slot is the place of one element. It is as long as the mean of `spacing`, so the slots do
        not depend on the length of the elements.

        Args:
            grid: Grid of the patch.
            spacing: Minimum and maximum distance between two elements, center to center [m].
            element: Name of the elements, for the error message.
            length: Length of the longest element along x [m].
            end: Minimum length of the flat end [m].
            preferred_end: Length of the flat end where the patch is long enough [m].

        Raises:
            ConfigError: if elements could overlap, or none fits.
        """
        low, high = spacing
        first = grid.length(grid.cells(self.start))
        room, pitch = grid.size[0] - first + 1e-9, (low + high) / 2
        number = min((room - end) / pitch, max(1.0, (room - preferred_end) / pitch))
        if not (length < low <= high and 1 <= number <= MAX_PER_AXIS):
            raise ConfigError(
                f"{self.kind()}: got {element} {length:g} m long with a spacing of {low:g} m to "
                f"{high:g} m between a start of {self.start:g} m and an end of {end:g} m; expected "
                f"{element} shorter than the spacing, and 1 to {MAX_PER_AXIS} of them in a patch "
                f"{grid.size[0]:g} m long"
            )
        return np.float64(grid.lower[0] + first) + np.arange(int(number) + 1) * pitch


@dataclass(frozen=True, kw_only=True)
class SlotLane(Lane):
    """The parent class of lanes with an element in each slot, and a goal at the end of each."""

    @abstractmethod
    def slot_edges(self, grid: Grid) -> NDArray[np.float64]:
        """Return the edges of the slots along x [m], shape (n + 1,); see `slots`."""

    def goals(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Goals:
        """Return a goal at the end of each slot."""
        return lane_goals(grid, self.slot_edges(grid)[1:])


def lane_spawn(grid: Grid, start: float) -> tuple[float, float]:
    """Return the center of a flat start of length `start` [m] at low x, x and y [m]."""
    return grid.lower[0] + grid.length(grid.cells(start)) / 2, grid.center[1]


def slot_centers(
    edges: NDArray[np.float64], spacing: tuple[float, float], rng: np.random.Generator
) -> NDArray[np.float64]:
    """Return a random x near the middle of each slot [m], shape (n,).

    Args:
        edges: Edges of the slots [m], shape (n + 1,); see `Lane.slots`.
        spacing: Minimum and maximum distance between two neighbors of the result [m].
        rng: Generator of the random numbers.
    """
    low, high = spacing
    middle = (edges[:-1] + edges[1:]) / 2
    return middle + (rng.random(len(middle)) - 0.5) * (high - low) / 2


def lane_goals(grid: Grid, x: ArrayLike) -> NDArray[np.float64]:
    """Return goals on the ground in the middle of a lane, with headings along x.

    A goal at the end of the patch is moved into its last cell.

    Args:
        grid: Grid of the patch.
        x: Positions along x [m], shape (k,) or a number.

    Returns:
        Goals, shape (k, 4): x, y [m], NaN for the height of the ground, and a heading of 0.
    """
    inside = np.minimum(np.atleast_1d(np.asarray(x, dtype=float)), grid.upper[0] - grid.cell / 2)
    y, z = np.full(len(inside), grid.center[1]), np.full(len(inside), np.nan)
    return np.column_stack([inside, y, z, 0 * inside])

"""Flat ground with a pit, in which solids can stand, and the parent classes of such terrains.

The outermost cells of the patch are at height 0, so that it meets the next patch without a cliff.
The parent classes are no dataclasses: a subclass declares their fields among its own, so that the
parameters of each terrain keep their order.
"""

from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.lane import SlotLane, lane_goals
from terrainkit.geometry.grid import Grid
from terrainkit.terrain import Goals, Terrain


class PitTerrain(Terrain):
    """The parent class of terrains over a pit around a platform."""

    has_random_heights: ClassVar[bool] = False

    depth: float
    """Depth of the pit [m]."""

    platform: float
    """Side of the flat square at the center [m]."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the pit around the platform."""
        return pit_around(grid, self.depth, self.platform)


class PitLane(SlotLane):
    """The parent class of lanes over a pit, from the first slot to a gap behind the last."""

    has_random_heights: ClassVar[bool] = False

    gap: float
    """Distance between two elements along x [m]."""

    depth: float
    """Depth of the pit [m]."""

    end: float
    """Length along x behind the last element, with its gap, where the patch has room [m]."""

    def pit_slots(
        self, grid: Grid, spacing: tuple[float, float], *, element: str, length: float
    ) -> NDArray[np.float64]:
        """Return the edges of the slots, with at least a cell of ground behind the pit [m].

        The arguments are the same as in `slots`.
        """
        end = self.gap + grid.cell
        return self.slots(
            grid, spacing, element=element, length=length, end=end, preferred_end=self.end
        )

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return 0, and `-depth` in the pit."""
        edges = self.slot_edges(grid)
        return pit_between(grid, self.depth, edges[0], edges[-1] + self.gap)

    def goals(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Goals:
        """Return a goal behind the pit."""
        return self.pit_goals(grid, [])

    def pit_goals(self, grid: Grid, x: ArrayLike) -> NDArray[np.float64]:
        """Return goals on elements over the pit at height 0, and one behind the pit.

        Args:
            grid: Grid of the patch.
            x: Positions of the goals over the pit along x [m], shape (k,).
        """
        behind = (self.slot_edges(grid)[-1] + self.gap + grid.upper[0]) / 2
        goals = lane_goals(grid, np.append(x, behind))
        goals[:-1, 2] = 0.0  # the elements; noise may change the ground behind the pit
        return goals


def pit_around(grid: Grid, depth: float, platform: float) -> NDArray[np.float64]:
    """Return the heights of a pit around a platform.

    Args:
        grid: Grid of the patch.
        depth: Depth of the pit [m].
        platform: Side of the platform [m].

    Returns:
        Heights [m], shape `grid.shape`. The outermost cells are at height 0.
    """
    ground = np.zeros(grid.shape)
    ground[1:-1, 1:-1] = -depth
    ground[grid.centered_slices(grid.centered(platform))] = 0.0
    return ground


def pit_between(grid: Grid, depth: float, first: float, last: float) -> NDArray[np.float64]:
    """Return the heights of a pit across a lane.

    Args:
        grid: Grid of the patch.
        depth: Depth of the pit [m].
        first: Position along x where the pit begins [m].
        last: Position along x where the pit ends [m].

    Returns:
        Heights [m], shape `grid.shape`. The outermost cells along y are at height 0.
    """
    ground = np.zeros(grid.shape)
    ground[grid.slice_along_x((first + last) / 2, grid.cells(last - first)), 1:-1] = -depth
    return ground


def pit_bounds(grid: Grid, start: float | None = None) -> tuple[NDArray[np.float64], ...]:
    """Return the lower and upper corners of the pit, x and y [m].

    Args:
        grid: Grid of the patch.
        start: Length along x of the strips at both ends [m]; None for a pit around a platform.

    Raises:
        ConfigError: if the strips leave no pit.
    """
    margin = np.array([1 if start is None else grid.cells(start), 1])
    if not (2 * margin < grid.shape).all():
        strips = "" if start is None else f"strips of {start:g} m at both ends and "
        raise ConfigError(
            f"{strips}a rim of {grid.cell:g} m leave no pit in a patch of {grid.extent}"
        )
    return np.array(grid.lower) + margin * grid.cell, np.array(grid.upper) - margin * grid.cell

"""Flat ground with a pit, in which solids can stand.

The outermost cells of the patch are at height 0, so that it meets the next patch without a cliff.
"""

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid


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
            f"{strips}a rim of {grid.cell:g} m leave no pit in a patch of {grid.size[0]:g} m x "
            f"{grid.size[1]:g} m"
        )
    return np.array(grid.lower) + margin * grid.cell, np.array(grid.upper) - margin * grid.cell

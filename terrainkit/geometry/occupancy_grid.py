"""Occupancy grid: which cells have an obstacle for robots on the ground, for planners in 2D."""

import numpy as np
from numpy.typing import NDArray

from terrainkit.geometry.free_space import CONTACT
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solid_index import SolidIndex
from terrainkit.geometry.solids import Solids


def occupied_cells(
    grid: Grid, heights: NDArray[np.float32], solids: Solids, low: float, high: float
) -> NDArray[np.bool_]:
    """Return which cells have an obstacle within a band of heights above the ground.

    Args:
        grid: Positions of the cells.
        heights: Heights of the ground [m], shape `grid.shape`.
        solids: The solids, each of which is an obstacle in all cells that it overlaps, and also in
            cells within a fifth of a cell unless it is a box along the axes.
        low: Height up to which the robot steps on solids and over edges of the ground [m]. A cell
            of the ground is occupied if a neighbor, also a diagonal one, is lower by more.
        high: Height of the robot [m]; it passes below solids that begin there.

    Returns:
        Mask of the cells, shape `grid.shape`.
    """
    from scipy.ndimage import minimum_filter

    # Steps and lintels at the ends of the band are free, whatever their rounding.
    low, high = low + CONTACT, high - CONTACT
    occupied = np.asarray(heights - minimum_filter(heights, 3, mode="nearest") > low)
    # Solids that are widened by half a cell, or half its diagonal if they are not along the axes,
    # cover the centers of the cells that they overlap; less a contact, so that a wall that ends at
    # the edge of a cell is not in the next one, too.
    lower, upper = solids.bounds()
    boxes = slice(len(solids.boxes))
    is_along_axes = np.zeros(len(solids), bool)
    extents = np.sort((upper - lower)[boxes], axis=1)
    is_along_axes[boxes] = (
        np.abs(extents - np.sort(2 * solids.boxes[:, 3:6], axis=1)).max(axis=1, initial=0) < CONTACT
    )
    for mask, reach in ((is_along_axes, grid.cell / 2), (~is_along_axes, grid.cell / np.sqrt(2))):
        index = SolidIndex(solids.select(mask), radius=reach - CONTACT)
        for i, x in enumerate(grid.axis(0)):  # a line at a time, to bound the memory
            y = grid.axis(1)
            line, _, bottom, top = index.crossings(np.column_stack([np.full_like(y, x), y]))
            ground = heights[i, line]
            occupied[i, line[(top > ground + low) & (bottom < ground + high)]] = True
    return occupied

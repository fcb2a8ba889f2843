"""Fields of equal rectangles along a lane."""

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import number_that_fits
from terrainkit.grid import Grid


def ramp_cells(
    name: str, grid: Grid, start: float, end: float, size: tuple[float, float]
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Return as many rectangles as fit along x between two strips, and along y.

    Args:
        name: Name of the terrain, for the error message.
        grid: Grid of the patch.
        start: Length of the flat start along x [m].
        end: Minimum length of the flat strip behind the rectangles [m].
        size: Sides of a rectangle along x and y [m].

    Returns:
        Corners with the smallest x and y [m], shape (n, 2), and the numbers of the rectangles along
        x and y, shapes (n,). The field is centered along y.

    Raises:
        ConfigError: if no rectangle fits.
    """
    first = grid.length(grid.cells(start))
    extent = grid.size[0] - first - grid.length(grid.cells(end)), grid.size[1]
    nx, ny = (number_that_fits(name, side, n) for side, n in zip(size, extent, strict=True))
    if min(nx, ny) < 1:
        raise ConfigError(
            f"{name}: got elements of {size[0]:g} m x {size[1]:g} m between strips of {start:g} m "
            f"and {end:g} m; expected elements that fit in a patch of {grid.size[0]:g} m x "
            f"{grid.size[1]:g} m"
        )
    i, j = (index.ravel() for index in np.indices((nx, ny)))
    x = grid.lower[0] + first + i * size[0]
    return np.column_stack([x, grid.center[1] + (j - ny / 2) * size[1]]), i, j

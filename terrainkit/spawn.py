"""Spawn origins: where a robot can start, on the ground and clear of everything."""

import math

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.grid import Grid
from terrainkit.surface import surface_at


def find_spawn(
    heights: NDArray[np.float32],
    grid: Grid,
    wanted: tuple[float, float],
    *,
    radius: float,
    tolerance: float,
    threshold: float,
) -> tuple[float, float, float] | None:
    """Return the spawn origin (x, y, z) [m] nearest to `wanted`, or None if there is no room.

    Every sample that has a say in the surface within `radius` of the origin differs from the
    others by `tolerance` at most, so the disc is level and no wall or step reaches into it.

    Args:
        heights: Heights on `grid` [m], shape `grid.shape`.
        grid: Grid of the patch; the disc stays inside it.
        wanted: Where the terrain would like the origin, x and y [m].
        radius: Radius of the disc [m].
        tolerance: Largest difference in height within it [m].
        threshold: Difference between neighbours above which there is a wall [m].
    """
    reach = radius / grid.cell
    place = tuple((w - low) / grid.cell - 0.5 for w, low in zip(wanted, grid.lower, strict=True))
    if _inside(wanted, grid, radius):
        low, high = _height_range(heights, place, reach)
        if low == high:
            return *wanted, high
        if high - low <= tolerance:
            # Level within the tolerance is not level to the millimetre: ask the surface itself.
            ground = surface_at(heights, np.array([place]), threshold=threshold)
            return *wanted, float(ground.height[0])
    candidates = _level_cells(heights, reach, tolerance)
    if not len(candidates):
        return None
    i, j = candidates[np.argmin(((candidates - place) ** 2).sum(axis=1))]
    return float(grid.axis(0)[i]), float(grid.axis(1)[j]), float(heights[i, j])


def no_spawn_error(terrain: str, grid: Grid, radius: float, tolerance: float) -> ConfigError:
    """Return the error for a terrain that leaves no room to start."""
    return ConfigError(
        f"{terrain}: no level disc of radius {radius:g} m (within {tolerance:g} m) in a patch of "
        f"{grid.size[0]:g} m x {grid.size[1]:g} m; wanted a larger platform or a smaller "
        "spawn_radius"
    )


def _inside(point: tuple[float, float], grid: Grid, radius: float) -> bool:
    margin = radius + grid.cell / 2  # the last half cell leans towards the next patch
    sides = zip(point, grid.lower, grid.upper, strict=True)
    return all(low + margin <= p <= high - margin for p, low, high in sides)


def _height_range(
    heights: NDArray[np.float32], place: tuple[float, ...], reach: float
) -> tuple[float, float]:
    """Return the lowest and the highest sample that rule a point within `reach` of `place`."""
    spans = [
        (max(0, math.ceil(p - reach - 1)), min(n, math.floor(p + reach + 1) + 1))
        for p, n in zip(place, heights.shape, strict=True)
    ]
    square = heights[slice(*spans[0]), slice(*spans[1])]
    if square.min() != square.max():
        x, y = (np.arange(*span) - p for span, p in zip(spans, place, strict=True))
        square = square[_touches_disc(x[:, None], y[None, :], reach)]
    return float(square.min()), float(square.max())


def _touches_disc(
    x: NDArray[np.floating], y: NDArray[np.floating], reach: float
) -> NDArray[np.bool_]:
    """Return whether samples at these offsets rule a point of the disc of radius `reach`.

    A sample rules the four quads neighborhood it, so it counts if any point of that square, one sample
    to each side, is in the disc.
    """
    beyond_x, beyond_y = (np.clip(np.abs(offset) - 1, 0, None) for offset in (x, y))
    return np.asarray(beyond_x**2 + beyond_y**2 <= reach**2)


def _level_cells(heights: NDArray[np.float32], reach: float, tolerance: float) -> NDArray[np.int64]:
    """Return the cells whose whole disc is in the patch and level, shape (n, 2)."""
    import cv2

    margin = math.ceil(reach + 1)
    inner = tuple(n - 2 * margin for n in heights.shape)
    if min(inner) <= 0:
        return np.empty((0, 2), dtype=np.int64)
    low = np.full(inner, np.inf, dtype=np.float32)
    high = np.full(inner, -np.inf, dtype=np.float32)
    offsets = np.arange(-margin, margin + 1.0)
    # Row by row of the disc: OpenCV takes the extremes along a row in a time that does not grow
    # with its length, so the search takes the radius, not its square.
    for di in range(-margin, margin + 1):
        ruling = offsets[_touches_disc(np.array(float(di)), offsets, reach)]
        if not len(ruling):
            continue
        kernel = np.ones((1, len(ruling)), dtype=np.uint8)
        rows = np.ascontiguousarray(heights[margin + di : margin + di + inner[0]])
        span = slice(margin, margin + inner[1])
        np.minimum(low, cv2.erode(rows, kernel)[:, span], out=low)
        np.maximum(high, cv2.dilate(rows, kernel)[:, span], out=high)
    return np.argwhere(high - low <= tolerance) + margin

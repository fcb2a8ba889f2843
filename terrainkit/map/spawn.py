"""Find spawn positions on flat ground."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from terrainkit.geometry.free_space import CONTACT
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solid_index import SolidIndex
from terrainkit.geometry.solids import Solids
from terrainkit.geometry.surface import surface_at
from terrainkit.map.config import MapConfig


def find_spawn(
    config: MapConfig,
    grid: Grid,
    heights: NDArray[np.float32],
    solids: Solids,
    position: tuple[float, float],
) -> tuple[float, float, float] | None:
    """Return the spawn origin nearest to `position`.

    It is exactly at `position` if the ground there is flat and free, and else at the center of a
    cell.

    All samples that influence the surface within the disk of `spawn_radius` around the origin
    differ by at most `spawn_tolerance`, and no solid is above the disk within `spawn_headroom`. The
    disk is therefore flat, and no wall, step or obstacle reaches into it.

    Args:
        config: Configuration of the map.
        grid: Grid of the patch; the disk stays inside it.
        heights: Heights on `grid` [m], shape `grid.shape`.
        solids: Solids of the patch.
        position: Preferred spawn position, x and y [m].

    Returns:
        Origin (x, y, z) [m]; None if there is no such disk in the patch.
    """
    (x, y), (x0, y0) = position, grid.lower
    index = (x - x0) / grid.cell - 0.5, (y - y0) / grid.cell - 0.5
    if _is_inside(position, grid, config.spawn_radius):
        low, z = _height_range(heights, index, config.spawn_radius / grid.cell)
        if z - low <= config.spawn_tolerance:
            if low != z:
                # The disk is flat within the tolerance only: evaluate the surface at its center.
                surface = surface_at(heights, np.array([index]), threshold=config.wall_threshold)
                z = float(surface.height[0])
            if not len(solids) or _is_free(config, np.array([[x, y, z]]), solids)[0]:
                return x, y, z
    cells, origins = _free_disks(config, grid, heights, solids)
    if not len(cells):
        return None
    x, y, z = origins[np.argmin(((cells - index) ** 2).sum(axis=1))].tolist()
    return x, y, z


def sample_spawns(
    config: MapConfig,
    grid: Grid,
    heights: NDArray[np.float32],
    solids: Solids,
    origin: tuple[float, float, float],
    rng: Callable[[], np.random.Generator],
) -> NDArray[np.float64]:
    """Return up to `spawns_per_patch` spawn positions on the level ground around the origin.

    The positions are a Poisson-disk sample: random, and at least two disk radii apart, so that the
    disks do not overlap. Each is the center of a flat and free disk, and is connected to the origin
    by the centers of such disks. No position is therefore beyond an obstacle.

    Args:
        config: Configuration of the map.
        grid: Grid of the patch.
        heights: Heights on `grid` [m], shape `grid.shape`.
        solids: Solids of the patch.
        origin: Spawn origin of the patch [m], the first position.
        rng: Function that returns the random number generator. It is slow, so it is called only if
            needed.

    Returns:
        Positions (x, y, z) [m], shape (n, 3) with 1 <= n <= `spawns_per_patch`.
    """
    if config.spawns_per_patch == 1:
        return np.array([origin])
    from scipy.ndimage import label

    chosen = [np.array(origin)]
    cells, places = _free_disks(config, grid, heights, solids)
    is_free = np.zeros(grid.shape, dtype=bool)
    is_free[tuple(cells.T)] = True
    regions, _ = label(is_free)
    region = regions[tuple(cells.T)]
    # The ground is level between the origin and the center of a flat disk that contains it.
    contains_origin = np.hypot(*(places[:, :2] - chosen[0][:2]).T) <= config.spawn_radius
    places = rng().permutation(places[np.isin(region, region[contains_origin])])
    while len(chosen) < config.spawns_per_patch:
        distance = np.hypot(*(places[:, :2] - chosen[-1][:2]).T)
        places = places[distance >= 2 * config.spawn_radius]
        if not len(places):
            break
        chosen.append(places[0])
    return np.array(chosen)


def _free_disks(
    config: MapConfig, grid: Grid, heights: NDArray[np.float32], solids: Solids
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the cells with a flat and free disk, shape (n, 2), and their centers, (n, 3)."""
    cells = _flat_cells(heights, config.spawn_radius / grid.cell, config.spawn_tolerance)
    i, j = cells.T
    places = np.column_stack([grid.axis(0)[i], grid.axis(1)[j], heights[i, j]])
    is_free = _is_free(config, places, solids)
    return cells[is_free], places[is_free]


def _is_free(config: MapConfig, origins: NDArray[np.float64], solids: Solids) -> NDArray[np.bool_]:
    """Return whether no solid is above each disk within the headroom, shape (n,)."""
    if not len(origins) or not len(solids):
        return np.ones(len(origins), dtype=bool)
    # Most solids are far from the preferred position; the index of a few is made much faster.
    lower, upper = (corner[:, :2] for corner in solids.bounds())
    low, high = (f(origins[:, :2], axis=0) for f in (np.min, np.max))
    margin = config.spawn_radius + 1e-3
    solids = solids.select(((lower <= high + margin) & (upper >= low - margin)).all(axis=1))
    bounds = SolidIndex(solids, radius=config.spawn_radius).intervals(origins[:, :2])
    bottom, top = np.moveaxis(bounds, -1, 0)
    z = origins[:, 2:]
    is_blocked = (top > z + CONTACT) & (bottom < z + config.spawn_headroom)
    return np.asarray(~is_blocked.any(axis=1))


def _is_inside(point: tuple[float, float], grid: Grid, radius: float) -> bool:
    margin = radius + grid.cell / 2  # the last half cell slopes toward the next patch
    (x, y), (x0, y0), (x1, y1) = point, grid.lower, grid.upper
    return x0 + margin <= x <= x1 - margin and y0 + margin <= y <= y1 - margin


def _height_range(
    heights: NDArray[np.float32], index: tuple[float, ...], radius: float
) -> tuple[float, float]:
    """Return the lowest and highest sample that influence the surface of a disk [cells]."""
    spans = [
        (max(0, math.ceil(p - radius - 1)), min(n, math.floor(p + radius + 1) + 1))
        for p, n in zip(index, heights.shape, strict=True)
    ]
    square = heights[slice(*spans[0]), slice(*spans[1])]
    # The methods `min` and `max` take twice as long on a small array.
    low = float(np.minimum.reduce(square, axis=None))
    high = float(np.maximum.reduce(square, axis=None))
    if low == high:
        return low, high
    x, y = (np.arange(*span) - p for span, p in zip(spans, index, strict=True))
    square = square[_reaches_disk(x[:, None], y[None, :], radius)]
    return float(square.min()), float(square.max())


def _reaches_disk(
    x: NDArray[np.floating], y: NDArray[np.floating], radius: float
) -> NDArray[np.bool_]:
    """Return whether samples at these offsets [cells] influence the surface of the disk.

    A sample influences the four quads around it, so it counts if any point of that square, one
    sample to each side, is in the disk.
    """
    beyond_x, beyond_y = (np.clip(np.abs(offset) - 1, 0, None) for offset in (x, y))
    return np.asarray(beyond_x**2 + beyond_y**2 <= radius**2)


def _flat_cells(heights: NDArray[np.float32], radius: float, tolerance: float) -> NDArray[np.int64]:
    """Return the cells whose whole disk is flat and inside the patch, shape (n, 2)."""
    import cv2

    margin = math.ceil(radius + 1)
    inner = tuple(n - 2 * margin for n in heights.shape)
    if min(inner) <= 0:
        return np.empty((0, 2), dtype=np.int64)
    low = np.full(inner, np.inf, dtype=np.float32)
    high = np.full(inner, -np.inf, dtype=np.float32)
    offsets = np.arange(-margin, margin + 1.0)
    # OpenCV erodes a row in time independent of the kernel's length, so going through the disk row
    # by row costs time proportional to the radius, not to its square.
    for di in range(-margin, margin + 1):
        influential = offsets[_reaches_disk(np.array(float(di)), offsets, radius)]
        if not len(influential):
            continue
        kernel = np.ones((1, len(influential)), dtype=np.uint8)
        rows = np.ascontiguousarray(heights[margin + di : margin + di + inner[0]])
        span = slice(margin, margin + inner[1])
        np.minimum(low, cv2.erode(rows, kernel)[:, span], out=low)
        np.maximum(high, cv2.dilate(rows, kernel)[:, span], out=high)
    return np.argwhere(high - low <= tolerance) + margin

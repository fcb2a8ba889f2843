"""Find spawn positions on flat ground."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from terrainkit.geometry.free_space import CONTACT
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.ground_surface import surface_at
from terrainkit.geometry.solid_index import SolidIndex
from terrainkit.geometry.solids import Solids
from terrainkit.map.map_config import MapConfig

_DISKS_PER_BLOCK = 4096
"""Disks that are compared with the solids at once."""


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
    disk is therefore flat, and no wall, step or obstacle reaches into it. A disk with a radius of
    up to a cell needs only slopes that keep its heights within the tolerance.

    Args:
        config: Configuration of the map.
        grid: Grid of the patch; the disk stays inside it.
        heights: Heights on `grid` [m], shape `grid.shape`.
        solids: Solids of the patch.
        position: Preferred spawn position, x and y [m].

    Returns:
        Origin (x, y, z) [m]; None if there is no such disk in the patch.
    """
    if _is_inside(position, grid, config.spawn_radius):
        low, z, high = _heights_at(config, grid, heights, position)
        disk = np.array([[*position, low, high]])
        if high - low <= config.spawn_tolerance and _is_free(config, disk, solids)[0]:
            return *position, z
    cells, origins = _free_disks(config, grid, heights, solids)
    if not len(cells):
        return None
    index = _sample_index(grid, position)
    x, y, z = origins[np.argmin(((cells - index) ** 2).sum(axis=1))].tolist()
    return x, y, z


def flattest_tolerance(
    config: MapConfig,
    grid: Grid,
    heights: NDArray[np.float32],
    solids: Solids,
    position: tuple[float, float],
) -> float | None:
    """Return a `spawn_tolerance` with which `find_spawn` finds an origin.

    It is what the flattest free disk around the center of a cell needs. In a patch that is too
    small for such disks, it is what the disk around the preferred position needs.

    Args:
        config: Configuration of the map; its `spawn_tolerance` is not used.
        grid: Grid of the patch.
        heights: Heights on `grid` [m], shape `grid.shape`.
        solids: Solids of the patch.
        position: Preferred spawn position, x and y [m].

    Returns:
        Tolerance [m], rounded up to two digits; None if no disk within the patch is free of solids.
    """
    lows, highs = _height_ranges(config, grid, heights)
    spread = (highs - lows).ravel()
    order = np.argsort(spread, kind="stable")
    for start in range(0, len(order), _DISKS_PER_BLOCK):
        block = order[start : start + _DISKS_PER_BLOCK]
        disks = _disks(grid, lows, highs, np.unravel_index(block, lows.shape))[1]
        free = block[_is_free(config, disks, solids)]
        if len(free):
            return _rounded_up(float(spread[free[0]]))
    if _is_inside(position, grid, config.spawn_radius):
        low, _, high = _heights_at(config, grid, heights, position)
        if _is_free(config, np.array([[*position, low, high]]), solids)[0]:
            return _rounded_up(high - low)
    return None


def sample_spawns(
    config: MapConfig,
    grid: Grid,
    heights: NDArray[np.float32],
    solids: Solids,
    origin: tuple[float, float, float],
    rng: Callable[[], np.random.Generator],
    floors: tuple[float, ...] = (),
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
        floors: Heights of the floors of a building [m]. If there are any, positions are on all of
            them and anywhere on the ground.

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
    places = places[np.isin(region, region[contains_origin]) | bool(floors)]
    upper = [_floor_disks(config, grid, solids, z) for z in floors]
    places = rng().permutation(np.concatenate([places, *upper]))
    while len(chosen) < config.spawns_per_patch:
        distance = np.hypot(*(places[:, :2] - chosen[-1][:2]).T)
        places = places[distance >= 2 * config.spawn_radius]
        if not len(places):
            break
        chosen.append(places[0])
    return np.array(chosen)


def is_on_floor(config: MapConfig, solids: Solids, position: tuple[float, float, float]) -> bool:
    """Return whether a disk around a position is on solids, level and free.

    Args:
        config: Configuration of the map.
        solids: Solids of the patch.
        position: Center of the disk, x, y and z [m].
    """
    x, y, z = position
    angle = np.linspace(0.0, 2 * np.pi, 32, endpoint=False)
    circle = config.spawn_radius * np.column_stack([np.cos(angle), np.sin(angle)])
    disk = np.vstack([circle, 0 * circle]) + np.array([x, y])
    is_level = _is_supported(config, disk, solids, z)
    return bool(is_level.all() and _is_free(config, np.array([[x, y, z, z]]), solids)[0])


def _is_supported(
    config: MapConfig, xy: NDArray[np.float64], solids: Solids, z: float
) -> NDArray[np.bool_]:
    """Return at which points, shape (n, 2), the top of a solid is at a height [m]."""
    tops = SolidIndex(solids).intervals(xy)[..., 1]
    return np.asarray((np.abs(tops - z) <= config.spawn_tolerance).any(axis=1))


def _floor_disks(config: MapConfig, grid: Grid, solids: Solids, z: float) -> NDArray[np.float64]:
    """Return the centers of the cells with a level and free disk on solids at a height [m]."""
    from scipy.ndimage import distance_transform_edt

    xy = np.stack(np.meshgrid(grid.axis(0), grid.axis(1), indexing="ij"), axis=-1)
    is_level = _is_supported(config, xy.reshape(-1, 2), solids, z).reshape(grid.shape)
    # Samples beyond the disk are level as well, and so is the surface between two of them.
    reach = distance_transform_edt(np.pad(is_level, 1))[1:-1, 1:-1] * grid.cell
    xy = xy[reach > config.spawn_radius + grid.cell]
    disks = np.column_stack([xy, np.full((len(xy), 2), z)])
    return np.asarray(disks[_is_free(config, disks, solids), :3])


def _free_disks(
    config: MapConfig, grid: Grid, heights: NDArray[np.float32], solids: Solids
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the cells with a flat and free disk, shape (n, 2), and their centers, (n, 3)."""
    lows, highs = _height_ranges(config, grid, heights)
    cells, disks = _disks(grid, lows, highs, np.nonzero(highs - lows <= config.spawn_tolerance))
    is_free = _is_free(config, disks, solids)
    cells, disks = cells[is_free], disks[is_free]
    return cells, np.column_stack([disks[:, :2], heights[tuple(cells.T)]])


def _disks(
    grid: Grid,
    lows: NDArray[np.float32],
    highs: NDArray[np.float32],
    index: tuple[NDArray[np.int64], ...],
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the cells at an index into `_height_ranges`, shape (n, 2), and their disks, (n, 4)."""
    margin = (grid.shape[0] - lows.shape[0]) // 2
    cells = np.column_stack(index) + margin
    x, y = grid.axis(0)[cells[:, 0]], grid.axis(1)[cells[:, 1]]
    return cells, np.column_stack([x, y, lows[index], highs[index]])


def _is_free(config: MapConfig, disks: NDArray[np.float64], solids: Solids) -> NDArray[np.bool_]:
    """Return whether no solid is above each disk within the headroom, shape (n,).

    Args:
        config: Configuration of the map.
        disks: Center and lowest and highest ground of each disk, x, y, low, high [m], shape (n, 4).
        solids: Solids of the patch.
    """
    if not len(disks) or not len(solids):
        return np.ones(len(disks), dtype=bool)
    # Most solids are far from the preferred position; the index of a few is made much faster.
    centers, low, high = disks[:, :2], disks[:, 2:3], disks[:, 3:]
    lower, upper = (corner[:, :2] for corner in solids.bounds())
    first, last = (f(centers, axis=0) for f in (np.min, np.max))
    margin = config.spawn_radius + 1e-3
    solids = solids.select(((lower <= last + margin) & (upper >= first - margin)).all(axis=1))
    bounds = SolidIndex(solids, radius=config.spawn_radius).intervals(centers)
    bottom, top = np.moveaxis(bounds, -1, 0)
    is_blocked = (top > low + CONTACT) & (bottom < high + config.spawn_headroom)
    return np.asarray(~is_blocked.any(axis=1))


def _sample_index(grid: Grid, point: tuple[float, float]) -> tuple[float, float]:
    """Return a point in units of samples; (0, 0) is at the first sample."""
    (x, y), (x0, y0) = point, grid.lower
    return (x - x0) / grid.cell - 0.5, (y - y0) / grid.cell - 0.5


def _is_inside(point: tuple[float, float], grid: Grid, radius: float) -> bool:
    margin = radius + grid.cell / 2  # the last half cell slopes toward the next patch
    (x, y), (x0, y0), (x1, y1) = point, grid.lower, grid.upper
    return x0 + margin <= x <= x1 - margin and y0 + margin <= y <= y1 - margin


def _heights_at(
    config: MapConfig, grid: Grid, heights: NDArray[np.float32], point: tuple[float, float]
) -> tuple[float, float, float]:
    """Return the lowest height, the height at the center and the highest height of a disk [m]."""
    index, radius = _sample_index(grid, point), config.spawn_radius / grid.cell
    low, high = _height_range(heights, index, radius)
    if low == high:
        return low, high, high
    surface = surface_at(heights, np.array([index]), threshold=config.wall_threshold)
    z = float(surface.height[0])
    if radius <= 1:
        first = (max(0, math.floor(p - radius)) for p in index)
        last = (math.floor(p + radius) + 2 for p in index)
        quads = heights[tuple(map(slice, first, last))]
        rise = radius * float(_slopes(quads, config.wall_threshold).max(initial=0.0))
        low, high = max(low, z - rise), min(high, z + rise)
    return low, z, high


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


def _height_ranges(
    config: MapConfig, grid: Grid, heights: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the lowest and highest ground of the disk at each cell whose disk is inside [m].

    The arrays have the shape of the patch without the same number of cells at each edge.
    """
    import cv2

    radius = config.spawn_radius / grid.cell
    margin = math.ceil(radius + 1)
    inner = tuple(n - 2 * margin for n in heights.shape)
    if min(inner) <= 0:
        return np.empty((0, 0), np.float32), np.empty((0, 0), np.float32)
    # The disk is a union of rectangles, the widest of them the lowest, and OpenCV erodes by a
    # rectangle in time independent of its size.
    offsets = np.arange(margin + 1.0)
    width = [int(_reaches_disk(row, offsets, radius).sum()) for row in offsets[:, None]]
    inside = tuple(slice(margin, margin + n) for n in inner)
    heights = np.ascontiguousarray(heights)
    low, high = heights[inside].copy(), heights[inside].copy()
    for n in set(width) - {0}:
        rows = max(k for k, cells in enumerate(width) if cells == n)
        kernel = np.ones((2 * rows + 1, 2 * n - 1), dtype=np.uint8)
        np.minimum(low, cv2.erode(heights, kernel)[inside], out=low)
        np.maximum(high, cv2.dilate(heights, kernel)[inside], out=high)
    if radius <= 1:
        # The disk is within the four quads around the sample, and the margin is two cells.
        slopes = _slopes(heights, config.wall_threshold)[1:-1, 1:-1]
        along_x = np.maximum(slopes[:-1], slopes[1:])
        rise = np.float32(radius) * np.maximum(along_x[:, :-1], along_x[:, 1:])
        z = heights[inside]
        low, high = np.maximum(low, z - rise), np.minimum(high, z + rise)
    return low, high


def _slopes(heights: NDArray[np.float32], threshold: float) -> NDArray[np.float32]:
    """Return the steepest slope between four samples [m per cell], infinite at a wall.

    Args:
        heights: Samples [m], shape (nx, ny).
        threshold: Difference between neighboring samples above which there is a wall [m].

    Returns:
        Slopes, shape (nx - 1, ny - 1).
    """
    x, y = (np.abs(np.diff(heights, axis=axis)) for axis in (0, 1))
    # The quad is two triangles: the first has its lower edge and its right edge.
    slopes = np.maximum(np.hypot(x[:, :-1], y[1:]), np.hypot(x[:, 1:], y[:-1]))
    edges = np.maximum(np.maximum(x[:, :-1], x[:, 1:]), np.maximum(y[:-1], y[1:]))
    return np.where(edges > threshold, np.float32(np.inf), slopes)


def _rounded_up(value: float) -> float:
    """Return a number rounded up to two digits."""
    if not value:
        return value
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.ceil(value / unit) * unit:.12g}")

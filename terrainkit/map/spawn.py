"""Find spawn positions on flat ground."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.geometry.free_space import CONTACT
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.ground_surface import surface_at
from terrainkit.geometry.solid_index import SolidIndex
from terrainkit.geometry.solids import Solids
from terrainkit.geometry.walls import WallRule, wall_edges
from terrainkit.map.map_config import MapConfig

_DISKS_PER_BLOCK = 4096
"""Disks that are compared with the solids at once."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SpawnGround:
    """The ground of a patch, on which robots are spawned."""

    config: MapConfig
    """Configuration of the map, which has the size of a spawn disk and its tolerance."""

    grid: Grid
    """Grid of the patch; spawn disks stay inside it."""

    heights: NDArray[np.float32]
    """Heights on `grid` [m], shape `grid.shape`."""

    solids: Solids
    """Solids that reach into the patch."""

    holes: NDArray[np.bool_] | None = None
    """Samples that are no center of a disk, shape `grid.shape`; None for none."""

    walls: NDArray[np.uint8] | None = None
    """Which edges of the samples are walls, as in `TerrainMap.walls`, shape `grid.shape`."""

    @classmethod
    def of_map(
        cls,
        config: MapConfig,
        heights: NDArray[np.float32],
        solids: Solids,
        patch: tuple[int, int],
        walls: NDArray[np.uint8] | None = None,
    ) -> Self:
        """Return the ground of a patch of a map.

        Args:
            config: Configuration of the map.
            heights: Heights of the map [m].
            solids: Solids of the map.
            patch: Row and column of the patch.
            walls: Walls of the map, as in `TerrainMap.walls`.
        """
        grid, cells = config.patch_grid(*patch), config.patch_cells(*patch)
        lower, upper = (corner[:, :2] for corner in solids.bounds())
        reaches = np.all((upper >= grid.lower) & (lower <= grid.upper), axis=1)
        return cls(
            config=config,
            grid=grid,
            heights=heights[cells],
            solids=solids.select(np.asarray(reaches)),
            walls=None if walls is None else walls[cells],
        )

    def nearest_flat(self, position: tuple[float, float]) -> tuple[float, float, float] | None:
        """Return the spawn origin nearest to `position`.

        It is exactly at `position` if the ground there is flat and free, and else at the center of
        a cell.

        All samples that influence the surface within the disk of `spawn_radius` around the origin
        differ by at most `spawn_tolerance`, and no solid is above the disk within `spawn_headroom`.
        The disk is therefore flat, and no wall, step or obstacle reaches into it. A disk with a
        radius of up to a cell needs only slopes that keep its heights within the tolerance.

        Args:
            position: Preferred spawn position, x and y [m].

        Returns:
            Origin (x, y, z) [m]; None if there is no such disk in the patch.
        """
        if self._contains_disk(position):
            low, z, high = self._heights_at(position)
            disk = np.array([[*position, low, high]])
            if high - low <= self.config.spawn_tolerance and self._is_free(disk)[0]:
                return *position, z
        cells, origins = self._free_disks()
        if not len(cells):
            return None
        index = _sample_index(self.grid, position)
        x, y, z = origins[np.argmin(((cells - index) ** 2).sum(axis=1))].tolist()
        return x, y, z

    def find_origin(self, name: str, position: tuple[float, float]) -> tuple[float, float, float]:
        """Return the spawn origin of a patch [m]; see `nearest_flat`.

        Args:
            name: Name of the patch, for the error.
            position: Preferred position, x and y [m].

        Returns:
            Position on the ground, x, y and z [m].

        Raises:
            ConfigError: if patch `name` has no place to spawn.
        """
        config = self.config
        grid = self.grid
        origin = self.nearest_flat(position)
        if origin is None:
            tolerance = self.flattest_tolerance(position)
            largest = 0.45 * (min(grid.shape) - 1) * grid.cell
            if tolerance is not None:
                expected = (
                    f"spawn_tolerance {tolerance:g}, a larger platform or a smaller spawn_radius"
                )
            else:
                expected = (
                    f"larger patches, less spawn_headroom or a spawn_radius below {largest:.2g} m"
                )
                if self.holes is not None and self.holes.any():
                    expected += ", or hole_depth 0: no robot starts in a hole"
            raise ConfigError(
                f"{name}: no disk of radius {config.spawn_radius:g} m is flat within "
                f"{config.spawn_tolerance:g} m and free of solids up to "
                f"{config.spawn_headroom:g} m in a patch of {grid.extent}; expected {expected}"
            )
        return origin

    def flattest_tolerance(self, position: tuple[float, float]) -> float | None:
        """Return a `spawn_tolerance` with which `nearest_flat` finds an origin.

        It is what the flattest free disk around the center of a cell needs. In a patch that is too
        small for such disks, it is what the disk around the preferred position needs.

        Args:
            position: Preferred spawn position, x and y [m].

        Returns:
            Tolerance [m], rounded up to two digits; None if no disk within the patch is free of
            solids.
        """
        lows, highs = self._height_ranges()
        spread = (highs - lows).ravel()
        order = np.argsort(spread, kind="stable")
        for start in range(0, len(order), _DISKS_PER_BLOCK):
            block = order[start : start + _DISKS_PER_BLOCK]
            disks = self._disks(lows, highs, np.unravel_index(block, lows.shape))[1]
            free = block[self._is_free(disks)]
            if len(free):
                return _rounded_up(float(spread[free[0]]))
        if self._contains_disk(position):
            low, _, high = self._heights_at(position)
            if self._is_free(np.array([[*position, low, high]]))[0]:
                return _rounded_up(high - low)
        return None

    def sample(
        self,
        origin: tuple[float, float, float],
        rng: Callable[[], np.random.Generator],
        floors: tuple[float, ...] = (),
    ) -> NDArray[np.float64]:
        """Return up to `spawns_per_patch` spawn positions on the level ground around the origin.

        The positions are a Poisson-disk sample: random, and at least two disk radii apart, so that
        the disks do not overlap. Each is the center of a flat and free disk, and is connected to
        the origin by the centers of such disks. No position is therefore beyond an obstacle.

        Args:
            origin: Spawn origin of the patch [m], the first position.
            rng: Function that returns the random number generator. It is slow, so it is called only
                if needed.
            floors: Heights of the floors of a building [m]. If there are any, positions are on all
                of them and anywhere on the ground.

        Returns:
            Positions (x, y, z) [m], shape (n, 3) with 1 <= n <= `spawns_per_patch`.
        """
        if self.config.spawns_per_patch == 1:
            return np.array([origin])
        from scipy.ndimage import label

        chosen = [np.array(origin)]
        cells, places = self._free_disks()
        is_free = np.zeros(self.grid.shape, dtype=bool)
        is_free[tuple(cells.T)] = True
        regions, _ = label(is_free)
        region = regions[tuple(cells.T)]
        # The ground is level between the origin and the center of a flat disk that contains it.
        contains_origin = np.hypot(*(places[:, :2] - chosen[0][:2]).T) <= self.config.spawn_radius
        places = places[np.isin(region, region[contains_origin]) | bool(floors)]
        upper = [self._floor_disks(z) for z in floors]
        places = rng().permutation(np.concatenate([places, *upper]))
        while len(chosen) < self.config.spawns_per_patch:
            distance = np.hypot(*(places[:, :2] - chosen[-1][:2]).T)
            places = places[distance >= 2 * self.config.spawn_radius]
            if not len(places):
                break
            chosen.append(places[0])
        return np.array(chosen)

    def is_on_floor(self, position: tuple[float, float, float]) -> bool:
        """Return whether a disk around a position is on solids, level and free.

        Args:
            position: Center of the disk, x, y and z [m].
        """
        x, y, z = position
        angle = np.linspace(0.0, 2 * np.pi, 32, endpoint=False)
        circle = self.config.spawn_radius * np.column_stack([np.cos(angle), np.sin(angle)])
        disk = np.vstack([circle, 0 * circle]) + np.array([x, y])
        is_level = self._is_supported(disk, z)
        return bool(is_level.all() and self._is_free(np.array([[x, y, z, z]]))[0])

    def _is_supported(self, xy: NDArray[np.float64], z: float) -> NDArray[np.bool_]:
        """Return at which points, shape (n, 2), the top of a solid is at a height [m]."""
        tops = SolidIndex(self.solids).intervals(xy)[..., 1]
        return np.asarray((np.abs(tops - z) <= self.config.spawn_tolerance).any(axis=1))

    def _floor_disks(self, z: float) -> NDArray[np.float64]:
        """Return the centers of the cells with a level and free disk on solids at a height [m]."""
        from scipy.ndimage import distance_transform_edt

        grid = self.grid
        xy = np.stack(np.meshgrid(grid.axis(0), grid.axis(1), indexing="ij"), axis=-1)
        is_level = self._is_supported(xy.reshape(-1, 2), z).reshape(grid.shape)
        # Samples beyond the disk are level as well, and so is the surface between two of them.
        reach = distance_transform_edt(np.pad(is_level, 1))[1:-1, 1:-1] * grid.cell
        xy = xy[reach > self.config.spawn_radius + grid.cell]
        disks = np.column_stack([xy, np.full((len(xy), 2), z)])
        return np.asarray(disks[self._is_free(disks), :3])

    def _free_disks(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return the cells with a flat and free disk, shape (n, 2), and their centers, (n, 3)."""
        lows, highs = self._height_ranges()
        is_flat = highs - lows <= self.config.spawn_tolerance
        cells, disks = self._disks(lows, highs, np.nonzero(is_flat))
        is_free = self._is_free(disks)
        cells, disks = cells[is_free], disks[is_free]
        return cells, np.column_stack([disks[:, :2], self.heights[tuple(cells.T)]])

    def _disks(
        self,
        lows: NDArray[np.float32],
        highs: NDArray[np.float32],
        index: tuple[NDArray[np.int64], ...],
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return the cells at an index into `_height_ranges`, and their disks.

        Returns:
            Cells, shape (n, 2), and disks as in `_is_free`, shape (n, 4).
        """
        grid = self.grid
        margin = (grid.shape[0] - lows.shape[0]) // 2
        cells = np.column_stack(index) + margin
        x, y = grid.axis(0)[cells[:, 0]], grid.axis(1)[cells[:, 1]]
        return cells, np.column_stack([x, y, lows[index], highs[index]])

    def _is_free(self, disks: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return whether each disk is on ground, and no solid is within the headroom, shape (n,).

        Args:
            disks: Center and lowest and highest ground of each disk, x, y, low, high [m], shape
                (n, 4).
        """
        solids, radius = self.solids, self.config.spawn_radius
        is_ground = np.ones(len(disks), dtype=bool)
        if self.holes is not None:
            cells = np.floor((disks[:, :2] - self.grid.lower) / self.grid.cell).astype(int)
            is_ground = ~self.holes[tuple(cells.T)]
        if not len(disks) or not len(solids):
            return is_ground
        # Most solids are far from the preferred position; the index of a few is made much faster.
        centers, low, high = disks[:, :2], disks[:, 2:3], disks[:, 3:]
        lower, upper = (corner[:, :2] for corner in solids.bounds())
        first, last = (f(centers, axis=0) for f in (np.min, np.max))
        margin = radius + 1e-3
        solids = solids.select(((lower <= last + margin) & (upper >= first - margin)).all(axis=1))
        bounds = SolidIndex(solids, radius=radius).intervals(centers)
        bottom, top = np.moveaxis(bounds, -1, 0)
        is_blocked = (top > low + CONTACT) & (bottom < high + self.config.spawn_headroom)
        return np.asarray(is_ground & ~is_blocked.any(axis=1))

    def _contains_disk(self, point: tuple[float, float]) -> bool:
        """Return whether the spawn disk around a point is inside the patch."""
        grid = self.grid
        margin = (
            self.config.spawn_radius + grid.cell / 2
        )  # the last half cell slopes toward the next patch
        (x, y), (x0, y0), (x1, y1) = point, grid.lower, grid.upper
        return x0 + margin <= x <= x1 - margin and y0 + margin <= y <= y1 - margin

    @property
    def _wall_rule(self) -> WallRule:
        return self.config.wall_threshold if self.walls is None else self.walls

    def _heights_at(self, point: tuple[float, float]) -> tuple[float, float, float]:
        """Return the lowest height of a disk, the height at its center and the highest [m]."""
        heights, rule = self.heights, self._wall_rule
        index, radius = _sample_index(self.grid, point), self.config.spawn_radius / self.grid.cell
        low, high = _height_range(heights, index, radius)
        if low == high:
            return low, high, high
        surface = surface_at(heights, np.array([index]), rule=rule)
        z = float(surface.height[0])
        if radius <= 1:
            first = (max(0, math.floor(p - radius)) for p in index)
            last = (math.floor(p + radius) + 2 for p in index)
            quads = tuple(map(slice, first, last))
            own = rule[quads] if isinstance(rule, np.ndarray) else rule
            rise = radius * float(_slopes(heights[quads], own).max(initial=0.0))
            low, high = max(low, z - rise), min(high, z + rise)
        return low, z, high

    def _height_ranges(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the lowest and highest ground of the disk at each cell whose disk is inside [m].

        The arrays have the shape of the patch without the same number of cells at each edge.
        """
        import cv2

        radius = self.config.spawn_radius / self.grid.cell
        heights = self.heights
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
            slopes = _slopes(heights, self._wall_rule)[1:-1, 1:-1]
            along_x = np.maximum(slopes[:-1], slopes[1:])
            rise = np.float32(radius) * np.maximum(along_x[:, :-1], along_x[:, 1:])
            z = heights[inside]
            low, high = np.maximum(low, z - rise), np.minimum(high, z + rise)
        return low, high


def _sample_index(grid: Grid, point: tuple[float, float]) -> tuple[float, float]:
    """Return a point in units of samples; (0, 0) is at the first sample."""
    (x, y), (x0, y0) = point, grid.lower
    return (x - x0) / grid.cell - 0.5, (y - y0) / grid.cell - 0.5


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


def _slopes(heights: NDArray[np.float32], rule: WallRule) -> NDArray[np.float32]:
    """Return the steepest slope between four samples [m per cell], infinite at a wall.

    Args:
        heights: Samples [m], shape (nx, ny).
        rule: Which edges between neighboring samples are walls.

    Returns:
        Slopes, shape (nx - 1, ny - 1).
    """
    x, y = (np.abs(np.diff(heights, axis=axis)) for axis in (0, 1))
    # The quad is two triangles: the first has its lower edge and its right edge.
    slopes = np.maximum(np.hypot(x[:, :-1], y[1:]), np.hypot(x[:, 1:], y[:-1]))
    walls_x, walls_y = wall_edges(heights, rule)
    has_wall = walls_x[:, :-1] | walls_x[:, 1:] | walls_y[:-1] | walls_y[1:]
    return np.where(has_wall, np.float32(np.inf), slopes)


def _rounded_up(value: float) -> float:
    """Return a number rounded up to two digits."""
    if not value:
        return value
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.ceil(value / unit) * unit:.12g}")

"""EdgeMap: the distance to the nearest edge of a step, and where a foot can stand."""

import math

import numpy as np

from terrainkit.curriculum.arrays import Array, like
from terrainkit.files.memory import check_memory
from terrainkit.geometry.solid_raster import PIXEL
from terrainkit.map.terrain_map import TerrainMap
from terrainkit.perception.height_scan import exact_surface, to_floats, to_number

_MAX_SLOPE = 0.75
"""Slope of ground that is not a step, where the map has no threshold, as in legged_gym."""

_ROWS = 64


class EdgeMap:
    """The distance to the nearest edge, in every direction, on a grid over a map.

    An edge is where the surface rises or falls by more than a height within half a cell. Walls of
    the ground are exact; edges of solids are within 2.5 cm.
    """

    def __init__(
        self, terrain_map: TerrainMap, *, step_height: float = 0.05, headroom: float = 1.0
    ) -> None:
        """Find the edges, and measure the distances.

        Args:
            terrain_map: The map.
            step_height: Lowest step with an edge [m].
            headroom: The surface of a solid that begins higher than this above the ground is not
                part of the surface: robots walk under it [m].

        Raises:
            ConfigError: if a height is below 1 mm.
            MemoryLimitError: if the grid would not fit in memory.
        """
        import cv2

        to_number("step_height", step_height, 1e-3)
        to_number("headroom", headroom, 1e-3)
        surface = exact_surface(terrain_map)
        grid = terrain_map.grid
        per_cell = 2 if surface.visible is None else 2 * math.ceil(grid.cell / 2 / PIXEL - 1e-9)
        self._spacing, self._lower = grid.cell / per_cell, np.array(grid.lower)
        shape = tuple(per_cell * n for n in grid.shape)
        check_memory(9 * math.prod(shape), f"an edge map of {shape[0]} x {shape[1]} points")
        x, y = (
            (grid.lower[k] + (np.arange(shape[k]) + 0.5) * self._spacing).astype(np.float32)
            for k in (0, 1)
        )
        slope = terrain_map.config.slope_threshold or _MAX_SLOPE
        limit = max(step_height, slope * self._spacing)
        # Corners of the pixels; the steps between two pixels touch both corners between them.
        is_free = np.ones((shape[0] + 1, shape[1] + 1), np.uint8)
        for k in range(0, shape[0], _ROWS):
            column, row = np.meshgrid(x[k : k + _ROWS + 1], y, indexing="ij")
            ground = surface.ground_height(column, row)
            z = surface.height(column, row, ground + np.float32(headroom), scan=True)
            for axis in (0, 1):
                i, j = np.nonzero(np.abs(np.diff(z, axis=axis)) > limit)
                i, j = (i + 1, j) if axis == 0 else (i, j + 1)
                is_free[k + i, j] = is_free[k + i + axis, j + 1 - axis] = 0
        self.has_edges = not is_free.all()
        self.distances = cv2.distanceTransform(is_free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        self.distances *= np.float32(self._spacing)

    def distance(self, xy: Array) -> Array:
        """Return the horizontal distance to the nearest edge [m], inf on a map without edges.

        Args:
            xy: Points [m], shape (..., 2). Beyond the map, the distance at its edge applies.

        Returns:
            Distances [m], shape (...), single precision.

        Raises:
            ConfigError: if the shape is wrong, or a value is not finite.
        """
        points = to_floats("xy", xy, [*np.shape(xy)[:-1], 2])
        if not self.has_edges:
            return like(np.full(points.shape[:-1], np.inf, np.float32), xy)
        limit = np.array(self.distances.shape) - 1
        index = np.clip((points - self._lower) / self._spacing, 0, limit)
        low = np.minimum(index.astype(np.int64), limit - 1)
        u, v = np.moveaxis(index - low, -1, 0)
        corner, flat = low[..., 0] * (limit[1] + 1) + low[..., 1], self.distances.reshape(-1)
        first, second = (
            flat.take(start) * (1 - v) + flat.take(start + 1) * v
            for start in (corner, corner + limit[1] + 1)
        )
        return like((first * (1 - u) + second * u).astype(np.float32), xy)

    def is_foothold(self, xy: Array, radius: float = 0.03) -> Array:
        """Return where a foot is on one surface: no edge is within its radius.

        Args:
            xy: Centers of feet [m], shape (..., 2).
            radius: Radius of a foot [m].

        Returns:
            Mask, shape (...).

        Raises:
            ConfigError: if the shape is wrong, a value is not finite, or the radius is negative.
        """
        is_clear: Array = self.distance(xy) >= to_number("radius", radius, 0.0)
        return is_clear

"""SolidRaster: solids sampled on a fine grid, for fast height scans of many robots."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.files.memory import check_memory
from terrainkit.geometry.solid_index import SolidIndex
from terrainkit.geometry.solids import Solids, rotation_matrices

PIXEL = 0.025
"""Distance between two samples [m]; an edge is off by at most half of it."""
PIXELS_PER_BAND = 500_000
"""Number of pixels that are sampled at once, to bound the memory."""
_TILT = 1e-12
"""Largest difference between 1 and the z component of the axis of a level solid."""


class SolidRaster:
    """Bottom and top of the solids at each sample.

    Looking up a point is a table access, while `SolidIndex` computes the intersection with
    each solid.
    """

    def __init__(self, solids: Solids, *, exact: bool = False) -> None:
        """Sample solids on a grid of pixels of side `PIXEL`.

        Args:
            solids: The solids.
            exact: Compute the intersections in pixels in which a solid ends, or is not level.

        Raises:
            MemoryLimitError: if the samples would not fit in memory.
        """
        corners = np.stack(solids.bounds())[..., :2]
        self._corner = corners[0].min(axis=0, initial=0.0)
        extent = corners[1].max(axis=0, initial=0.0) - self._corner
        self._shape = np.ceil(extent / PIXEL).astype(np.int64) + 1
        pixels_total = int(self._shape.prod())
        check_memory(pixels_total * 5, f"a height scan of solids with {pixels_total} pixels")
        self._index = SolidIndex(solids)
        self._row = np.zeros(self._shape, dtype=np.int32)
        pixels = np.flatnonzero(self._covered(corners))
        is_mixed = self._mixed(solids, corners, pixels) if exact else np.zeros(len(pixels), bool)
        self._row.put(pixels[is_mixed], -1)
        pixels = pixels[~is_mixed]
        tables = [np.empty((1, 0, 2), np.float32)]  # Row 0 of the table has no solids.
        num_rows = 1
        for start in range(0, len(pixels), PIXELS_PER_BAND):
            band = pixels[start : start + PIXELS_PER_BAND]
            bounds = self._index.intervals(self._centers(band)).astype(np.float32)
            rows, row = _distinct(bounds)
            self._row.put(band, num_rows + row)
            num_rows += len(rows)
            tables.append(rows)
        most = max(table.shape[1] for table in tables)
        self._bounds = np.concatenate([_padded(table, most) for table in tables])

    def _centers(self, pixels: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the centers of pixels with these raveled indices [m], shape (n, 2)."""
        places = np.stack(np.divmod(pixels, self._shape[1]), axis=1)
        return np.asarray(self._corner + (places + 0.5) * PIXEL)

    def _mixed(
        self, solids: Solids, corners: NDArray[np.float64], pixels: NDArray[np.int64]
    ) -> NDArray[np.bool_]:
        """Return the pixels in which a solid ends, or is not level."""
        level = _is_level(solids)
        is_mixed = self._covered(corners[:, ~level]).take(pixels)
        radius = 0.5001 * 2**0.5 * PIXEL
        touch = SolidIndex(solids, radius=radius)
        fill = SolidIndex(solids.select(level), radius=-radius)
        rest = np.flatnonzero(~is_mixed)
        for start in range(0, len(rest), PIXELS_PER_BAND):
            band = rest[start : start + PIXELS_PER_BAND]
            centers = self._centers(pixels[band])
            is_mixed[band] = touch.count(centers) != fill.count(centers)
        return is_mixed

    def _covered(self, corners: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return the pixels that bounding boxes overlap.

        Args:
            corners: Lower and upper corners [m], shape (2, n, 2).
        """
        covered = np.zeros(self._shape, dtype=bool)
        first = np.floor((corners[0] - self._corner) / PIXEL).astype(np.int64)
        last = np.ceil((corners[1] - self._corner) / PIXEL).astype(np.int64)
        for (i0, j0), (i1, j1) in zip(first, last, strict=True):
            covered[i0 : i1 + 1, j0 : j1 + 1] = True
        return covered

    def bounds(
        self, x: NDArray[np.floating], y: NDArray[np.floating]
    ) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
        """Return the solids above and below points.

        Args:
            x: Points along x [m], of any shape.
            y: Points along y [m], of the same shape.

        Returns:
            Indices of the m points with solids in the raveled arrays, shape (m,), and bottom and
            top of each solid there [m], padded with NaN, shape (m, k, 2).
        """
        x, y = x.ravel(), y.ravel()
        i = ((x - self._corner[0]) / PIXEL).astype(np.int64)
        j = ((y - self._corner[1]) / PIXEL).astype(np.int64)
        # The conversion to integers rounds toward 0, so the lower bound is checked before it.
        above = (x >= self._corner[0]) & (y >= self._corner[1])
        inside = above & (i < self._shape[0]) & (j < self._shape[1])
        row = self._row.reshape(-1).take((i * self._shape[1] + j) * inside) * inside
        hit = np.flatnonzero(row)
        row = row.take(hit)
        bounds = self._bounds.take(np.maximum(row, 0), axis=0)
        mixed = np.flatnonzero(row < 0)
        if len(mixed):
            points = np.stack([x.take(hit[mixed]), y.take(hit[mixed])], axis=1).astype(float)
            exact = self._index.intervals(points)
            bounds = _padded(bounds, exact.shape[1])
            bounds[mixed, : exact.shape[1]] = exact
        return hit, bounds

    def top(
        self, x: NDArray[np.float32], y: NDArray[np.float32], z: NDArray[np.float32] | float
    ) -> NDArray[np.float32]:
        """Return the highest top of the solids whose bottom is at `z` or below.

        A robot at height `z` passes under the other solids; these it has to climb or to avoid.

        Args:
            x: Points along x [m].
            y: Points along y [m].
            z: Height of the robot at each point [m]; x, y and z are broadcast.

        Returns:
            Heights [m], of the broadcast shape; -inf without such a solid.
        """
        hit, bounds, z, result = self._lookup(x, y, z, -np.inf)
        reached = bounds[..., 0] <= z
        result.put(hit, np.max(bounds[..., 1], axis=1, where=reached, initial=-np.inf))
        return result

    def ceiling(
        self, x: NDArray[np.float32], y: NDArray[np.float32], z: NDArray[np.float32] | float
    ) -> NDArray[np.float32]:
        """Return the lowest bottom of the solids whose bottom is above `z`; inf without one.

        Args:
            x: Points along x [m].
            y: Points along y [m].
            z: Height of the robot at each point [m]; x, y and z are broadcast.
        """
        hit, bounds, z, result = self._lookup(x, y, z, np.inf)
        beyond = bounds[..., 0] > z
        result.put(hit, np.min(bounds[..., 0], axis=1, where=beyond, initial=np.inf))
        return result

    def _lookup(self, x: Any, y: Any, z: Any, fill: float) -> tuple[NDArray[Any], ...]:
        """Return points with solids, their bounds, their z, and a result for all points."""
        x, y, z = np.broadcast_arrays(x, y, z)
        hit, bounds = self.bounds(x, y)
        return hit, bounds, z.ravel().take(hit)[:, None], np.full(x.shape, fill, np.float32)


class PatchRasters(SolidRaster):
    """The solids of equal patches side by side, each of which can be replaced."""

    def __init__(
        self, corner: tuple[float, float], size: tuple[float, float], shape: tuple[int, int]
    ) -> None:
        """Start without solids.

        Args:
            corner: Lower corner of patch (0, 0) [m].
            size: Size of a patch, of which its solids are inside [m].
            shape: Number of patches along x and y.
        """
        self._corner, self._size, self._places = np.array(corner), np.array(size), shape
        self._shape = np.ceil(self._size * shape / PIXEL).astype(np.int64) + 1
        self._row = np.zeros(self._shape, np.int32)
        # Row k of a patch is row k * number of patches + patch here; rows 0 have no solids.
        self._bounds = np.full((shape[0] * shape[1], 0, 2), np.nan, np.float32)

    def replace(self, patch: int, raster: SolidRaster | None) -> None:
        """Replace the solids of a patch.

        Args:
            patch: Number of the patch; the index along y changes fastest.
            raster: Its solids, at the place of patch (0, 0); None for none.
        """
        offset = self._size * np.divmod(patch, self._places[1])
        first = np.rint(np.array([offset, offset + self._size]) / PIXEL).astype(np.int64)
        block = self._row[first[0, 0] : first[1, 0], first[0, 1] : first[1, 1]]
        block[:] = 0
        if raster is None:
            return
        number, table = self._places[0] * self._places[1], raster._bounds
        more = max(0, len(table) * number - len(self._bounds))
        layers = max(0, table.shape[1] - self._bounds.shape[1])
        grown = ((0, more), (0, layers), (0, 0))
        if more or layers:
            self._bounds = np.pad(self._bounds, grown, constant_values=np.nan)
        own = self._bounds[patch::number]
        own[:] = np.nan
        own[: len(table), : table.shape[1]] = table
        i, j = np.rint((raster._corner - self._corner) / PIXEL).astype(np.int64)
        rows = raster._row
        rows = np.where(rows > 0, rows * number + patch, 0)
        block[i : i + len(rows), j : j + rows.shape[1]] = rows


def _is_level(solids: Solids) -> NDArray[np.bool_]:
    """Return the boxes and cylinders whose top and bottom are level, as a mask of all solids."""
    shapes = np.concatenate([solids.boxes, solids.cylinders]).astype(float)
    upward = np.abs(rotation_matrices(shapes[:, 6:])[:, 2])
    is_box = np.arange(len(shapes)) < len(solids.boxes)
    level = np.where(is_box, upward.max(axis=1, initial=0.0), upward[:, 2]) > 1 - _TILT
    return np.append(level, np.zeros(len(solids.hull_counts), bool))


def _padded(bounds: NDArray[np.float32], number: int) -> NDArray[np.float32]:
    """Return bounds of at least `number` solids, padded with NaN, which compares as False."""
    more = max(0, number - bounds.shape[1])
    return np.pad(bounds, ((0, 0), (0, more), (0, 0)), constant_values=np.nan)


def _distinct(
    bounds: NDArray[np.float32],
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Return the distinct rows of `bounds`, and the row of each pixel among them.

    Pixels on a floor have the same bounds, so that the table of a building is small.
    """
    bits = bounds.reshape(len(bounds), -1).view(np.int32)  # NaN is not equal to itself
    starts = np.ones(len(bits), dtype=bool)
    starts[1:] = (bits[1:] != bits[:-1]).any(axis=1)
    runs, row = np.unique(bits[starts], axis=0, return_inverse=True)
    rows = runs.view(np.float32).reshape(-1, *bounds.shape[1:])
    return rows, row.reshape(-1)[np.cumsum(starts) - 1]

"""SolidRaster: solids sampled on a fine grid, for fast height scans of many robots."""

import numpy as np
from numpy.typing import NDArray

from terrainkit.files.memory import check_memory
from terrainkit.geometry.solid_index import SolidIndex
from terrainkit.geometry.solids import Solids

PIXEL = 0.025
"""Distance between two samples [m]; an edge is off by at most half of it."""


class SolidRaster:
    """Bottom and top of the solids at each sample.

    Looking up a point is a table access, while :class:`.SolidIndex` computes the intersection with
    each solid.
    """

    def __init__(self, solids: Solids) -> None:
        """Sample solids on a grid of pixels of side `PIXEL`.

        Args:
            solids: The solids.

        Raises:
            MemoryLimitError: if the samples would not fit in memory.
        """
        lower, upper = (corners[:, :2] for corners in solids.bounds())
        self._corner = lower.min(axis=0, initial=0.0)
        extent = upper.max(axis=0, initial=0.0) - self._corner
        self._shape = np.ceil(extent / PIXEL).astype(np.int64) + 1
        pixels_total = int(self._shape.prod())
        check_memory(pixels_total * 5, f"a height scan of solids with {pixels_total} pixels")
        covered = np.zeros(self._shape, dtype=bool)
        first = np.floor((lower - self._corner) / PIXEL).astype(np.int64)
        last = np.ceil((upper - self._corner) / PIXEL).astype(np.int64)
        for (i0, j0), (i1, j1) in zip(first, last, strict=True):
            covered[i0 : i1 + 1, j0 : j1 + 1] = True
        pixels = np.argwhere(covered)
        bounds = SolidIndex(solids).intervals(self._corner + (pixels + 0.5) * PIXEL)
        # Row 0 of the table has no solids; NaN compares as False.
        self._bounds = np.full((len(pixels) + 1, *bounds.shape[1:]), np.nan, dtype=np.float32)
        self._bounds[1:] = bounds
        self._row = np.zeros(self._shape, dtype=np.int32)
        self._row[tuple(pixels.T)] = np.arange(1, len(pixels) + 1)

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
        i = ((x - self._corner[0]) / PIXEL).astype(np.int64)
        j = ((y - self._corner[1]) / PIXEL).astype(np.int64)
        # The conversion to integers rounds toward 0, so the lower bound is checked before it.
        above = (x >= self._corner[0]) & (y >= self._corner[1])
        inside = above & (i < self._shape[0]) & (j < self._shape[1])
        row = self._row[np.where(inside, i, 0), np.where(inside, j, 0)] * inside
        result = np.full(np.broadcast_shapes(row.shape, np.shape(z)), -np.inf, dtype=np.float32)
        hit = np.broadcast_to(row > 0, result.shape)
        bottom, top = np.moveaxis(self._bounds[np.broadcast_to(row, result.shape)[hit]], -1, 0)
        reached = bottom <= np.broadcast_to(z, result.shape)[hit][:, None]
        result[hit] = np.max(top, axis=1, where=reached, initial=-np.inf)
        return result

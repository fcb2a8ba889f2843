"""Rectangles of coplanar quads."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

import numpy as np

from terrainkit.geometry.mesh.node_grid import NodeGrid
from terrainkit.geometry.mesh.polygons import Ids, Mask, Polygons, runs
from terrainkit.geometry.segments import segment_indices

_BLOCK = 1 << 10


@dataclass(frozen=True, kw_only=True, eq=False)
class Rectangles:
    """Rectangles between the nodes (i0, j0) and (i1, j1), each array of shape (n,)."""

    i0: Ids
    i1: Ids
    j0: Ids
    j1: Ids

    @classmethod
    def flat(cls, flat: Mask) -> Self:
        """Return rectangles of flat quads.

        Args:
            flat: Mask of the flat quads. It is cleared where a rectangle would be too small.
        """
        row, start, stop = runs(flat)
        # Runs over the same columns in consecutive rows are one rectangle.
        order = np.lexsort((row, stop, start))
        row, start, stop = row[order], start[order], stop[order]
        first = np.ones(len(row), dtype=bool)
        first[1:] = (np.diff(start) != 0) | (np.diff(stop) != 0) | (np.diff(row) != 1)
        last = np.roll(first, -1)
        i0, i1, j0, j1 = row[first], row[last] + 1, start[first], stop[first]
        small = (i1 - i0) * (j1 - j0) < 3
        flat[i0[small], j0[small]] = flat[i1[small] - 1, j1[small] - 1] = False
        return cls(i0=i0[~small], i1=i1[~small], j0=j0[~small], j1=j1[~small])

    @classmethod
    def along_y(cls, tilted: Mask) -> Self:
        """Return rows of quads that slope along x only.

        Args:
            tilted: Mask of such quads. It is cleared where a row would be too short.
        """
        row, start, stop = runs(tilted)
        small = stop - start < 3
        tilted[row[small], start[small]] = tilted[row[small], stop[small] - 1] = False
        row, start, stop = row[~small], start[~small], stop[~small]
        return cls(i0=row, i1=row + 1, j0=start, j1=stop)

    @classmethod
    def along_x(cls, tilted: Mask) -> Self:
        """Return rows of quads that slope along y only, like `along_y`."""
        rows = cls.along_y(tilted.T)
        return cls(i0=rows.j0, i1=rows.j1, j0=rows.i0, j1=rows.i1)

    def keep_corners(self, kept: Mask) -> None:
        """Mark the nodes at the corners in `kept`."""
        for i in (self.i0, self.i1):
            kept[i, self.j0] = kept[i, self.j1] = True

    def blocks(self) -> Iterator["Rectangles"]:
        """Yield the rectangles in blocks, whose polygons take little memory."""
        for start in range(0, len(self.i0), _BLOCK):
            part = slice(start, start + _BLOCK)
            yield Rectangles(i0=self.i0[part], i1=self.i1[part], j0=self.j0[part], j1=self.j1[part])

    def polygons(self, node_grid: NodeGrid, kept: Mask) -> Polygons:
        """Return the boundaries with the nodes that are `kept`."""
        ny = node_grid.z.shape[1]
        low, high = self.i0 * ny, self.i1 * ny
        # Four sides, each from its first corner to just before the next.
        first = np.stack([low + self.j0, high + self.j0, high + self.j1, low + self.j1], axis=1)
        length = np.tile(np.stack([self.i1 - self.i0, self.j1 - self.j0], axis=1), 2)
        side, k = segment_indices(length.ravel())
        nodes = first.ravel()[side] + k * np.array([ny, 1, -ny, -1])[side % 4]
        keep = kept.ravel()[nodes]
        x = (node_grid.x[self.i0] + node_grid.x[self.i1]) / 2
        y = (node_grid.y[self.j0] + node_grid.y[self.j1]) / 2
        z = (node_grid.z[self.i0, self.j0] + node_grid.z[self.i1, self.j1]) / 2
        return Polygons(
            vertices=nodes[keep],
            owner=side[keep] // 4,
            centers=np.column_stack([x, y, z]).astype(np.float32),
        )

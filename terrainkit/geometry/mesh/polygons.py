"""Polygons: rectangles with additional vertices on their sides, and their triangles."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Ids = NDArray[np.int64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class Polygons:
    """Flat rectangles with all vertices of their boundaries."""

    vertices: Ids
    """Vertices of all polygons, one polygon after the other, in order, shape (v,)."""

    owner: Ids
    """Index of the polygon of each vertex, ascending, shape (v,)."""

    centers: NDArray[np.float32]
    """Center of each polygon [m], shape (n, 3)."""

    clockwise: bool = False
    """Whether the vertices are in clockwise order, seen from above."""

    def triangles(self, first: int) -> tuple[Ids, NDArray[np.float32]]:
        """Triangulate the polygons.

        A polygon with four vertices is split along a diagonal. Others are fans around their center,
        since a fan around a corner would have degenerate faces.

        Args:
            first: Vertex number of the first center.

        Returns:
            Triangles, shape (t, 3), and centers that they use [m], shape (c, 3).
        """
        sizes = np.bincount(self.owner, minlength=len(self.centers))
        starts = np.cumsum(sizes) - sizes
        bare = sizes == 4
        a, b, c, d = (self.vertices[starts[bare] + k] for k in range(4))
        halves = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])

        fanned = ~bare[self.owner]
        after = np.roll(self.vertices, -1)
        after[starts + sizes - 1] = self.vertices[starts]
        center = first + np.cumsum(~bare) - 1
        fans = np.column_stack([self.vertices, after, center[self.owner]])[fanned]
        triangles = np.concatenate([halves, fans])
        return triangles[:, ::-1] if self.clockwise else triangles, self.centers[~bare]


def runs(mask: Mask) -> tuple[Ids, Ids, Ids]:
    """Return the runs of True along the second axis of a mask, in order.

    Args:
        mask: The mask, shape (n, m).

    Returns:
        Row, start and end (exclusive) of each run, each of shape (k,).
    """
    padded = np.zeros((mask.shape[0], mask.shape[1] + 2), dtype=bool)
    padded[:, 1:-1] = mask
    flat = padded.ravel()
    change = np.flatnonzero(flat[1:] != flat[:-1])
    row, start = np.divmod(change[::2], padded.shape[1])
    return row, start, change[1::2] % padded.shape[1]

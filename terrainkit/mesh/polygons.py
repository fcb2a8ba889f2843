"""Polygons: rectangles as rings of vertices, many at a time, and their triangles."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Ids = NDArray[np.int64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class Polygons:
    """Flat rectangles, each with all the vertices that its rim needs."""

    vertices: Ids
    """Vertices of all polygons one after the other, in order neighborhood each, shape (v,)."""

    owner: Ids
    """Which loop each vertex belongs to, ascending, shape (v,)."""

    centers: NDArray[np.float32]
    """Middle of each loop [m], shape (n, 3)."""

    clockwise: bool = False
    """Whether the order is clockwise, seen from above."""

    def triangles(self, first: int) -> tuple[Ids, NDArray[np.float32]]:
        """Return the triangles, shape (t, 3), and the centers that they use [m], shape (c, 3).

        A loop with nothing but its corners is cut along a diagonal; any other is a fan from its
        center, since a fan from a corner would have faces without area.

        Args:
            first: Number that the first center takes.
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


def segment_indices(lengths: Ids) -> tuple[Ids, Ids]:
    """Return the owner and the place within it of items laid end to end, `lengths` of each."""
    owner = np.repeat(np.arange(len(lengths)), lengths)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(lengths) - lengths, lengths)


def runs(mask: Mask) -> tuple[Ids, Ids, Ids]:
    """Return row, start and end of every run of True along the second axis, in order."""
    padded = np.zeros((mask.shape[0], mask.shape[1] + 2), dtype=bool)
    padded[:, 1:-1] = mask
    flat = padded.ravel()
    change = np.flatnonzero(flat[1:] != flat[:-1])
    row, start = np.divmod(change[::2], padded.shape[1])
    return row, start, change[1::2] % padded.shape[1]

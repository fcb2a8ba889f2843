"""TriMesh: vertices and triangles."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True, eq=False)
class TriMesh:
    """A triangle mesh."""

    vertices: NDArray[np.float32]
    """Positions [m], shape (nv, 3)."""

    triangles: NDArray[np.int32]
    """Vertices of each face, counterclockwise seen from outside, shape (nf, 3)."""

    def edges(self) -> NDArray[np.int64]:
        """Return the three directed edges of each face, shape (3 nf, 2)."""
        return self.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64)

    def boundary(self) -> NDArray[np.int64]:
        """Return the directed edges that belong to only one face, shape (n, 2)."""
        edges = self.edges()
        number = edges.min(axis=1) * len(self.vertices) + edges.max(axis=1)
        order = np.argsort(number)
        differs = np.ones(len(number) + 1, dtype=bool)
        differs[1:-1] = np.diff(number[order]) != 0
        return edges[order[differs[:-1] & differs[1:]]]

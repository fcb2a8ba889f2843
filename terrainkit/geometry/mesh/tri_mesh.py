"""TriMesh: vertices and triangles."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.settings.text import short_repr

EDGES_PER_BLOCK = 1 << 20
"""Edges that are compared at once, to bound the memory."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TriMesh:
    """A triangle mesh."""

    __repr__ = short_repr

    vertices: NDArray[np.float32]
    """Positions [m], shape (nv, 3)."""

    triangles: NDArray[np.int32]
    """Vertices of each face, counterclockwise seen from outside, shape (nf, 3)."""

    def edge_numbers(self) -> NDArray[np.int64]:
        """Return the numbers of the directed edges of all faces, sorted, shape (3 nf,).

        The edge from a to b has the number 2 (nv min(a, b) + max(a, b)) + (a > b): the number of
        the opposite edge differs in the last bit.
        """
        numbers = np.empty((3, len(self.triangles)), dtype=np.int64)
        for k, number in enumerate(numbers):
            a, b = self.triangles[:, k], self.triangles[:, (k + 1) % 3]
            # The arguments `out` and `dtype` avoid a temporary array in double words.
            np.multiply(np.minimum(a, b), 2 * len(self.vertices), out=number, dtype=np.int64)
            number += 2 * np.maximum(a, b)
            number += a > b
        edges = numbers.reshape(-1)
        edges.sort()
        return edges

    def boundary(self, numbers: NDArray[np.int64] | None = None) -> NDArray[np.int64]:
        """Return the directed edges that belong to only one face, shape (n, 2).

        Args:
            numbers: Result of `edge_numbers`, if it is known.
        """
        numbers = self.edge_numbers() if numbers is None else numbers
        differs = np.ones(len(numbers) + 1, dtype=bool)
        for start in range(1, len(numbers), EDGES_PER_BLOCK):
            block = numbers[start - 1 : start + EDGES_PER_BLOCK]
            differs[start : start + EDGES_PER_BLOCK][: len(block) - 1] = block[1:] ^ block[:-1] > 1
        single = numbers[differs[:-1] & differs[1:]]
        edges = np.column_stack(np.divmod(single >> 1, len(self.vertices)))
        return np.where(single[:, None] & 1, edges[:, ::-1], edges)

"""The nodes of a mesh, the quads between them, and the walls.

The nodes are the samples, and a rim at the edge of the map that repeats the outermost samples, so
that the mesh covers the whole map. Node (i, j) has the number `i * ny + j`. The vertices at the
midpoints of walls follow, two for each wall.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from terrainkit.files.memory import check_memory
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.mesh.row_buffer import RowBuffer
from terrainkit.geometry.walls import WallRule, padded_rule, wall_edges

_BYTES_PER_NODE = 11
"""Peak memory of the nodes and of the masks of what is merged, per node [bytes]; measured."""

_BYTES_PER_VERTEX = 56
"""Peak memory of the faces and vertices per vertex of the mesh [bytes]; measured: 40 to 48, and up
to 59 since NumPy 2.5, whose `resize` copies. A vertex and its two triangles take 36."""

QUADS_PER_BLOCK = 1 << 14
"""Quads whose faces are built at a time, so that intermediate arrays stay in the cache."""


@dataclass(frozen=True, kw_only=True, eq=False)
class NodeGrid:
    """Nodes of shape (nx, ny) and the quads between them, of shape (nx - 1, ny - 1)."""

    x: NDArray[np.float64]
    """Coordinate of each node along x [m], shape (nx,)."""

    y: NDArray[np.float64]
    """Coordinate of each node along y [m], shape (ny,)."""

    z: NDArray[np.float32]
    """Height of each node [m], shape (nx, ny)."""

    walls_x: NDArray[np.bool_]
    """Whether the edge from (i, j) to (i + 1, j) is a wall, shape (nx - 1, ny)."""

    walls_y: NDArray[np.bool_]
    """Whether the edge from (i, j) to (i, j + 1) is a wall, shape (nx, ny - 1)."""

    @classmethod
    def from_heights(cls, heights: NDArray[np.float32], grid: Grid, rule: WallRule) -> "NodeGrid":
        """Return the nodes of a heightfield.

        Args:
            heights: Heights [m], shape `grid.shape`.
            grid: The grid.
            rule: Which edges between neighboring samples are walls.

        Raises:
            MemoryLimitError: if the mesh would not fit in memory.
        """
        check_memory(heights.size * _BYTES_PER_NODE, f"a mesh of {heights.size} samples")
        z = np.pad(heights, 1, mode="edge")
        walls_x, walls_y = wall_edges(z, padded_rule(rule))
        x, y = (np.concatenate([[grid.lower[k]], grid.axis(k), [grid.upper[k]]]) for k in (0, 1))
        return cls(x=x, y=y, z=z, walls_x=walls_x, walls_y=walls_y)

    @cached_property
    def has_wall(self) -> NDArray[np.bool_]:
        """Whether each quad has a wall."""
        either = self.walls_x[:, :-1] | self.walls_x[:, 1:]
        either |= self.walls_y[:-1]
        either |= self.walls_y[1:]
        return either

    def check_memory(self, num_vertices: int, quads: NDArray[np.bool_]) -> int:
        """Return the approximate number of vertices of a mesh, if it fits in memory.

        Args:
            num_vertices: Number of vertices, without the vertices of quads with walls.
            quads: Mask of the quads that are not merged.

        Raises:
            MemoryLimitError: if it does not.
        """
        x, y = self.walls_x, self.walls_y
        for walls in (x[:, :-1], x[:, 1:], y[:-1], y[1:]):
            # Two quads share the two midpoints of a wall, and each has a center for one of them.
            num_vertices += 2 * int(np.count_nonzero(walls & quads))
        check_memory(num_vertices * _BYTES_PER_VERTEX, f"a mesh of about {num_vertices} vertices")
        return num_vertices

    @property
    def flat_x(self) -> NDArray[np.bool_]:
        """Whether both edges of each quad along x are flat."""
        same = self.z[:-1] == self.z[1:]
        return np.asarray(same[:, :-1] & same[:, 1:])

    @property
    def flat_y(self) -> NDArray[np.bool_]:
        """Whether both edges of each quad along y are flat."""
        same = self.z[:, :-1] == self.z[:, 1:]
        return np.asarray(same[:-1] & same[1:])

    def corners(self, i: NDArray[np.int64], j: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the vertices at the corners of quads.

        Args:
            i: Index of each quad along x, shape (n,).
            j: Index of each quad along y, shape (n,).

        Returns:
            Numbers of the four corners, counterclockwise, shape (4, n).
        """
        ny = self.z.shape[1]
        first = i * ny + j
        return np.stack([first, first + ny, first + ny + 1, first + 1])

    def walls(self, i: NDArray[np.int64], j: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return which edges of quads are walls.

        Args:
            i: Index of each quad along x, shape (n,).
            j: Index of each quad along y, shape (n,).

        Returns:
            Whether each of the four edges is a wall, shape (4, n).
        """
        x, y = self.walls_x, self.walls_y
        return np.stack([x[i, j], y[i + 1, j], x[i, j + 1], y[i, j]])

    @cached_property
    def edges(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Flat indices into `walls_x` and into `walls_y` of the walls, in order."""
        return np.flatnonzero(self.walls_x), np.flatnonzero(self.walls_y)

    @property
    def vertex_count(self) -> int:
        """How many numbers the nodes and the midpoints of the walls take."""
        return int(self.z.size + 2 * sum(edges.size for edges in self.edges))

    def midpoint(self, axis: int, i: NDArray[np.int64], j: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the vertex at the midpoint of each wall from (i, j), on the side of (i, j).

        The vertex on the other side has the next number. Without a wall, the result is undefined.

        Args:
            axis: Direction of the edge, 0 for x or 1 for y.
            i: Node along x, shape (n,).
            j: Node along y, shape (n,).
        """
        number = i * (self.walls_x, self.walls_y)[axis].shape[1] + j
        index = axis * self.edges[0].size + np.searchsorted(self.edges[axis], number)
        return np.asarray(self.z.size + 2 * index)

    def vertices(self, used: NDArray[np.bool_], extra: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the positions of the vertices that are used [m], shape (n, 3).

        Args:
            used: Whether each node, midpoint and extra vertex is used, in the order of the numbers.
            extra: Positions of the extra vertices [m], shape (k, 3).
        """
        vertices, start = RowBuffer(np.float32, int(np.count_nonzero(used))), self.z.size
        y = self.y.astype(np.float32)
        for i, used_row in enumerate(used[:start].reshape(self.z.shape)):
            j = slice(None) if used_row.all() else np.flatnonzero(used_row)
            z = self.z[i, j]
            added = vertices.add(len(z))
            added[:, 0], added[:, 1], added[:, 2] = self.x[i], y[j], z
        for block in itertools.chain(self.midpoints(), [extra]):
            vertices.append(block[used[start : start + len(block)]])
            start += len(block)
        return vertices.array()

    def midpoints(self) -> Iterator[NDArray[np.float32]]:
        """Yield the positions of all midpoints of walls [m], in the order of their numbers."""
        for axis, edges in enumerate(self.edges):
            width = (self.walls_x, self.walls_y)[axis].shape[1]
            for start in range(0, edges.size, QUADS_PER_BLOCK):
                i, j = np.divmod(edges[start : start + QUADS_PER_BLOCK], width)
                end_i, end_j = (i, j + 1) if axis else (i + 1, j)
                block = np.empty((len(i), 2, 3), dtype=np.float32)
                block[:, :, 0] = ((self.x[i] + self.x[end_i]) / 2)[:, None]
                block[:, :, 1] = ((self.y[j] + self.y[end_j]) / 2)[:, None]
                block[:, 0, 2], block[:, 1, 2] = self.z[i, j], self.z[end_i, end_j]
                yield block.reshape(-1, 3)

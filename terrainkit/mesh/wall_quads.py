"""The faces of quads with walls: flat or sloping parts, and the walls between them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.mesh.node_grid import NodeGrid
from terrainkit.walls import center_heights

Ids = NDArray[np.int64]

_SADDLE_OFFSET = 1 / 128
"""Offset of the walls of two high corners that meet in a point, as a fraction of the cell.

Four walls meet where two opposite corners are higher than the other two. Their common edge would be
shared by four faces. With this offset, less than a millimeter in a cell of 0.1 m, each pair of
walls has an edge of its own.
"""


@dataclass(frozen=True, kw_only=True, eq=False)
class _WallQuads:
    """The vertices of K quads with walls."""

    corners: Ids
    """Node at each corner, shape (K, 4)."""

    z: NDArray[np.float32]
    """Height of each corner [m], shape (K, 4)."""

    walls: NDArray[np.bool_]
    """Whether each edge is a wall, shape (K, 4)."""

    midpoints: Ids
    """Midpoint of each wall on the side of its first and second corner, shape (K, 4, 2)."""

    xy: NDArray[np.float64]
    """Position of each corner, x and y [m], shape (K, 4, 2)."""

    @property
    def center(self) -> NDArray[np.float64]:
        """Position of the center, x and y [m], shape (K, 2)."""
        return (self.xy[:, 0] + self.xy[:, 2]) / 2

    def __getitem__(self, which: NDArray[np.bool_]) -> "_WallQuads":
        return _WallQuads(**{name: value[which] for name, value in vars(self).items()})

    def rotate_corners(self) -> "_WallQuads":
        """Return the quads renumbered with corner 1 as corner 0."""
        return _WallQuads(
            **{name: np.roll(value, -1, axis=1) for name, value in vars(self).items()}
        )


def wall_quads(node_grid: NodeGrid, numbers: Ids, first: int) -> tuple[Ids, NDArray[np.float32]]:
    """Return the triangles of the quads `numbers`, and their additional vertices.

    Args:
        node_grid: Nodes of the mesh.
        numbers: Flat index of each quad, shape (K,).
        first: Number of the first added vertex.

    Returns:
        Triangles, shape (T, 3), and positions of the added vertices [m], shape (V, 3).
    """
    quads = _gather_quads(node_grid, numbers)
    z0, z1, z2, z3 = quads.z.T
    all_walls = quads.walls.all(axis=1)
    even_high = all_walls & (np.minimum(z0, z2) > np.maximum(z1, z3))
    odd_high = all_walls & (np.minimum(z1, z3) > np.maximum(z0, z2))
    triangles, vertices = [], []
    for build, part in (
        (_fan_faces, quads[~(even_high | odd_high)]),
        (_saddle_faces, quads[even_high]),
        (_saddle_faces, quads[odd_high].rotate_corners()),
    ):
        faces, added = build(part, first)
        first += len(added)
        triangles.append(faces)
        vertices.append(added)
    return np.concatenate(triangles), np.concatenate(vertices)


def _gather_quads(node_grid: NodeGrid, numbers: Ids) -> _WallQuads:
    i, j = np.divmod(numbers, node_grid.z.shape[1] - 1)
    corners = node_grid.corners(i, j)
    low_side = np.stack(
        [
            node_grid.midpoint_x(i, j),
            node_grid.midpoint_y(i + 1, j),
            node_grid.midpoint_x(i, j + 1),
            node_grid.midpoint_y(i, j),
        ],
        axis=1,
    )
    # Edges 0 and 1 point along x and y, edges 2 and 3 against them.
    backwards = np.array([0, 0, 1, 1])
    x, y = node_grid.x, node_grid.y
    return _WallQuads(
        corners=corners,
        z=node_grid.z.ravel()[corners],
        walls=node_grid.walls(i, j),
        midpoints=np.stack([low_side + backwards, low_side + 1 - backwards], axis=2),
        xy=np.stack(
            [
                np.stack([x[i], x[i + 1], x[i + 1], x[i]], axis=1),
                np.stack([y[j], y[j], y[j + 1], y[j + 1]], axis=1),
            ],
            axis=2,
        ),
    )


def _fan_faces(quads: _WallQuads, first: int) -> tuple[Ids, NDArray[np.float32]]:
    """Return fans around the center of each quad, with one vertex per height at the center."""
    heights = center_heights(quads.z, quads.walls).astype(np.float32)
    column = _VerticalLine.from_heights(heights, quads.center, first)
    triangles = []
    for k in range(4):
        after = (k + 1) % 4
        wall = quads.walls[:, k]
        joined = [column.vertex(k), quads.corners[:, k], quads.corners[:, after]]
        triangles.append(np.column_stack(joined)[~wall])
        a, b = quads.midpoints[:, k].T
        near = [column.vertex(k), quads.corners[:, k], a]
        far = [column.vertex(after), b, quads.corners[:, after]]
        triangles += [np.column_stack(near)[wall], np.column_stack(far)[wall]]
        triangles += column.wall(a, b, k, after, wall)
    return np.concatenate(triangles), column.positions


def _saddle_faces(quads: _WallQuads, first: int) -> tuple[Ids, NDArray[np.float32]]:
    """Return the faces of quads whose corners 0 and 2 are above 1 and 3, with two centers each."""
    offset = (quads.xy[:, 0] - quads.center) * _SADDLE_OFFSET
    west = _VerticalLine.from_heights(quads.z[:, [0, 1, 3]], quads.center + offset, first)
    east = _VerticalLine.from_heights(
        quads.z[:, [2, 1, 3]], quads.center - offset, first + len(west.positions)
    )
    c0, c1, c2, c3 = quads.corners.T
    (m0, n0), (m1, n1), (m2, n2), (m3, n3) = (quads.midpoints[:, k].T for k in range(4))
    every = np.ones(len(c0), dtype=bool)
    floor = quads.z[:, 1] != quads.z[:, 3]
    triangles = [
        *_rows((west.vertex(0), n3, c0), (west.vertex(0), c0, m0)),
        *_rows((east.vertex(0), n1, c2), (east.vertex(0), c2, m2)),
        *_rows((c1, m1, east.vertex(1)), (c1, east.vertex(1), west.vertex(1))),
        *_rows((c1, west.vertex(1), n0), (c3, m3, west.vertex(2))),
        *_rows((c3, west.vertex(2), east.vertex(2)), (c3, east.vertex(2), n2)),
        *west.wall(m0, n0, 0, 1, every),
        *east.wall(m1, n1, 1, 0, every),
        *east.wall(m2, n2, 0, 2, every),
        *west.wall(m3, n3, 2, 0, every),
    ]
    between = _rows(
        (west.vertex(1), east.vertex(1), east.vertex(2)),
        (west.vertex(1), east.vertex(2), west.vertex(2)),
    )
    triangles += [faces[floor] for faces in between]
    return np.concatenate(triangles), np.concatenate([west.positions, east.positions])


def _rows(*faces: tuple[Ids, Ids, Ids]) -> list[Ids]:
    return [np.column_stack(face) for face in faces]


@dataclass(frozen=True, kw_only=True, eq=False)
class _VerticalLine:
    """The vertices on a vertical line in each of K quads, one per distinct height."""

    positions: NDArray[np.float32]
    """Positions of all vertices [m], by quad in ascending order, shape (V, 3)."""

    first_vertex: Ids
    """Number of each quad's lowest vertex, shape (K,)."""

    rank: Ids
    """Index of the vertex of each of the h heights, counted from the lowest, shape (K, h)."""

    @classmethod
    def from_heights(
        cls, heights: NDArray[np.float32], xy: NDArray[np.float64], first: int
    ) -> "_VerticalLine":
        order = np.argsort(heights, axis=1, kind="stable")
        ascending = np.take_along_axis(heights, order, axis=1)
        new = np.ones(heights.shape, dtype=bool)
        new[:, 1:] = ascending[:, 1:] != ascending[:, :-1]
        rank = np.empty(heights.shape, dtype=np.int64)
        np.put_along_axis(rank, order, np.cumsum(new, axis=1) - 1, axis=1)
        counts = new.sum(axis=1)
        positions = np.column_stack([np.repeat(xy, counts, axis=0), ascending[new]])
        first_vertex = first + np.cumsum(counts) - counts
        return cls(positions=positions.astype(np.float32), first_vertex=first_vertex, rank=rank)

    def vertex(self, k: int) -> Ids:
        """Return the vertex of the k-th height in each quad."""
        return self.first_vertex + self.rank[:, k]

    def wall(self, a: Ids, b: Ids, k: int, after: int, mask: NDArray[np.bool_]) -> list[Ids]:
        """Return the faces of the wall between the vertices `a` and `b` of an edge and this line.

        On the line the wall extends from height `k`, next to `a`, to height `after`, next to `b`.
        It uses all vertices in between, so walls that meet on the line share their vertices.
        """
        end, start = self.rank[:, k], self.rank[:, after]
        triangles = [np.column_stack([a, b, self.first_vertex + start])[mask]]
        step = np.sign(end - start)
        for n in range(self.rank.shape[1] - 1):
            more = mask & (np.abs(end - start) > n)
            at = self.first_vertex + start + n * step
            triangles.append(np.column_stack([a, at, at + step])[more])
        return triangles

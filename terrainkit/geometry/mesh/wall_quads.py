"""The faces of quads with walls: flat or sloping parts, and the walls between them.

The faces of a quad depend only on which of its edges are walls and on the order of the heights at
its center. They are listed once for each of these cases, in the quad's own vertex numbers:

- 0 to 3: the corners, as in `terrainkit.geometry.walls`;
- 4 + 2 k and 5 + 2 k: the midpoint of wall k, on the side of its first and its second corner;
- 12 to 15: the vertices on a vertical line at the center, from the lowest to the highest;
- 16 to 19: the vertices on a second line, where four walls meet between two high corners.
"""

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.geometry.mesh.node_grid import QUADS_PER_BLOCK, NodeGrid
from terrainkit.geometry.walls import center_heights

Ids = NDArray[np.int64]
_Face = tuple[int, int, int]

_MIDPOINTS, _LINE, _SECOND_LINE = 4, 12, 16

_SADDLE_OFFSET = 1 / 128
"""Offset of the walls of two high corners that meet in a point, as a fraction of half a cell.

Four walls meet where two opposite corners are higher than the other two. Their common edge would be
shared by four faces. With this offset, 0.4 mm in a cell of 0.1 m, each pair of walls has an edge of
its own.
"""


def wall_quads(
    node_grid: NodeGrid, numbers: Ids, first: int
) -> Iterator[tuple[NDArray[np.int32], NDArray[np.float32]]]:
    """Yield the triangles of blocks of the quads `numbers`, and their additional vertices.

    Args:
        node_grid: Nodes of the mesh.
        numbers: Flat index of each quad, shape (K,).
        first: Number of the first extra vertex.

    Yields:
        Triangles, shape (T, 3), and positions of the extra vertices [m], shape (V, 3).
    """
    for start in range(0, len(numbers), QUADS_PER_BLOCK):
        quads = _Quads.from_grid(node_grid, numbers[start : start + QUADS_PER_BLOCK])
        z0, z1, z2, z3 = quads.z
        all_walls = quads.walls.all(axis=0)
        even_high = all_walls & (np.minimum(z0, z2) > np.maximum(z1, z3))
        odd_high = all_walls & (np.minimum(z1, z3) > np.maximum(z0, z2))
        for build, part in (
            (_fans, quads.select(~(even_high | odd_high))),
            (_saddles, quads.select(even_high)),
            (_saddles, quads.select(odd_high).rotate_corners()),
        ):
            faces, extra = build(part, first)
            first += len(extra)
            if faces:
                yield np.concatenate(faces), extra


@dataclass(frozen=True, kw_only=True, eq=False)
class _Quads:
    """The vertices of K quads with walls."""

    vertices: NDArray[np.int32]
    """Corners and midpoints, shape (12, K). Where there is no wall, midpoints are undefined."""

    z: NDArray[np.float32]
    """Height of each corner [m], shape (4, K)."""

    walls: NDArray[np.bool_]
    """Whether each edge is a wall, shape (4, K)."""

    center: NDArray[np.float64]
    """Position of the center, x and y [m], shape (2, K)."""

    corner0: NDArray[np.float64]
    """Position of corner 0, relative to the center [m], shape (2, K)."""

    @classmethod
    def from_grid(cls, node_grid: NodeGrid, numbers: Ids) -> "_Quads":
        i, j = np.divmod(numbers, node_grid.z.shape[1] - 1)
        corners = node_grid.corners(i, j)
        # Edges 0 and 1 point along x and y, edges 2 and 3 against them.
        m0, m1 = node_grid.midpoint(0, i, j), node_grid.midpoint(1, i + 1, j)
        m2, m3 = node_grid.midpoint(0, i, j + 1) + 1, node_grid.midpoint(1, i, j) + 1
        midpoints = [m0, m0 + 1, m1, m1 + 1, m2, m2 - 1, m3, m3 - 1]
        x, y = node_grid.x, node_grid.y
        return cls(
            vertices=np.stack([*corners, *midpoints], dtype=np.int32, casting="same_kind"),
            z=node_grid.z.ravel()[corners],
            walls=node_grid.walls(i, j),
            center=np.stack([x[i] + x[i + 1], y[j] + y[j + 1]]) / 2,
            corner0=np.stack([x[i] - x[i + 1], y[j] - y[j + 1]]) / 2,
        )

    def select(self, mask: NDArray[np.bool_]) -> "_Quads":
        """Return some of the quads."""
        index = np.flatnonzero(mask)
        return _Quads(**{name: value[..., index] for name, value in vars(self).items()})

    def rotate_corners(self) -> "_Quads":
        """Return the quads renumbered with corner 1 as corner 0."""
        corners, midpoints = np.split(self.vertices, [_MIDPOINTS])
        return _Quads(
            vertices=np.concatenate([np.roll(corners, -1, 0), np.roll(midpoints, -2, 0)]),
            z=np.roll(self.z, -1, axis=0),
            walls=np.roll(self.walls, -1, axis=0),
            center=self.center,
            corner0=np.stack([-self.corner0[0], self.corner0[1]]),
        )


def _fans(quads: _Quads, first: int) -> tuple[list[NDArray[np.int32]], NDArray[np.float32]]:
    """Return fans around the center of each quad, with one vertex per height at the center."""
    heights = center_heights(quads.z.T, quads.walls.T).astype(np.float32)
    line = _VerticalLine.from_heights(np.ascontiguousarray(heights.T), quads.center, first)
    cases = np.concatenate([quads.walls, line.rank])
    vertices = np.concatenate([quads.vertices, line.vertices])
    return _make_triangles(_fan_faces, cases, vertices), line.positions


def _saddles(quads: _Quads, first: int) -> tuple[list[NDArray[np.int32]], NDArray[np.float32]]:
    """Return the faces of quads whose corners 0 and 2 are above 1 and 3, with two centers each."""
    offset = quads.corner0 * _SADDLE_OFFSET
    west = _VerticalLine.from_heights(quads.z[[0, 1, 3]], quads.center + offset, first)
    first += len(west.positions)
    east = _VerticalLine.from_heights(quads.z[[2, 1, 3]], quads.center - offset, first)
    cases = np.concatenate([west.rank, east.rank])
    vertices = np.concatenate([quads.vertices, west.vertices, east.vertices])
    triangles = _make_triangles(_saddle_faces, cases, vertices)
    return triangles, np.concatenate([west.positions, east.positions])


def _make_triangles(
    faces_of: Callable[..., Iterator[_Face]],
    cases: NDArray[np.integer],
    vertices: NDArray[np.int32],
) -> list[NDArray[np.int32]]:
    """Return the triangles of K quads, one array for each case.

    Args:
        faces_of: Returns the faces of a case in the quad's own vertex numbers.
        cases: Arguments of `faces_of`, each 0 to 3, shape (c, K).
        vertices: The vertex of each of the quad's own numbers, shape (n, K).
    """
    # 16 bits, for which NumPy sorts fastest.
    keys = np.zeros(cases.shape[1], dtype=np.uint16)
    for case in cases:
        keys = keys << 2 | case.astype(np.uint16)
    order = np.argsort(keys, kind="stable")
    vertices, keys = vertices[:, order], keys[order]
    starts = np.flatnonzero(np.diff(keys, prepend=-1, append=-1))
    triangles = []
    for start, end in itertools.pairwise(starts.tolist()):
        faces = np.array(list(faces_of(*cases[:, order[start]].tolist())))
        triangles.append(vertices[faces.ravel(), start:end].T.reshape(-1, 3))
    return triangles


def _fan_faces(*case: int) -> Iterator[_Face]:
    """Yield the faces of a fan, given its four walls and the ranks of the heights at its center."""
    walls, ranks = case[:4], case[4:]
    for k in range(4):
        after = (k + 1) % 4
        near, far = _LINE + ranks[k], _LINE + ranks[after]
        if walls[k]:
            a, b = _MIDPOINTS + 2 * k, _MIDPOINTS + 2 * k + 1
            yield from ((near, k, a), (far, b, after))
            yield from _wall_faces(a, b, near, far)
        else:
            yield near, k, after


def _saddle_faces(*case: int) -> Iterator[_Face]:
    """Yield the faces of a saddle, given the ranks of corners 0, 1, 3 and 2, 1, 3 on its lines."""
    w0, w1, w3 = (_LINE + rank for rank in case[:3])
    e2, e1, e3 = (_SECOND_LINE + rank for rank in case[3:])
    a0, b0, a1, b1, a2, b2, a3, b3 = range(_MIDPOINTS, _LINE)
    yield from ((w0, b3, 0), (w0, 0, a0), (e2, b1, 2), (e2, 2, a2))
    yield from ((1, a1, e1), (1, e1, w1), (1, w1, b0), (3, a3, w3), (3, w3, e3), (3, e3, b2))
    yield from _wall_faces(a0, b0, w0, w1)
    yield from _wall_faces(a1, b1, e1, e2)
    yield from _wall_faces(a2, b2, e2, e3)
    yield from _wall_faces(a3, b3, w3, w0)
    if w1 != w3:
        yield from ((w1, e1, e3), (w1, e3, w3))


def _wall_faces(a: int, b: int, near: int, far: int) -> Iterator[_Face]:
    """Yield the faces of the wall between the vertices `a` and `b` of an edge and a vertical line.

    On the line the wall extends from `near`, next to `a`, to `far`, next to `b`. It uses all
    vertices in between, so walls that meet on the line share their vertices.
    """
    step = 1 if near > far else -1
    yield a, b, far
    yield from ((a, at, at + step) for at in range(far, near, step))


@dataclass(frozen=True, kw_only=True, eq=False)
class _VerticalLine:
    """The vertices on a vertical line in each of K quads, one per distinct height."""

    positions: NDArray[np.float32]
    """Positions of all vertices [m], by quad in ascending order, shape (V, 3)."""

    vertices: NDArray[np.int32]
    """Four consecutive vertex numbers, starting with the quad's own vertices, shape (4, K)."""

    rank: NDArray[np.uint8]
    """Index of the vertex of each of the h heights, counted from the lowest, shape (h, K)."""

    @classmethod
    def from_heights(
        cls, heights: NDArray[np.float32], xy: NDArray[np.float64], first: int
    ) -> "_VerticalLine":
        """Return the lines at `xy`, shape (2, K), with the given heights, shape (h, K)."""
        rank = np.zeros(heights.shape, dtype=np.uint8)
        counts = np.zeros(heights.shape[1], dtype=np.int64)
        for k, height in enumerate(heights):
            new = (heights[:k] != height).all(axis=0)
            rank += new & (height < heights)
            counts += new
        start = np.cumsum(counts) - counts
        positions = np.empty((counts.sum(), 3), dtype=np.float32)
        positions[:, 0], positions[:, 1] = np.repeat(xy, counts, axis=1)
        positions[start + rank, 2] = heights
        vertices = first + start + np.arange(4)[:, None]
        return cls(positions=positions, vertices=vertices.astype(np.int32), rank=rank)

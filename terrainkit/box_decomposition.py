"""Boxes: the level parts of the ground as a few axis-aligned solids with exact vertical walls."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.grid import Grid
from terrainkit.mesh.closed import THICKNESS
from terrainkit.mesh.node_grid import NodeGrid
from terrainkit.rectangle_cover import rectangle_cover
from terrainkit.walls import connected_corners

MAX_HEIGHTS_PER_BLOCK = 50
"""Heights in a block above which a box is searched only neighborhood the cells of its height, or the time
would grow with the square of their number. Below, it may run on under higher ground to the edge of
the block, and be joined with one beyond."""

_Cell = TypeVar("_Cell", bound=np.generic)

_Span = tuple[int, int, int, int]
"""Cells i0 to i1 along x and j0 to j1 along y, ends not included."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BoxDecomposition:
    """Boxes under the level parts of the ground.

    Boxes may overlap below the ground: a pyramid of stairs is a stack of them, one for each step.
    """

    centers: NDArray[np.float64]
    """Middle of each box [m], shape (n, 3)."""

    half_sizes: NDArray[np.float64]
    """Half of its size along x, y and z [m], shape (n, 3)."""

    covered: NDArray[np.bool_]
    """Cells whose whole ground is the top of a box, shape (nx, ny). The others are not level, and
    are left to a heightfield."""

    @property
    def complete(self) -> bool:
        """Whether the boxes hold all of the ground."""
        return bool(self.covered.all())


def decompose_boxes(
    heights: NDArray[np.float32],
    grid: Grid,
    threshold: float,
    patch_edges: tuple[NDArray[np.int64], NDArray[np.int64]],
) -> BoxDecomposition:
    """Return the level parts of the ground as boxes.

    A cell is level if its whole square is: then its top is exactly that of a box. Within a patch
    the boxes of each height come from :func:`~terrainkit.rectangle_cover.rectangle_cover`, which
    may run them under higher ground; those that share a whole side are joined across patches.

    Args:
        heights: Samples [m], shape `grid.shape`.
        grid: Where they stand.
        threshold: Difference between neighbours above which there is a wall [m].
        patch_edges: Cells along x and along y where patches meet; no box is searched across them.
    """
    level = level_cells(heights, grid, threshold)
    low = _lower_bound(heights, level)
    edges = [
        np.unique(np.concatenate([[0], lines, [n]]))
        for lines, n in zip(patch_edges, heights.shape, strict=True)
    ]
    spans: dict[float, list[_Span]] = {}
    for i0, i1 in zip(edges[0], edges[0][1:], strict=False):
        for j0, j1 in zip(edges[1], edges[1][1:], strict=False):
            block = (slice(i0, i1), slice(j0, j1))
            for height, (a, b, c, d) in _cover_block(heights[block], level[block], low[block]):
                span = (int(i0 + a), int(i0 + b), int(j0 + c), int(j0 + d))
                spans.setdefault(height, []).append(span)
    joined = [(span, height) for height in sorted(spans) for span in _merge_spans(spans[height])]
    return _solids(joined, grid, float(heights.min()) - THICKNESS, level)


def level_cells(heights: NDArray[np.float32], grid: Grid, threshold: float) -> NDArray[np.bool_]:
    """Return which cells are level all over, shape of `heights`.

    A cell takes a quarter of each of the four quads neighborhood its sample, and is level if the corner
    that it has in each is joined, without a wall between, to none but corners of its own height.
    """
    node_grid = NodeGrid.of(heights, grid, threshold)
    i, j = np.nonzero(node_grid.cut)
    corners = node_grid.z.ravel()[node_grid.corners(i, j)]
    same = corners[:, :, None] == corners[:, None, :]
    at_cut = (same | ~connected_corners(node_grid.walls(i, j))).all(axis=2)

    level = np.ones(node_grid.z.shape, dtype=bool)
    quads = (slice(None, -1), slice(1, None))
    for k, (a, b) in enumerate(((0, 0), (1, 0), (1, 1), (0, 1))):
        corner = node_grid.level_x & node_grid.level_y
        corner[i, j] = at_cut[:, k]
        level[quads[a], quads[b]] &= corner
    return level[1:-1, 1:-1]


def _lower_bound(heights: NDArray[np.float32], level: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return a height that the ground of each cell is nowhere below [m]."""
    return np.where(level, heights, np.minimum.reduce(neighborhood(heights)))


def neighborhood(values: NDArray[_Cell]) -> list[NDArray[_Cell]]:
    """Return what is in each cell and in the eight neighborhood it, nine arrays of the same shape."""
    padded = np.pad(values, 1, mode="edge")
    nx, ny = values.shape
    return [padded[i : i + nx, j : j + ny] for i in range(3) for j in range(3)]


def _cover_block(
    heights: NDArray[np.float32], level: NDArray[np.bool_], low: NDArray[np.float32]
) -> Iterator[tuple[float, _Span]]:
    """Yield the boxes of a block of cells, height by height."""
    if not level.any():
        return
    i, j = np.nonzero(level)
    order = np.argsort(heights[i, j], kind="stable")
    i, j = i[order], j[order]
    values, first = np.unique(heights[i, j], return_index=True)
    groups = zip(values, np.split(i, first[1:]), np.split(j, first[1:]), strict=True)
    for height, rows, cols in groups:
        part = (slice(0, heights.shape[0]), slice(0, heights.shape[1]))
        if len(values) > MAX_HEIGHTS_PER_BLOCK:
            part = (slice(rows.min(), rows.max() + 1), slice(cols.min(), cols.max() + 1))
        wanted = level[part] & (heights[part] == height)
        for a, b, c, d in rectangle_cover(wanted, low[part] >= height):
            i0, j0 = part[0].start, part[1].start
            yield float(height), (int(i0 + a), int(i0 + b), int(j0 + c), int(j0 + d))


def _merge_spans(spans: list[_Span]) -> list[_Span]:
    """Return the spans with those that share a whole side made one."""
    before = -1
    while len(spans) != before:
        before = len(spans)
        for turned in (False, True):
            spans = _merge_spans_along(spans, turned=turned)
    return spans


def _merge_spans_along(spans: list[_Span], *, turned: bool) -> list[_Span]:
    """Return the spans with those of the same j0 and j1 joined (of the same i0, i1 if `turned`)."""
    result: list[_Span] = []
    for i0, i1, j0, j1 in sorted(
        map(_swap_axes, spans) if turned else spans, key=lambda s: (s[2:], s)
    ):
        if result and result[-1][2:] == (j0, j1) and i0 <= result[-1][1]:
            result[-1] = (result[-1][0], max(result[-1][1], i1), j0, j1)
        else:
            result.append((i0, i1, j0, j1))
    return [_swap_axes(span) for span in result] if turned else result


def _swap_axes(span: _Span) -> _Span:
    i0, i1, j0, j1 = span
    return j0, j1, i0, i1


def _solids(
    boxes: list[tuple[_Span, float]], grid: Grid, bottom: float, level: NDArray[np.bool_]
) -> BoxDecomposition:
    spans = np.array([span for span, _ in boxes], dtype=np.float64).reshape(-1, 4)
    tops = np.array([height for _, height in boxes], dtype=np.float64)
    lower = np.column_stack([spans[:, [0, 2]] * grid.cell + grid.lower, np.full(len(tops), bottom)])
    upper = np.column_stack([spans[:, [1, 3]] * grid.cell + grid.lower, tops])
    return BoxDecomposition(
        centers=(lower + upper) / 2, half_sizes=(upper - lower) / 2, covered=level
    )

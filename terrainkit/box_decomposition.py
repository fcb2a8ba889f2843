"""Decompose the flat parts of the ground into few axis-aligned boxes with vertical walls."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.grid import Grid
from terrainkit.mesh.closed import THICKNESS
from terrainkit.mesh.node_grid import NodeGrid
from terrainkit.rectangle_cover import rectangle_cover
from terrainkit.walls import connected_corners, wall_edges

MAX_HEIGHTS_PER_BLOCK = 50
"""Number of heights in a block above which boxes are searched only around the cells of their
height, since the time would grow with its square. Below it, a box may extend under higher ground to
the edge of the block, where it can merge with one in the next block."""

MAX_LENGTH = 24.0
"""Length up to which boxes of different patches are merged [m]. A longer box lies on many nodes of
MuJoCo's bounding volume hierarchy, which a robot anywhere near the box then has to test."""

_Cell = TypeVar("_Cell", bound=np.generic)

_Span = tuple[int, int, int, int]
"""Cells i0 to i1 along x and j0 to j1 along y, ends excluded."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BoxDecomposition:
    """Boxes under the flat parts of the ground.

    Boxes may overlap below the surface: pyramid stairs are a stack of one box per step.
    """

    centers: NDArray[np.float64]
    """Center of each box [m], shape (n, 3)."""

    half_sizes: NDArray[np.float64]
    """Half of the size along x, y and z [m], shape (n, 3)."""

    covered: NDArray[np.bool_]
    """Whether the whole cell is the top of a box, shape (nx, ny). The other cells are not flat and
    need a heightfield."""

    @property
    def complete(self) -> bool:
        """Whether the boxes cover all of the ground."""
        return bool(self.covered.all())


def decompose_boxes(
    heights: NDArray[np.float32],
    grid: Grid,
    threshold: float,
    patch_edges: tuple[NDArray[np.int64], NDArray[np.int64]],
) -> BoxDecomposition:
    """Return the flat parts of the ground as boxes.

    A cell is flat if its whole square is flat. Within a patch, the boxes of each height are found
    by :func:`~terrainkit.rectangle_cover.rectangle_cover`, and may extend under higher ground.
    Boxes of different patches that share a whole side are merged up to `MAX_LENGTH`, or without
    a limit where that halves their number. The boxes are in the order of their centers, which
    MuJoCo's bounding volume hierarchy keeps where centers are equal along an axis.

    A patch that has slopes and no walls gets no boxes: a heightfield represents it exactly.

    Args:
        heights: Samples [m], shape `grid.shape`.
        grid: Positions of the samples.
        threshold: Difference between neighboring samples above which there is a wall [m].
        patch_edges: Cells along x and along y where patches meet. Boxes are searched per patch.
    """
    flat = flat_cells(heights, grid, threshold)
    low = _lower_bound(heights, flat)
    has_wall = _cells_at_walls(heights, threshold)
    lines_x, lines_y = patch_edges
    edges = [
        np.unique(np.concatenate([[0], lines, [n]]))
        for lines, n in zip(patch_edges, heights.shape, strict=True)
    ]
    spans: dict[float, list[_Span]] = {}
    for i0, i1 in zip(edges[0], edges[0][1:], strict=False):
        for j0, j1 in zip(edges[1], edges[1][1:], strict=False):
            block = (slice(i0, i1), slice(j0, j1))
            is_patch = lines_x[0] <= i0 < lines_x[-1] and lines_y[0] <= j0 < lines_y[-1]
            if is_patch and not (flat[block].all() or has_wall[block].any()):
                flat[block] = False
                continue
            for height, (a, b, c, d) in _cover_block(heights[block], flat[block], low[block]):
                span = (int(i0 + a), int(i0 + b), int(j0 + c), int(j0 + d))
                spans.setdefault(height, []).append(span)
    limit = round(MAX_LENGTH / grid.cell)
    short, long = (
        [(span, height) for height in spans for span in merge_spans(spans[height], max_cells)]
        for max_cells in (limit, np.inf)
    )
    boxes = long if 2 * len(long) <= len(short) else short
    boxes.sort(key=lambda box: (box[0][0] + box[0][1], box[0][2] + box[0][3], box[1], box[0]))
    return _make_boxes(boxes, grid, float(heights.min()) - THICKNESS, flat)


def flat_cells(heights: NDArray[np.float32], grid: Grid, threshold: float) -> NDArray[np.bool_]:
    """Return which cells are flat, shape of `heights`.

    A cell consists of a quarter of each of the four quads around its sample. It is flat if, in
    each quad, its corner is connected without a wall only to corners of the same height.
    """
    node_grid = NodeGrid.from_heights(heights, grid, threshold)
    i, j = np.nonzero(node_grid.has_wall)
    corners = node_grid.z.ravel()[node_grid.corners(i, j)]
    same = corners[:, :, None] == corners[:, None, :]
    at_cut = (same | ~connected_corners(node_grid.walls(i, j))).all(axis=2)

    flat = np.ones(node_grid.z.shape, dtype=bool)
    quads = (slice(None, -1), slice(1, None))
    for k, (a, b) in enumerate(((0, 0), (1, 0), (1, 1), (0, 1))):
        corner = node_grid.flat_x & node_grid.flat_y
        corner[i, j] = at_cut[:, k]
        flat[quads[a], quads[b]] &= corner
    return flat[1:-1, 1:-1]


def _cells_at_walls(heights: NDArray[np.float32], threshold: float) -> NDArray[np.bool_]:
    """Return which cells have a wall on one of their four sides, shape of `heights`."""
    result = np.zeros(heights.shape, dtype=bool)
    along_x, along_y = wall_edges(heights, threshold)
    for side in (slice(None, -1), slice(1, None)):
        result[side] |= along_x
        result[:, side] |= along_y
    return result


def _lower_bound(heights: NDArray[np.float32], flat: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return a lower bound of the ground in each cell [m]."""
    return np.where(flat, heights, np.minimum.reduce(neighborhood(heights)))


def neighborhood(values: NDArray[_Cell]) -> list[NDArray[_Cell]]:
    """Return the values shifted to each of the 3 x 3 neighbors, nine arrays of the same shape."""
    padded = np.pad(values, 1, mode="edge")
    nx, ny = values.shape
    return [padded[i : i + nx, j : j + ny] for i in range(3) for j in range(3)]


def _cover_block(
    heights: NDArray[np.float32], flat: NDArray[np.bool_], low: NDArray[np.float32]
) -> Iterator[tuple[float, _Span]]:
    """Yield the boxes of a block of cells, in the order of their heights."""
    if not flat.any():
        return
    i, j = np.nonzero(flat)
    order = np.argsort(heights[i, j], kind="stable")
    i, j = i[order], j[order]
    values, first = np.unique(heights[i, j], return_index=True)
    groups = zip(values, np.split(i, first[1:]), np.split(j, first[1:]), strict=True)
    for height, rows, cols in groups:
        part = (slice(0, heights.shape[0]), slice(0, heights.shape[1]))
        if len(values) > MAX_HEIGHTS_PER_BLOCK:
            part = (slice(rows.min(), rows.max() + 1), slice(cols.min(), cols.max() + 1))
        required = flat[part] & (heights[part] == height)
        for a, b, c, d in rectangle_cover(required, low[part] >= height):
            i0, j0 = part[0].start, part[1].start
            yield float(height), (int(i0 + a), int(i0 + b), int(j0 + c), int(j0 + d))


def merge_spans(spans: list[_Span], max_cells: float = np.inf) -> list[_Span]:
    """Merge spans that share a whole side, up to a length of `max_cells`, until none do."""
    before = -1
    while len(spans) != before:
        before = len(spans)
        for swapped in (False, True):
            spans = _merge_spans_along(spans, max_cells, swapped=swapped)
    return spans


def _merge_spans_along(spans: list[_Span], max_cells: float, *, swapped: bool) -> list[_Span]:
    """Merge adjacent spans of the same j0 and j1, or of the same i0 and i1 if `swapped`."""
    result: list[_Span] = []
    for i0, i1, j0, j1 in sorted(
        map(_swap_axes, spans) if swapped else spans, key=lambda s: (s[2:], s)
    ):
        if result and result[-1][2:] == (j0, j1):
            first, last = result[-1][:2]
            if i1 <= last or (i0 <= last and i1 - first <= max_cells):
                result[-1] = (first, max(last, i1), j0, j1)
                continue
        result.append((i0, i1, j0, j1))
    return [_swap_axes(span) for span in result] if swapped else result


def _swap_axes(span: _Span) -> _Span:
    i0, i1, j0, j1 = span
    return j0, j1, i0, i1


def _make_boxes(
    boxes: list[tuple[_Span, float]], grid: Grid, bottom: float, flat: NDArray[np.bool_]
) -> BoxDecomposition:
    spans = np.array([span for span, _ in boxes], dtype=np.float64).reshape(-1, 4)
    tops = np.array([height for _, height in boxes], dtype=np.float64)
    lower = np.column_stack([spans[:, [0, 2]] * grid.cell + grid.lower, np.full(len(tops), bottom)])
    upper = np.column_stack([spans[:, [1, 3]] * grid.cell + grid.lower, tops])
    return BoxDecomposition(
        centers=(lower + upper) / 2, half_sizes=(upper - lower) / 2, covered=flat
    )

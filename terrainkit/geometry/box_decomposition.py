"""Decompose the flat parts of the ground into few axis-aligned boxes with vertical walls."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrainkit.files.memory import check_memory
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.mesh.closed import THICKNESS
from terrainkit.geometry.mesh.node_grid import NodeGrid
from terrainkit.geometry.rectangle_decomposition import Span, decompose_rectangles
from terrainkit.geometry.walls import WallRule, flat_corners
from terrainkit.settings.text import short_repr

MAX_HEIGHTS_PER_BLOCK = 50
"""Number of heights in a block above which boxes are searched only around the cells of their
height, since the time would grow with its square. Below it, a box may extend under higher ground to
the edge of the block, where it can merge with one in the next block."""

_BYTES_PER_CELL = 17
"""Peak memory per cell, without the boxes, which are few [bytes]; measured: 15 to 16."""

MAX_LENGTHS = (16.0, 32.0)
"""Distances along x and y at which a row of merged boxes is divided [m]. Long boxes enlarge many
nodes of MuJoCo's bounding volume hierarchy, all of which are tested for a robot near such a box.
Heights differ along x, with the difficulty, so that mostly level ground merges along it; along y,
boxes of all heights merge, and fewer of them save more time."""

_Cache = dict[tuple[tuple[int, ...], bytes, bytes], list[tuple[int, Span]]]


@dataclass(frozen=True, kw_only=True, eq=False)
class BoxDecomposition:
    """Boxes under the flat parts of the ground.

    Boxes may overlap below the surface: pyramid stairs are a stack of one box per step.
    """

    __repr__ = short_repr

    centers: NDArray[np.float64]
    """Center of each box [m], shape (n, 3)."""

    half_sizes: NDArray[np.float64]
    """Half of the size along x, y and z [m], shape (n, 3)."""

    friction: NDArray[np.float32]
    """Friction of each box, shape (n,)."""

    box_mask: NDArray[np.bool_]
    """Whether the whole cell is the top of a box, shape (nx, ny). The others need a heightfield."""


def decompose_boxes(
    heights: NDArray[np.float32],
    grid: Grid,
    rule: WallRule,
    patch_edges: tuple[NDArray[np.int64], NDArray[np.int64]],
    friction: ArrayLike = 1.0,
) -> BoxDecomposition:
    """Return the flat parts of the ground as boxes.

    A cell is flat if the ground is level in its whole square. Within a patch,
    `decompose_rectangles` finds the boxes of a height, which may extend under higher ground.
    Boxes of different patches that share a whole side are merged, and divided at `MAX_LENGTHS`
    unless that doubles their number. They are sorted by their centers, since MuJoCo's bounding
    volume hierarchy keeps this order for boxes with equal centers along an axis.

    A patch that has slopes and no walls gets no boxes: a heightfield represents it exactly.

    Args:
        heights: Samples [m], shape `grid.shape`.
        grid: Positions of the samples.
        rule: Which edges between neighboring samples are walls.
        patch_edges: Cells along x and along y where patches meet. Boxes are searched per patch.
        friction: Friction of each cell, broadcast to `grid.shape`. Each box has one friction.
    """
    import cv2

    check_memory(heights.size * _BYTES_PER_CELL, f"boxes of {heights.size} samples")
    friction = np.broadcast_to(np.asarray(friction, dtype=np.float32), heights.shape)

    node_grid = NodeGrid.from_heights(heights, grid, rule)
    flat = flat_cells(node_grid)
    # A lower bound of the ground in each cell.
    # The surface of a cell depends on the 3 x 3 samples around it, and is nowhere below their
    # minimum.
    low = cv2.erode(heights, np.ones((3, 3), dtype=np.uint8))
    np.copyto(low, heights, where=flat)
    _drop_patches_without_walls(flat, node_grid, patch_edges)
    edges = [
        np.union1d(lines, changes(values)).tolist()
        for lines, values in zip(patch_edges, (friction, friction.T), strict=True)
    ]
    differ_x = (flat[1:] != flat[:-1]) | (low[1:] != low[:-1])
    differ_y = (flat[:, 1:] != flat[:, :-1]) | (low[:, 1:] != low[:, :-1])
    cache: _Cache = {}
    boxes = []
    for i0, i1 in itertools.pairwise(edges[0]):
        for j0, j1 in itertools.pairwise(edges[1]):
            if not flat[i0:i1, j0:j1].any():
                continue
            x = _cell_edges(i0, i1, differ_x[i0 : i1 - 1, j0:j1].any(axis=1))
            y = _cell_edges(j0, j1, differ_y[i0:i1, j0 : j1 - 1].any(axis=0))
            cells = np.ix_(x[:-1], y[:-1])
            for top, span in _decompose_block(flat[cells], low[cells], cache):
                a, b, c, d = span
                boxes.append((top, x[a], x[b], y[c], y[d], friction[i0, j0]))
    table = np.array(boxes, dtype=np.float64).reshape(-1, 6)
    # Only boxes of the same top and friction are merged; their number stands for both.
    pairs, number = np.unique(table[:, [0, 5]], axis=0, return_inverse=True)
    table = np.column_stack([number.reshape(-1), table[:, 1:5]])
    max_length = MAX_LENGTHS[0] // grid.cell, MAX_LENGTHS[1] // grid.cell
    short, long = merge_boxes(table, max_length), merge_boxes(table)
    # Short boxes are faster in MuJoCo's bounding volume hierarchy, unless there are twice as many.
    merged = long if 2 * len(long) <= len(short) else short
    number, i0, i1, j0, j1 = merged.T
    merged = merged[np.lexsort([i0, number, j0 + j1, i0 + i1])]
    return _make_boxes(merged, pairs, grid, float(heights.min()) - THICKNESS, flat)


def flat_cells(node_grid: NodeGrid) -> NDArray[np.bool_]:
    """Return which cells of a heightfield are flat, shape (nx - 2, ny - 2).

    A cell consists of a quarter of each of the four quads around its sample. It is flat if, in
    each quad, its corner is connected without a wall only to corners of the same height.
    """
    z = node_grid.z
    differ_x, differ_y = z[1:] != z[:-1], z[:, 1:] != z[:, :-1]
    corner = ~(differ_x[:, :-1] | differ_x[:, 1:] | differ_y[:-1] | differ_y[1:])
    x = differ_x.astype(np.uint8) + node_grid.walls_x
    y = differ_y.astype(np.uint8) + node_grid.walls_y
    quads = np.flatnonzero(node_grid.has_wall)
    i, j = np.divmod(quads, corner.shape[1])
    at_walls = flat_corners(np.stack([x[i, j], y[i + 1, j], x[i, j + 1], y[i, j]]))

    flat = np.ones(z.shape, dtype=bool)
    halves = (slice(None, -1), slice(1, None))
    for k, (a, b) in enumerate(((0, 0), (1, 0), (1, 1), (0, 1))):
        corner.ravel()[quads] = at_walls[k]
        flat[halves[a], halves[b]] &= corner
    return flat[1:-1, 1:-1]


def _drop_patches_without_walls(
    flat: NDArray[np.bool_],
    node_grid: NodeGrid,
    patch_edges: tuple[NDArray[np.int64], NDArray[np.int64]],
) -> None:
    """Set `flat` to False in each patch that has slopes and no walls."""
    # The nodes begin one before the samples, so wall k is before sample k.
    walls_x, walls_y = node_grid.walls_x[:, 1:-1], node_grid.walls_y[1:-1]
    x, y = patch_edges
    for i0, i1 in itertools.pairwise(x.tolist()):
        for j0, j1 in itertools.pairwise(y.tolist()):
            patch = (slice(i0, i1), slice(j0, j1))
            has_wall = walls_x[i0 : i1 + 1, j0:j1].any() or walls_y[i0:i1, j0 : j1 + 1].any()
            if not (flat[patch].all() or has_wall):
                flat[patch] = False


def _decompose_block(
    flat: NDArray[np.bool_], low: NDArray[np.float32], cache: _Cache
) -> Iterator[tuple[float, Span]]:
    """Yield the top and the span of each box of a block of cells, in the order of their tops.

    The boxes depend only on the order of the heights. The rows of a curriculum often differ only
    in the height of their steps, so `cache` has the boxes of the blocks so far.
    """
    heights, ranks = np.unique(low, return_inverse=True)
    ranks = ranks.reshape(low.shape)
    key = (low.shape, flat.tobytes(), ranks.tobytes())
    if key not in cache:
        cache[key] = list(_decompose_heights(flat, ranks))
    for rank, span in cache[key]:
        yield float(heights[rank]), span


def _decompose_heights(
    flat: NDArray[np.bool_], ranks: NDArray[np.int64]
) -> Iterator[tuple[int, Span]]:
    """Yield the rank of the top and the span of each box, in the order of their tops."""
    tops = np.unique(ranks[flat]).tolist()
    part = (slice(0, flat.shape[0]), slice(0, flat.shape[1]))
    for top in tops:
        required = flat & (ranks == top)
        if len(tops) > MAX_HEIGHTS_PER_BLOCK:
            part = _bounds(required.any(axis=1)), _bounds(required.any(axis=0))
        i, j = part[0].start, part[1].start
        for a, b, c, d in decompose_rectangles(required[part], ranks[part] >= top):
            yield top, (i + a, i + b, j + c, j + d)


def _cell_edges(start: int, stop: int, differ: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the cells from `start` that differ from the previous cell, and `stop`."""
    return np.concatenate([[start], np.flatnonzero(differ) + start + 1, [stop]])


def changes(values: NDArray[Any]) -> NDArray[np.int64]:
    """Return the rows that differ from the previous row.

    Args:
        values: Rows, shape (n, k).

    Returns:
        Increasing indices of rows, from 0 to n, both included.
    """
    if values.strides[0] == 0:  # a view that repeats one row
        return np.array([0, len(values)])
    differ = (values[1:] != values[:-1]).any(axis=1)
    return np.concatenate([[0], np.flatnonzero(differ) + 1, [len(values)]])


def _bounds(mask: NDArray[np.bool_]) -> slice:
    """Return the range from the first to the last True."""
    index = np.flatnonzero(mask)
    return slice(index[0], index[-1] + 1)


def merge_boxes(
    boxes: NDArray[np.float64], max_length: tuple[float, float] = (np.inf, np.inf)
) -> NDArray[np.float64]:
    """Merge boxes of the same top that share a whole side until none do.

    Args:
        boxes: Top or another key, and cells i0 to i1 and j0 to j1 of each box, shape (n, 5).
        max_length: Cells along x and y after which a row of merged boxes is divided.
    """
    before = -1
    while len(boxes) != before:
        before = len(boxes)
        for length in max_length:
            boxes = _merge_along_x(boxes, length)[:, [0, 3, 4, 1, 2]]
    return boxes


def _merge_along_x(boxes: NDArray[np.float64], max_length: float) -> NDArray[np.float64]:
    """Merge boxes of the same top, j0 and j1 that touch, shape (n, 5)."""
    top, i0, i1, j0, j1 = boxes[np.lexsort(boxes.T[[2, 1, 4, 3, 0]])].T
    other = np.ones(len(top), dtype=bool)
    other[1:] = (np.diff(top) != 0) | (np.diff(j0) != 0) | (np.diff(j1) != 0)
    # The largest i1 so far, which starts again in every group of the same top, j0 and j1.
    # An offset that is larger than all i1 restarts the running maximum in each group.
    group = np.cumsum(other) * (i1.max(initial=0) + 1)
    reach = np.maximum.accumulate(i1 + group) - group
    first = other.copy()
    first[1:] |= i0[1:] > reach[:-1]
    start = i0[np.maximum.accumulate(np.where(first, np.arange(len(i0)), 0))]
    first[1:] |= np.diff((i0 - start) // max_length) > 0
    last = np.roll(first, -1)
    return np.column_stack([top[first], i0[first], reach[last], j0[first], j1[first]])


def _make_boxes(
    boxes: NDArray[np.float64],
    pairs: NDArray[np.float64],
    grid: Grid,
    bottom: float,
    flat: NDArray[np.bool_],
) -> BoxDecomposition:
    """Return the boxes, given the number of their top [m] and friction in `pairs`, and cells."""
    number, i0, i1, j0, j1 = boxes.T
    top, friction = pairs[number.astype(int)].T
    x, y = grid.lower
    lower = np.column_stack([i0 * grid.cell + x, j0 * grid.cell + y, np.full(len(top), bottom)])
    upper = np.column_stack([i1 * grid.cell + x, j1 * grid.cell + y, top])
    return BoxDecomposition(
        centers=(lower + upper) / 2,
        half_sizes=(upper - lower) / 2,
        friction=friction.astype(np.float32),
        box_mask=flat,
    )

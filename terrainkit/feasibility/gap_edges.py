"""Gap edges: from one component to another, over ground without a foothold."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from terrainkit.feasibility.columns import Columns
from terrainkit.feasibility.edges import Edges
from terrainkit.feasibility.foothold_graph import FootholdGraph, ratio
from terrainkit.feasibility.node_arrays import FloatArray, IntArray

MAX_PAIRS = 100_000
"""Pairs of nodes that are compared at once, to bound the memory."""

_MAX_ENDS = 4
"""Largest number of gaps from a node to a component; the easiest are kept. Easy steps join the
nodes of a component, so it does not matter where a gap ends, unless there is a wall in between."""

_MAX_SEARCHED_ENDS = 16
"""The same where one gap into each component is enough: most are not evaluated."""

_LEVELS = 32
"""Images of the floors at different heights."""

_MORE = 8
"""Factor by which more gaps into a component are tried where the easiest lead through a wall."""


def gap_edges(
    graph: FootholdGraph,
    components: IntArray,
    start_mask: NDArray[np.bool_],
    end_mask: NDArray[np.bool_],
    max_demand: float,
    *,
    one_each: bool = False,
) -> Edges:
    """Return the edges over gaps with a demand below `max_demand`.

    An edge joins two components. In between, the body passes above the higher node, over
    any hurdle, and below any solid.

    Args:
        graph: The graph.
        components: Component of each node, which steps join below `max_demand`, shape (nodes,).
        start_mask: Nodes where an edge may start, shape (nodes,).
        end_mask: Nodes where an edge may end, shape (nodes,).
        max_demand: Demand above which an edge is of no use.
        one_each: Whether one edge into each component is enough; then not all are searched.
    """
    parts = [graph.steps.select(slice(0))]
    is_entered = np.zeros(len(components), dtype=bool)
    for batch in _batches(_pairs(graph, components, start_mask, end_mask, max_demand)):
        pairs = batch.select(~is_entered[components[batch.end]]) if one_each else batch
        number = _MAX_SEARCHED_ENDS if one_each else _MAX_ENDS
        pairs = pairs.select(_best_pairs(graph, pairs, number, components[pairs.end], pairs.start))
        pairs = _between_tops(graph.columns, pairs)
        number = 1 if one_each else len(pairs.start)
        while len(pairs.start):
            order = _best_pairs(graph, pairs, number, components[pairs.end])
            parts.append(_evaluate(graph, pairs.select(order), max_demand))
            is_entered[components[parts[-1].end]] = True
            is_left = ~is_entered[components[pairs.end]]
            is_left[order] = False
            pairs = pairs.select(is_left)
            number = number * _MORE
    return Edges.concatenate(parts)


def _batches(parts: Iterable[Edges]) -> Iterator[Edges]:
    """Yield the edges of all parts in batches of at least `MAX_PAIRS`, except for the last."""
    batch = []
    number = 0
    for part in parts:
        batch.append(part)
        number += len(part.start)
        if number >= MAX_PAIRS:
            yield Edges.concatenate(batch)
            batch = []
            number = 0
    if batch:
        yield Edges.concatenate(batch)


def _pairs(
    graph: FootholdGraph,
    components: IntArray,
    start_mask: NDArray[np.bool_],
    end_mask: NDArray[np.bool_],
    max_demand: float,
) -> Iterator[Edges]:
    """Yield the gaps that may be useful, as if nothing was in between; see `gap_edges`."""
    columns, floor = graph.columns, graph.columns.floor.reshape(-1)
    shape = columns.floor.shape
    max_rise, max_drop = max_demand * graph.limits.step_up, max_demand * graph.limits.step_down
    # The side of a solid is within a column of a node, not halfway.
    more = 0.0 if columns.tops is None else columns.spacing
    moves, widths = _offsets(columns, max_demand * graph.limits.gap + more)
    n = int(moves.max(initial=0))
    is_usable = graph.node_demand < max_demand
    is_end = (end_mask & is_usable).reshape(shape)
    starts, ends = np.flatnonzero(start_mask & is_usable), np.flatnonzero(is_end)
    # Most nodes are in one component, and few of them near the ends in others.
    main = np.argmax(np.bincount(components[ends], minlength=1))
    max_height = max(max_rise, max_drop)
    near = _have_end_near(columns, starts, ends, n, max_height)
    in_main = near & (components[starts] == main)
    others = ends[components[ends] != main]
    near[in_main] = _have_end_near(columns, starts[in_main], others, n, max_height)
    start = starts[near]
    # The nodes where an edge may end, in a frame of columns without any.
    node = np.where(is_end, np.arange(is_end.size).reshape(shape), -1)
    node = np.pad(node, ((n, n), (n, n), (0, 0)), constant_values=-1)
    _, ny, m = node.shape
    offset = (((moves[:, :1] * ny + moves[:, 1:]) * m) + np.arange(m)).reshape(-1)
    gap = np.repeat(widths, m)
    i, j = columns.column(start)
    place = ((i + n) * ny + j + n) * m
    size = max(MAX_PAIRS // max(len(offset), 1), 1)
    for first in range(0, len(start), size):
        end = node.reshape(-1)[place[first : first + size, None] + offset]
        which, move = np.nonzero(end >= 0)
        begin, end, width = start[first + which], end[which, move], gap[move]
        rise = floor[end] - floor[begin]
        useful = (rise < max_rise) & (-rise < max_drop) & (components[begin] != components[end])
        none = np.full(np.count_nonzero(useful), np.inf)
        yield Edges(
            start=begin[useful],
            end=end[useful],
            rise=np.maximum(rise[useful], 0.0),
            drop=np.maximum(-rise[useful], 0.0),
            gap=width[useful],
            clearance=none,
            width=none,
        )


def _have_end_near(
    columns: Columns, starts: IntArray, ends: IntArray, reach: int, max_height: float
) -> NDArray[np.bool_]:
    """Return which nodes may have an end within some columns and some height, shape (starts,)."""
    import cv2

    # Floors that are `_LEVELS` apart, such as those of tall buildings, share an image.
    level = columns.floor.reshape(-1) // max_height
    image = np.zeros((*columns.shape, _LEVELS), np.uint8)
    for shift in (-1, 0, 1):
        image[(*columns.column(ends), (level[ends] + shift).astype(np.int64) % _LEVELS)] = 1
    image = cv2.dilate(image, np.ones((2 * reach + 1,) * 2, np.uint8))
    at = (*columns.column(starts), level[starts].astype(np.int64) % _LEVELS)
    return np.asarray(image[at] > 0)


def _offsets(columns: Columns, max_gap: float) -> tuple[IntArray, FloatArray]:
    """Return the moves over gaps below `max_gap` [m] in columns, shape (n, 2), and their gaps."""
    # Along the longer axis, the gap is a column narrower than the distance of the nodes: far - 1 <
    # max_gap / spacing.
    n = min(math.ceil(max_gap / columns.spacing), max(columns.shape))
    moves = np.argwhere(np.ones((2 * n + 1, 2 * n + 1))) - n
    near, far = np.abs(moves).min(axis=1), np.abs(moves).max(axis=1)
    # The line leaves the cell of each node after half a column along the longer axis, which is the
    # share 1/2 / far of its length: 1 - 1 / far of it is outside of both cells. Cells that touch at
    # a corner are as far apart as the circles in them: sqrt(2) - 1 columns, which is 1 - sqrt(1/2)
    # of the distance of their centers. Steps join the cells that share a side.
    outside = np.where(far > 1, 1.0 - 1.0 / np.maximum(far, 1), 1.0 - 0.5**0.5)
    gaps = np.hypot(near, far) * columns.spacing * outside
    useful = ((far > 1) | (near > 0)) & (gaps < max_gap)
    return moves[useful], gaps[useful]


def _between_tops(columns: Columns, pairs: Edges) -> Edges:
    """Return the pairs with the exact gaps between the tops of solids."""
    if columns.tops is None or not len(pairs.start):
        return pairs
    nodes = pairs.start, pairs.end
    start, end = (columns.positions(node)[:, :2] for node in nodes)
    gaps = columns.tops.gaps(nodes, (start, end), pairs.gap, columns.spacing)
    return replace(pairs, gap=gaps)


def _best_pairs(graph: FootholdGraph, pairs: Edges, number: int, *keys: IntArray) -> IntArray:
    """Return, for each combination of keys, the pairs with the `number` smallest demands."""
    order = np.lexsort((graph.demand(pairs), *keys))
    same = [key[order[number:]] == key[order[:-number]] for key in keys]
    is_first = np.ones(len(order), dtype=bool)
    is_first[number:] = ~np.logical_and.reduce(same)
    return order[is_first]


def _evaluate(graph: FootholdGraph, pairs: Edges, max_demand: float) -> Edges:
    """Return the pairs with rise, drop, clearance and width, if their demand is below the limit."""
    if not len(pairs.start):
        return pairs
    floor = graph.columns.floor.reshape(-1)
    top, clearance = _between(graph, pairs.start, pairs.end)
    rise, drop = top - floor[pairs.start], top - floor[pairs.end]
    edges = replace(pairs, rise=rise, drop=drop, clearance=clearance)
    return _with_width(graph, edges.select(graph.demand(edges) < max_demand), max_demand)


def _between(graph: FootholdGraph, start: IntArray, end: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return the highest point of the way over each gap, and the least clearance there [m]."""
    columns = graph.columns
    floor = columns.floor.reshape(-1)
    level = np.maximum(floor[start], floor[end])
    top, clearance = level.copy(), np.full(len(start), np.inf)
    for a, b, inside in _line(columns, start, end):
        above, free = _pass_columns(graph, (a, b), level[inside], floor[start[inside]])
        top[inside] = np.maximum(top[inside], above)
        clearance[inside] = np.minimum(clearance[inside], free)
    return top, clearance


def _pass_columns(
    graph: FootholdGraph, place: tuple[IntArray, IntArray], level: FloatArray, start: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the height at which the body passes each column, and the clearance there [m].

    The body takes the free interval with the smallest demand. The clearance is -inf if there is no
    free interval.

    Args:
        graph: The graph.
        place: Index of each column.
        level: Least height of the body [m].
        start: Height of the node where it starts [m].
    """
    columns = graph.columns
    floors, ceilings = (z[place].T for z in (columns.floor, columns.ceiling))
    top, least = np.fmax(floors[0], level), np.full(len(level), np.inf)
    clearance = -least
    for floor, ceiling in zip(floors, ceilings, strict=True):
        above = np.fmax(floor, level)
        free = ceiling - above
        cost = np.maximum(
            ratio("step_up", above - start, graph.limits),
            ratio("crouched_height", free, graph.limits),
        )
        cost[~(free > 0)] = np.inf
        is_least = cost < least
        least = np.where(is_least, cost, least)
        top = np.where(is_least, above, top)
        clearance = np.where(is_least, free, clearance)
    return top, clearance


def _with_width(graph: FootholdGraph, edges: Edges, max_demand: float) -> Edges:
    """Return the edges with the free width between walls at the height of the body."""
    floor = graph.columns.floor.reshape(-1)
    level = np.maximum(floor[edges.start], floor[edges.end])
    lines = list(_line(graph.columns, edges.start, edges.end))
    if not lines:
        return edges
    i, j, inside = (np.concatenate(parts) for parts in zip(*lines, strict=True))
    width = edges.width.copy()
    found = graph.free_width.at(i, j, level[inside], edges.clearance[inside])
    np.minimum.at(width, inside, found)
    edges = replace(edges, width=width)
    return edges.select(graph.demand(edges) < max_demand)


def _line(
    columns: Columns, start: IntArray, end: IntArray
) -> Iterator[tuple[IntArray, IntArray, IntArray]]:
    """Yield the columns between the nodes of each edge: x and y index, and index of the edge."""
    (i, j), (i2, j2) = columns.column(start), columns.column(end)
    di, dj = i2 - i, j2 - j
    count = 2 * np.maximum(np.abs(di), np.abs(dj))  # points half a column apart
    for n in range(1, int(count.max(initial=0))):
        inside = np.flatnonzero(n < count)
        t, x, y = n / count[inside], i[inside], j[inside]
        a = np.rint(x + t * di[inside]).astype(np.int64)
        b = np.rint(y + t * dj[inside]).astype(np.int64)
        own = ((a == x) & (b == y)) | ((a == i2[inside]) & (b == j2[inside]))
        between = ~own
        yield a[between], b[between], inside[between]

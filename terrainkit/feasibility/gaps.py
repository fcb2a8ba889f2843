"""Gap edges: from the rim of one region to the rim of another, over ground without a foothold."""

import numpy as np
from numpy.typing import NDArray

from terrainkit.feasibility.columns import Columns, FloatArray, IntArray
from terrainkit.feasibility.edges import Edges
from terrainkit.feasibility.foothold_graph import FootholdGraph, ratio
from terrainkit.feasibility.regions import Regions

_MAX_PAIRS = 200_000
"""Pairs of nodes that are evaluated at once, to bound the memory."""

_MAX_ENDS = 4
"""Largest number of gaps from a node to a region, the narrowest ones. Steps of little demand join
the nodes of a region, so it does not matter where a gap ends, unless there is a wall in between."""


def gap_edges(graph: FootholdGraph, regions: Regions, max_demand: float) -> Edges:
    """Return the edges over gaps with a demand below `max_demand`, in both directions.

    An edge joins two regions. In between, the body passes above the higher one of both nodes, over
    any hurdle, and below any solid.

    Args:
        graph: The graph.
        regions: What the steps join.
        max_demand: Demand above which an edge is of no use.
    """
    from scipy.spatial import cKDTree

    limits, columns, steps = graph.limits, graph.columns, graph.steps
    nodes = _rim(graph, regions)
    nodes = nodes[graph.node_demand[nodes] < max_demand]
    if len(nodes) < 2:
        return steps.select(np.zeros(len(steps.start), dtype=bool))
    points = columns.positions(nodes)
    # The gap is shorter than the distance of the nodes by a column, or by up to sqrt(2) of it.
    reach = max_demand * limits.gap + 1.5 * columns.spacing
    height = max_demand * max(limits.step_up, limits.step_down)
    # A slab of this height, and no cylinder around it, would be exact; the rest is dropped below.
    pairs = cKDTree(points / (reach, reach, height)).query_pairs(2**0.5, output_type="ndarray")
    first, second = nodes[pairs[:, 0]], nodes[pairs[:, 1]]
    start, end = _candidates(
        graph, regions, np.concatenate([first, second]), np.concatenate([second, first]), max_demand
    )
    parts = [
        _evaluate(graph, start[n : n + _MAX_PAIRS], end[n : n + _MAX_PAIRS], max_demand)
        for n in range(0, max(len(start), 1), _MAX_PAIRS)
    ]
    return Edges.concatenate(parts)


def _rim(graph: FootholdGraph, regions: Regions) -> IntArray:
    """Return the nodes with a neighboring column where no node is joined to them."""
    columns, steps = graph.columns, graph.steps
    nx, ny = columns.shape
    m = columns.floor.shape[2]
    same = regions.joined(steps.start, steps.end, graph.node_demand[steps.start])
    start, end = steps.start[same], steps.end[same]
    has_neighbor = np.zeros((columns.floor.size, 4), dtype=bool)
    move = end // m - start // m
    for side, offset in enumerate((ny, -ny, 1, -1)):
        has_neighbor[start[move == offset], side] = True
    at = has_neighbor.reshape(nx, ny, m, 4)
    at[-1, :, :, 0] = at[0, :, :, 1] = at[:, -1, :, 2] = at[:, 0, :, 3] = True  # the patch ends
    is_node = ~np.isnan(columns.floor.reshape(-1))
    return np.flatnonzero(is_node & ~has_neighbor.all(axis=1))


def _candidates(
    graph: FootholdGraph, regions: Regions, start: IntArray, end: IntArray, max_demand: float
) -> tuple[IntArray, IntArray]:
    """Return the pairs whose gap may be useful: the narrowest from each node to each region."""
    limits, floor = graph.limits, graph.columns.floor.reshape(-1)
    gap, is_apart = _gap_widths(graph.columns, start, end)
    rise = floor[end] - floor[start]
    demand = np.maximum.reduce(
        [
            graph.node_demand[start],
            graph.node_demand[end],
            gap / limits.gap,
            rise / limits.step_up,
            -rise / limits.step_down,
        ]
    )
    useful = is_apart & (demand < max_demand)
    start, end, demand = start[useful], end[useful], demand[useful]
    apart = ~regions.joined(start, end, demand)
    start, end, demand = start[apart], end[apart], demand[apart]
    region = regions.labels[0, end]
    order = np.lexsort((demand, region, start))
    start, end, region = start[order], end[order], region[order]
    is_first = np.ones(len(start), dtype=bool)
    is_first[_MAX_ENDS:] = (start[_MAX_ENDS:] != start[:-_MAX_ENDS]) | (
        region[_MAX_ENDS:] != region[:-_MAX_ENDS]
    )
    return start[is_first], end[is_first]


def _gap_widths(
    columns: Columns, start: IntArray, end: IntArray
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return the width of the gap between two nodes [m], and whether they are not neighbors."""
    (i, j), (i2, j2) = columns.column(start), columns.column(end)
    dx, dy = np.abs(i2 - i), np.abs(j2 - j)
    far = np.maximum(dx, dy)
    # The line leaves the cell of each node after half a column along the longer axis. Cells that
    # touch at a corner are as far apart as the circles in them.
    outside = np.where(far > 1, 1.0 - 1.0 / np.maximum(far, 1), 1.0 - 0.5**0.5)
    return np.hypot(dx, dy) * columns.spacing * outside, (far > 1) | ((dx > 0) & (dy > 0))


def _evaluate(graph: FootholdGraph, start: IntArray, end: IntArray, max_demand: float) -> Edges:
    """Return the edges from `start` to `end` whose demand is below `max_demand`."""
    floor = graph.columns.floor.reshape(-1)
    gap, _ = _gap_widths(graph.columns, start, end)
    top, clearance = _between(graph, start, end)
    edges = Edges(
        start=start,
        end=end,
        rise=top - floor[start],
        drop=top - floor[end],
        gap=gap,
        clearance=clearance,
        width=np.full(len(start), np.inf),
    )
    edges = edges.select(graph.demand(edges) < max_demand)
    return _with_width(graph, edges, max_demand)


def _between(graph: FootholdGraph, start: IntArray, end: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return the highest point of the way over each gap, and the least clearance there [m]."""
    columns = graph.columns
    floor = columns.floor.reshape(-1)
    level = np.maximum(floor[start], floor[end])
    top, clearance = level.copy(), np.full(len(start), np.inf)
    for place, inside in _line(columns, start, end):
        above, free = _passed(graph, place, level[inside], floor[start[inside]])
        top[inside] = np.maximum(top[inside], above)
        clearance[inside] = np.minimum(clearance[inside], free)
    return top, clearance


def _passed(
    graph: FootholdGraph, place: tuple[IntArray, IntArray], level: FloatArray, start: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the height at which the body passes each column, and the clearance there [m].

    Of several intervals, the body takes the one with the least demand. The clearance is -inf if it
    passes through none.

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
    lines = _line(graph.columns, edges.start, edges.end)
    if not lines:
        return edges
    i, j = (np.concatenate([place[axis] for place, _ in lines]) for axis in (0, 1))
    inside = np.concatenate([inside for _, inside in lines])
    width = edges.width.copy()
    found = graph.passages.widths(i, j, level[inside], edges.clearance[inside])
    np.minimum.at(width, inside, found)
    edges = Edges(**{**vars(edges), "width": width})
    return edges.select(graph.demand(edges) < max_demand)


def _line(
    columns: Columns, start: IntArray, end: IntArray
) -> list[tuple[tuple[IntArray, IntArray], NDArray[np.int64]]]:
    """Return the columns between the nodes of each edge: those at each place, and their edges."""
    (i, j), (i2, j2) = columns.column(start), columns.column(end)
    di, dj = i2 - i, j2 - j
    count = 2 * np.maximum(np.abs(di), np.abs(dj))  # points half a column apart
    lines = []
    for n in range(1, int(count.max(initial=0))):
        inside = np.flatnonzero(n < count)
        t, x, y = n / count[inside], i[inside], j[inside]
        a = np.rint(x + t * di[inside]).astype(np.int64)
        b = np.rint(y + t * dj[inside]).astype(np.int64)
        own = ((a == x) & (b == y)) | ((a == i2[inside]) & (b == j2[inside]))
        between = ~own
        lines.append(((a[between], b[between]), inside[between]))
    return lines

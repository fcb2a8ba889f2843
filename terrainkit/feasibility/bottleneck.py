"""Bottleneck paths: among all paths between two sets of nodes, one whose largest demand is least.

The demand of an edge depends on its direction: a robot may jump down where it cannot climb up.
Minimax paths on a directed graph do not follow from a minimum spanning tree; the smallest demand
at which the target can be reached is found by bisection.
"""

from bisect import bisect_left
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.feasibility.edges import Edges
from terrainkit.feasibility.node_arrays import FloatArray, IntArray

Segment = tuple[int, IntArray]
"""A piece of the path: a start node, and target nodes. The path ends at any of the targets."""


def find_components(edges: Edges, mask: NDArray[np.bool_], num_nodes: int) -> IntArray:
    """Return the number of the strongly connected component of each node, shape (num_nodes,).

    Args:
        edges: The edges.
        mask: Which edges join nodes, shape (n,).
        num_nodes: Number of nodes.
    """
    from scipy.sparse.csgraph import connected_components

    graph = _matrix(edges, mask, num_nodes)
    labels = connected_components(graph, directed=True, connection="strong")[1]
    return np.asarray(labels, dtype=np.int64)


def bottleneck(edges: Edges, demand: FloatArray, segment: Segment, num_nodes: int) -> float:
    """Return the smallest demand at which a path leads from the start of a segment to its targets.

    Args:
        edges: The edges.
        demand: Demand of each edge, shape (n,).
        segment: Start node, and target nodes of shape (t,). The path ends at any of the targets.
        num_nodes: Number of nodes.

    Returns:
        The largest demand of an edge of the path; 0 if its start is a target, inf without a path.
    """
    start, targets = segment
    if (targets == start).any():
        return 0.0
    order = np.argsort(edges.start, kind="stable")
    rows = np.searchsorted(edges.start[order], np.arange(num_nodes + 1))
    end, demand = edges.end[order], demand[order]
    # A path is possible at every demand above the smallest one, so bisection finds it.
    levels = np.unique(demand[np.isfinite(demand)])
    number = bisect_left(
        levels, True, key=lambda level: _reaches(rows, end, demand <= level, start, targets)
    )
    return float(levels[number]) if number < len(levels) else float("inf")


def shortest_path(
    edges: Edges, length: FloatArray, start: int, targets: IntArray, num_nodes: int
) -> IntArray | None:
    """Return the edges of a shortest path from `start` to one of `targets`; None without one.

    Args:
        edges: The edges.
        length: Length of each edge, shape (n,).
        start: The first node.
        targets: Nodes at which the path may end, shape (t,).
        num_nodes: Number of nodes.

    Returns:
        Indices of the edges along the path, shape (k,).
    """
    from scipy.sparse.csgraph import dijkstra

    # Parallel edges would be added up: keep the shortest of each pair.
    key = edges.start * num_nodes + edges.end
    order = np.lexsort((length, key))
    order = order[np.concatenate([[True], np.diff(key[order]) > 0])] if len(order) else order
    matrix = _matrix(edges, order, num_nodes, length)
    distance, before = dijkstra(matrix, indices=start, return_predecessors=True)
    target = int(targets[np.argmin(distance[targets])]) if len(targets) else start
    if not len(targets) or not np.isfinite(distance[target]):
        return None
    nodes = [target]
    while nodes[-1] != start:
        nodes.append(int(before[nodes[-1]]))
    path = np.array(nodes[::-1], dtype=np.int64)
    wanted = path[:-1] * num_nodes + path[1:]
    return np.asarray(order[np.searchsorted(key[order], wanted)])


def _reaches(
    rows: IntArray, end: IntArray, mask: NDArray[np.bool_], start: int, targets: IntArray
) -> bool:
    """Return whether usable edges lead from `start` to a target.

    Args:
        rows: Number of the first edge of each node, and the number of edges, shape (nodes + 1,).
        end: Second node of each edge, in the order of the first nodes.
        mask: Which edges the path may use.
        start: The first node.
        targets: Nodes at which the path may end.
    """
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import breadth_first_order

    # No sorting is needed: the edges stay in the order of the rows when some are left out.
    before = np.concatenate([[0], np.cumsum(mask)])[rows].astype(np.int32)
    values = np.ones(int(before[-1]))
    size = len(rows) - 1
    graph = csr_matrix((values, end[mask].astype(np.int32), before), shape=(size, size))
    reached = breadth_first_order(graph, start, return_predecessors=False)
    return bool(np.isin(targets, reached).any())


def _matrix(edges: Edges, index: Any, num_nodes: int, weight: FloatArray | None = None) -> Any:
    from scipy.sparse import csr_matrix

    start, end = edges.start[index], edges.end[index]
    values = np.ones(len(start)) if weight is None else weight[index]
    return csr_matrix((values, (start, end)), shape=(num_nodes, num_nodes))

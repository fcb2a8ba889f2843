"""Bottleneck paths: among all paths between two sets of nodes, one whose largest demand is least.

The demand of an edge depends on its direction: a robot may jump down where it cannot climb up.
Minimax paths on a directed graph do not follow from a minimum spanning tree; the smallest demand
at which the target can be reached is found by bisection.
"""

from bisect import bisect_left
from typing import Any

import numpy as np

from terrainkit.feasibility.node_arrays import FloatArray, IntArray

_LIMITS = (4.0, 16.0, float("inf"))
"""Lengths up to which a path is searched one after the other [m]; most goals are near."""

Segment = tuple[int, IntArray]
"""A piece of the path: a start node, and target nodes. The path ends at any of the targets."""


def find_components(ends: IntArray, num_nodes: int) -> IntArray:
    """Return the number of the strongly connected component of each node, shape (num_nodes,).

    Args:
        ends: First and second node of each edge, shape (2, n).
        num_nodes: Number of nodes.
    """
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import connected_components

    # Parallel edges are added up; with them, the search for components might not end.
    graph = csr_matrix((np.ones(ends.shape[1]), (ends[0], ends[1])), shape=(num_nodes, num_nodes))
    labels = connected_components(graph, directed=True, connection="strong")[1]
    return np.asarray(labels, dtype=np.int64)


def bottleneck(ends: IntArray, demand: FloatArray, segment: Segment, num_nodes: int) -> float:
    """Return the smallest demand at which a path leads from the start of a segment to its targets.

    Args:
        ends: First and second node of each edge, shape (2, n).
        demand: Demand of each edge, shape (n,).
        segment: Start node, and target nodes of shape (t,). The path ends at any of the targets.
        num_nodes: Number of nodes.

    Returns:
        The largest demand of an edge of the path; 0 if its start is a target, inf without a path.
    """
    from scipy.sparse.csgraph import breadth_first_order

    start, targets = segment
    if (targets == start).any():
        return 0.0
    order = np.argsort(ends[0], kind="stable")  # fast, since most edges are sorted
    order = order[np.isfinite(demand[order])]
    ends, demand = ends.take(order, axis=1), demand[order]

    def reaches(level: float) -> bool:
        graph = _matrix(ends.take(np.flatnonzero(demand <= level), axis=1), num_nodes)
        reached = breadth_first_order(graph, start, return_predecessors=False)
        return bool(np.isin(targets, reached).any())

    if not reaches(np.inf):
        return float("inf")
    # A path is possible at every demand above the smallest one, so bisection finds it.
    levels = np.unique(demand)
    return float(levels[bisect_left(levels[:-1], True, key=reaches)])


def shortest_path(
    ends: IntArray, length: FloatArray, start: int, targets: IntArray, num_nodes: int
) -> IntArray | None:
    """Return the edges of a shortest path from `start` to one of `targets`; None without one.

    Args:
        ends: First and second node of each edge, shape (2, n).
        length: Length of each edge, shape (n,).
        start: The first node.
        targets: Nodes at which the path may end, shape (t,).
        num_nodes: Number of nodes.

    Returns:
        Indices of the edges along the path, shape (k,).
    """
    from scipy.sparse.csgraph import dijkstra

    key = ends[0] * num_nodes + ends[1]
    order = np.argsort(key, kind="stable")  # fast, since most edges are sorted
    if (np.diff(key[order]) == 0).any():
        # Parallel edges would be added up: keep the shortest of each pair.
        order = np.lexsort((length, key))
        order = order[np.append(True, np.diff(key[order]) > 0)]
    matrix = _matrix(ends.take(order, axis=1), num_nodes, length[order])
    for limit in _LIMITS:
        distance, before = dijkstra(matrix, indices=start, return_predecessors=True, limit=limit)
        target = int(targets[np.argmin(distance[targets])]) if len(targets) else start
        if len(targets) and np.isfinite(distance[target]):
            break
    else:
        return None
    nodes = [target]
    while nodes[-1] != start:
        nodes.append(int(before[nodes[-1]]))
    path = np.array(nodes[::-1], dtype=np.int64)
    wanted = path[:-1] * num_nodes + path[1:]
    return np.asarray(order[np.searchsorted(key[order], wanted)])


def _matrix(ends: IntArray, num_nodes: int, weight: FloatArray | None = None) -> Any:
    """Return the matrix of edges in the order of their first nodes, which takes no sorting."""
    from scipy.sparse import csr_matrix

    rows = np.append(0, np.cumsum(np.bincount(ends[0], minlength=num_nodes))).astype(np.int32)
    values = np.ones(ends.shape[1]) if weight is None else weight
    return csr_matrix((values, ends[1].astype(np.int32), rows), shape=(num_nodes, num_nodes))

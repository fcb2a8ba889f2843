"""Bottleneck paths: among all paths between two sets of nodes, one whose largest demand is least.

The demand of an edge depends on its direction: a robot may jump down where it cannot climb up.
Minimax paths on a directed graph do not follow from a minimum spanning tree; the smallest demand
at which the target can be reached is found by bisection.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.feasibility.columns import FloatArray, IntArray
from terrainkit.feasibility.edges import Edges


def find_components(edges: Edges, usable: NDArray[np.bool_], num_nodes: int) -> IntArray:
    """Return the number of the strongly connected component of each node, shape (num_nodes,).

    Args:
        edges: The edges.
        usable: Which edges join nodes, shape (n,).
        num_nodes: Number of nodes.
    """
    from scipy.sparse.csgraph import connected_components

    graph = _matrix(edges, usable, num_nodes)
    labels = connected_components(graph, directed=True, connection="strong")[1]
    return np.asarray(labels, dtype=np.int64)


def bottleneck(
    edges: Edges, demand: FloatArray, start: int, targets: IntArray, num_nodes: int
) -> float:
    """Return the smallest demand at which a path leads from `start` to one of `targets`.

    Args:
        edges: The edges.
        demand: Demand of each edge, shape (n,).
        start: The first node.
        targets: Nodes of which the path reaches one, shape (t,).
        num_nodes: Number of nodes.

    Returns:
        The largest demand of an edge of the path; 0 if `start` is a target, inf without a path.
    """
    is_target = np.zeros(num_nodes, dtype=bool)
    is_target[targets] = True
    if is_target[start]:
        return 0.0
    levels = np.unique(demand[np.isfinite(demand)])
    low, high = 0, len(levels)  # the answer is levels[low] to levels[high]; the last stands for inf
    while low < high:
        middle = (low + high) // 2
        if _reaches(edges, demand <= levels[middle], start, is_target):
            high = middle
        else:
            low = middle + 1
    return float(levels[low]) if low < len(levels) else float("inf")


def shortest_path(
    edges: Edges, length: FloatArray, start: int, targets: IntArray, num_nodes: int
) -> IntArray | None:
    """Return the edges of a shortest path from `start` to one of `targets`; None without one.

    Args:
        edges: The edges.
        length: Length of each edge, shape (n,).
        start: The first node.
        targets: Nodes of which the path reaches one, shape (t,).
        num_nodes: Number of nodes.
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
    place: IntArray = order[np.searchsorted(key[order], wanted)]
    return place


def _reaches(
    edges: Edges, usable: NDArray[np.bool_], start: int, is_target: NDArray[np.bool_]
) -> bool:
    from scipy.sparse.csgraph import breadth_first_order

    graph = _matrix(edges, usable, len(is_target))
    reached = breadth_first_order(graph, start, return_predecessors=False)
    return bool(is_target[reached].any())


def _matrix(edges: Edges, which: Any, num_nodes: int, weight: FloatArray | None = None) -> Any:
    from scipy.sparse import csr_matrix

    start, end = edges.start[which], edges.end[which]
    values = np.ones(len(start)) if weight is None else weight[which]
    return csr_matrix((values, (start, end)), shape=(num_nodes, num_nodes))

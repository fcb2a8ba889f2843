"""Footholds: the diameter of the largest disk on level ground around each node."""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from terrainkit.feasibility.columns import Columns, FloatArray, IntArray
from terrainkit.feasibility.edges import Edges
from terrainkit.feasibility.limits import RobotLimits

EDGE_FRACTION = 0.5
"""A step of more than this fraction of the limits bounds a foothold. On the edge of a lower one, a
foot is supported on both sides."""


def foothold_sizes(columns: Columns, steps: Edges, limits: RobotLimits) -> FloatArray:
    """Return the diameter of the largest disk that covers each node and is on one surface [m].

    Larger disks than twice the smallest foothold are not distinguished.

    Args:
        columns: The columns.
        steps: Edges between neighboring columns; edges toward x and y are first.
        limits: The limits of the robot.

    Returns:
        Diameters [m], shape (nx, ny, m); 0 where there is no node.
    """
    edge = EDGE_FRACTION * min(limits.step_up, limits.step_down)
    max_size = math.ceil(2 * limits.foothold / columns.spacing - 1e-9)
    # The second half of the steps has the same edges in the opposite direction.
    half = len(steps.start) // 2
    flat = np.maximum(steps.rise[:half], steps.drop[:half]) <= edge
    start, end = steps.start[:half][flat], steps.end[:half][flat]
    sizes = np.zeros(columns.floor.size)
    for nodes, first, second in _surfaces(columns, start, end):
        sizes[nodes] = _surface_sizes(columns, nodes, first, second, max_size)
    return sizes.reshape(columns.floor.shape) * columns.spacing


def _surfaces(
    columns: Columns, start: IntArray, end: IntArray
) -> Iterator[tuple[IntArray, IntArray, IntArray]]:
    """Yield the nodes of each connected surface, and both ends of the edges between them.

    Where no solid hangs over the ground, all surfaces come at once. Elsewhere, two of them may
    share a column.
    """
    nodes = np.flatnonzero(~np.isnan(columns.floor))
    if columns.floor.shape[2] == 1:
        yield nodes, start, end
        return
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import connected_components

    size = columns.floor.size
    graph = csr_matrix((np.ones(len(start)), (start, end)), shape=(size, size))
    number, labels = connected_components(graph, directed=False)
    nodes = nodes[np.argsort(labels[nodes], kind="stable")]
    order = np.argsort(labels[start], kind="stable")
    start, end = start[order], end[order]
    every = np.arange(number + 1)
    node_ends = np.searchsorted(labels[nodes], every)
    edge_ends = np.searchsorted(labels[start], every)
    for k in np.flatnonzero(np.diff(node_ends)).tolist():
        edges = slice(edge_ends[k], edge_ends[k + 1])
        yield nodes[node_ends[k] : node_ends[k + 1]], start[edges], end[edges]


def _surface_sizes(
    columns: Columns, nodes: IntArray, start: IntArray, end: IntArray, max_size: int
) -> FloatArray:
    """Return the diameter at each node in columns, at most `max_size`, shape (nodes,).

    Vertical walls are halfway between two columns, so the surface is drawn with two pixels per
    column: one for the column, and one for the edge to the next.
    """
    import cv2

    if len(nodes) == 1:
        return np.ones(1)
    i, j = columns.column(nodes)
    low_i, low_j = int(i.min()), int(j.min())
    nx, ny = int(i.max()) - low_i + 1, int(j.max()) - low_j + 1
    is_free = np.zeros((2 * nx - 1, 2 * ny - 1), dtype=np.uint8)
    pixel = 2 * (i - low_i), 2 * (j - low_j)
    is_free[pixel] = 1
    (i1, j1), (i2, j2) = columns.column(start), columns.column(end)
    is_free[i1 + i2 - 2 * low_i, j1 + j2 - 2 * low_j] = 1
    along_x, along_y = is_free[1::2, ::2], is_free[::2, 1::2]
    is_free[1::2, 1::2] = along_x[:, :-1] & along_x[:, 1:] & along_y[:-1] & along_y[1:]
    is_free = _pad(is_free, columns, (low_i, low_j), (nx, ny))
    sizes = np.ones(len(nodes))
    if is_free.all():
        return np.full(len(nodes), float(max_size))
    # The wall of a node with a step beside it is one pixel away.
    distance = cv2.distanceTransform(is_free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    inner = pixel[0] + 1, pixel[1] + 1
    for radius in range(2, max_size + 1):
        centers = (distance < radius - 1e-3).astype(np.uint8)
        if centers.all():
            break
        covered = cv2.distanceTransform(centers, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[inner]
        sizes[covered < radius - 1e-3] = radius
    return sizes


def _pad(
    is_free: NDArray[np.uint8], columns: Columns, low: tuple[int, int], size: tuple[int, int]
) -> NDArray[np.uint8]:
    """Return the image with a frame of walls; at an edge of the patch, the ground continues."""
    framed = np.pad(is_free, 1)
    if low[0] == 0:
        framed[0] = framed[1]
    if low[0] + size[0] == columns.shape[0]:
        framed[-1] = framed[-2]
    if low[1] == 0:
        framed[:, 0] = framed[:, 1]
    if low[1] + size[1] == columns.shape[1]:
        framed[:, -1] = framed[:, -2]
    return framed

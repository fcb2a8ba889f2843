"""Footholds: the diameter of the largest disk on level ground around each node."""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from terrainkit.feasibility.columns import Columns
from terrainkit.feasibility.crossing_limits import RobotLimits
from terrainkit.feasibility.edges import Edges
from terrainkit.feasibility.node_arrays import FloatArray, IntArray
from terrainkit.feasibility.solid_tops import Tops

EDGE_FRACTION = 0.5
"""A step of more than this fraction of the limits bounds a foothold."""


def foothold_sizes(columns: Columns, steps: Edges, limits: RobotLimits) -> FloatArray:
    """Return the diameter of the largest disk that covers each node and is on one surface [m].

    A surface ends where the ground rises or falls, beyond its slope, by more than the steepest
    slope does across the smallest foothold: a foot on it would be tilted by more than that slope.
    Larger disks than twice the smallest foothold are not distinguished.

    Args:
        columns: The columns.
        steps: Edges between neighboring columns; edges toward x and y are first.
        limits: The limits of the robot.

    Returns:
        Diameters [m], shape (nx, ny, m); 0 where there is no node.
    """
    max_size = math.ceil(2 * limits.foothold / columns.spacing - 1e-9)
    # The second half of the steps has the same edges in the opposite direction.
    toward = steps.select(slice(len(steps.start) // 2))
    flat = _flat_steps(columns, toward, limits)
    start, end = toward.start[flat], toward.end[flat]
    sizes = np.zeros(columns.floor.size)
    for nodes, first, second in _surfaces(columns, start, end):
        sizes[nodes] = _surface_sizes(columns, nodes, first, second, max_size) * columns.spacing
    if columns.tops is not None:
        sizes = _with_tops(columns, columns.tops, sizes, (start, end), limits)
    return sizes.reshape(columns.floor.shape)


def _with_tops(
    columns: Columns,
    tops: Tops,
    sizes: FloatArray,
    steps: tuple[IntArray, IntArray],
    limits: RobotLimits,
) -> FloatArray:
    """Return the diameters with the exact ones on the tops of solids.

    Args:
        columns: The columns.
        tops: The solids of the columns.
        sizes: Diameters that the columns show [m], shape (nodes,).
        steps: Both ends of the steps that do not bound a foothold.
        limits: The limits of the robot.
    """
    import cv2

    solid = tops.solid.reshape(-1)
    max_size = 2 * limits.foothold
    on_solid = np.flatnonzero(solid >= 0)
    # The columns show solids that were widened to both sides.
    sizes[on_solid] = np.maximum(sizes[on_solid] - 2 * tops.widened[solid[on_solid]], 0.0)
    exact = np.full(len(sizes), np.nan)
    narrow = on_solid[sizes[on_solid] < max_size]
    xy = columns.positions(narrow)[:, :2]
    exact[narrow] = tops.sizes(narrow, xy, max_size, limits.slope)
    # A disk may reach beyond the top where another surface joins it, and less far where something
    # covers it.
    first, second = steps
    joined = np.zeros(columns.shape, dtype=bool)
    joined[columns.column(first[solid[first] != solid[second]])] = True
    reach = math.ceil(max_size / columns.spacing) + 1
    kernel = np.ones((2 * reach + 1,) * 2, np.uint8)
    is_covered, is_joined = (
        np.repeat(cv2.dilate(mask.astype(np.uint8), kernel).reshape(-1) > 0, columns.floor.shape[2])
        for mask in (tops.is_covered, joined)
    )
    known = ~np.isnan(exact) & ~is_covered & ~(is_joined & (sizes > exact))
    return np.where(known, exact, sizes)


def _flat_steps(columns: Columns, steps: Edges, limits: RobotLimits) -> NDArray[np.bool_]:
    """Return which steps do not bound a foothold, shape (n,).

    Args:
        columns: The columns.
        steps: Edges toward x and y.
        limits: The limits of the robot.
    """
    edge = EDGE_FRACTION * min(limits.step_up, limits.step_down)
    edge = min(edge, limits.slope * limits.foothold) + 1e-9
    step = steps.rise - steps.drop
    is_flat = np.abs(step) <= edge
    along_x = columns.column(steps.start)[0] != columns.column(steps.end)[0]
    is_rough = np.zeros(len(step), dtype=bool)
    for axis in (along_x, ~along_x):
        chains = [np.flatnonzero(is_flat & axis)]
        following = np.full(columns.floor.size, -1)
        following[steps.start[chains[0]]] = chains[0]
        rise = step[chains[0]]
        # Small steps may add up to an edge. `rise` is the sum of 2, 3, ... steps one after the
        # other, as many as fit on the smallest foothold; all steps of a sum above the edge are one.
        for _ in range(1, math.floor(limits.foothold / columns.spacing + 1e-9)):
            after = following[steps.end[chains[-1]]]
            chains = [chain[after >= 0] for chain in (*chains, after)]
            rise = rise[after >= 0] + step[chains[-1]]
            for chain in chains:
                is_rough[chain[np.abs(rise) > edge]] = True
    return is_flat & ~is_rough


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
    # A disk with a radius of r pixels is 2 r pixels wide, which is r columns. It fits where the
    # nearest wall is at least r away, and covers all nodes within r of such a place.
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

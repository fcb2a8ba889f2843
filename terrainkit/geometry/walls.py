"""Walls: edges between two samples at which the ground is vertical.

A quad is the square between four neighboring samples. Its corners are numbered counterclockwise
from the corner with the smallest x and y. Edge k runs from corner k to corner k + 1:

.. code-block:: text

    y   3 --2-- 2
    ^   |       |
    |   3       1
    |   |       |
    |   0 --0-- 1
    +-----------> x

An edge whose ends differ by more than a threshold is a wall, or an edge that an imported map marks
as one: the ground is flat from either end to
the midpoint of the edge, and vertical there. A quad with a wall is split along its midlines. The
edges that are not walls determine which corners share a height at its center.
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

_ROWS = 32

ALONG_X, ALONG_Y = np.uint8(1), np.uint8(2)
"""Bits of a sample (i, j) whose edge to (i + 1, j) or to (i, j + 1) is a wall."""

WallRule = float | NDArray[np.uint8]
"""Largest difference between neighboring samples that is not a wall [m]; infinite for no walls. Or
the bits of the walls of each sample, shape (nx, ny), where the difference does not decide."""


def wall_edges(
    heights: NDArray[np.floating], rule: WallRule
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which edges are walls.

    Args:
        heights: Samples [m], shape (nx, ny).
        rule: Which edges are walls.

    Returns:
        Masks of the edges along x, shape (nx - 1, ny), and along y, shape (nx, ny - 1).
    """
    if isinstance(rule, np.ndarray):
        return (rule[:-1] & ALONG_X) > 0, (rule[:, :-1] & ALONG_Y) > 0
    nx, ny = heights.shape
    x = np.empty((nx - 1, ny), dtype=bool)
    y = np.empty((nx, ny - 1), dtype=bool)
    # In blocks of rows, so that the differences stay in the cache and no large array is allocated.
    for i in range(0, nx, _ROWS):
        rows = heights[i : i + _ROWS + 1]
        np.greater(np.abs(np.diff(rows, axis=0)), rule, out=x[i : i + _ROWS])
        np.greater(np.abs(np.diff(rows[:_ROWS], axis=1)), rule, out=y[i : i + _ROWS])
    return x, y


def padded_rule(rule: WallRule) -> WallRule:
    """Return the rule of samples that are repeated once around a map."""
    if not isinstance(rule, np.ndarray):
        return rule
    padded = np.pad(rule, 1, mode="edge")
    padded[[0, -2, -1]] &= ALONG_Y
    padded[:, [0, -2, -1]] &= ALONG_X
    return padded


def steps_of_one_cell(heights: NDArray[np.float32], threshold: float) -> NDArray[np.uint8]:
    """Return the bits of the walls of a file, which is not known between its samples.

    A difference above the threshold is a wall unless the ground slopes on: a neighboring edge in
    line exceeds the threshold in the same direction, and is at least a third as high.

    Args:
        heights: Samples [m], shape (nx, ny).
        threshold: Difference from which an edge may be a wall [m].

    Returns:
        Bits of each sample, shape (nx, ny).
    """
    bits = np.zeros(heights.shape, np.uint8)
    for values, bit, target in ((heights, ALONG_X, bits), (heights.T, ALONG_Y, bits.T)):
        step = np.diff(values, axis=0)
        size, neighbors = np.abs(step), np.pad(step, ((1, 1), (0, 0)))
        # The neighbor that goes up or down as well, and not the other side of a narrow block.
        beside = np.maximum(neighbors[:-2] * np.sign(step), neighbors[2:] * np.sign(step))
        slopes_on = (beside > threshold) & (3 * beside >= size)
        target[:-1] |= bit * ((size > threshold) & ~slopes_on)
    return bits


def threshold_walls(heights: NDArray[np.float32], threshold: float) -> NDArray[np.uint8]:
    """Return the bits of the walls that the threshold alone gives, shape (nx, ny)."""
    bits = np.zeros(heights.shape, np.uint8)
    along_x, along_y = wall_edges(heights, threshold)
    bits[:-1] |= ALONG_X * along_x
    bits[:, :-1] |= ALONG_Y * along_y
    return bits


def file_walls(heights: NDArray[np.float32], threshold: float) -> NDArray[np.uint8] | None:
    """Return `steps_of_one_cell`, or None if the threshold alone gives the same walls."""
    walls = steps_of_one_cell(heights, threshold)
    return None if count_walls(heights, walls) == count_walls(heights, threshold) else walls


def count_walls(heights: NDArray[np.floating], rule: WallRule) -> int:
    """Return the number of edges that are walls."""
    return sum(int(np.count_nonzero(edges)) for edges in wall_edges(heights, rule))


def flat_corners(edges: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Return whether each corner of a quad is connected only to corners of its height, (4, n).

    Corners are connected by edges without a wall.

    Args:
        edges: Each edge of each quad: 0 level, 1 sloped, 2 a wall, shape (4, n).
    """
    a, b, c, d = edges
    return np.asarray(np.take(_flat_cases(), a | b << 2 | c << 4 | d << 6, axis=1))


def center_heights(corners: NDArray[np.floating], walls: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the height of the ground of each corner at the center of its quad, shape (n, 4).

    Connected corners share one height, so the surface has no cracks. Corners that are separated by
    walls have different heights, and the walls meet at the center.

    Args:
        corners: Heights of the corners [m], shape (n, 4).
        walls: Whether each edge is a wall, shape (n, 4).
    """
    # einsum is several times as slow for mixed types or another order in memory.
    corners = np.ascontiguousarray(corners, dtype=np.float64)
    return np.asarray(np.einsum("nij,nj->ni", _center_cases()[walls @ _CASE], corners))


def _connected(walls: NDArray[np.bool_]) -> NDArray[np.bool_]:
    connected = np.eye(4, dtype=bool)
    # Corners are at most three edges apart, and a pass may join only one of them.
    for _ in range(3):
        for k in range(4):
            if not walls[k]:
                connected[k] = connected[(k + 1) % 4] = connected[k] | connected[(k + 1) % 4]
    return connected


def _center_weights(connected: NDArray[np.bool_]) -> NDArray[np.float64]:
    weights = connected.astype(float)
    for k in range(4):
        if connected[k].sum() == 3:
            # Three corners define a plane; at the center it is midway between the outer two.
            missing = int(np.flatnonzero(~connected[k])[0])
            weights[k, (missing + 2) % 4] = 0.0
    weights /= weights.sum(axis=1, keepdims=True)
    return weights


# Each row of these tables is one of the 16 combinations of walls on four edges.
_CASE = np.array([1, 2, 4, 8])


@cache
def _connected_cases() -> NDArray[np.bool_]:
    return np.array([_connected((case & _CASE) > 0) for case in range(16)])


@cache
def _flat_cases() -> NDArray[np.bool_]:
    """Return whether each corner is flat, by the states of the edges, two bits each, (4, 256)."""
    edges = np.arange(256)[:, None] >> np.array([0, 2, 4, 6]) & 3
    connected = _connected_cases()[(edges == 2) @ _CASE]
    # An edge that slopes tilts the corners that are connected to its first corner.
    tilted = np.einsum("ak,akc->ca", edges == 1, connected)
    return np.asarray(~tilted, dtype=bool)


@cache
def _center_cases() -> NDArray[np.float64]:
    return np.array([_center_weights(connected) for connected in _connected_cases()])

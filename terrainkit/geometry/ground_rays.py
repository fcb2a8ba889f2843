"""GroundRays: rays against the ground with its vertical walls.

A ray crosses the quads between four samples one after the other. Squares of 4, 16 and 64 quads know
their highest point, so that a ray above it crosses the square in one step.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from terrainkit.geometry.ground_surface import WallTable, on_triangle
from terrainkit.geometry.ray_grid import NUDGE, Floats, RayGrid

_LEVELS, _FACTOR = 4, 4
"""Number of sizes of squares, and their ratio."""


class GroundRays:
    """The ground of a map, for rays. The ground ends at the edge of the map."""

    def __init__(
        self,
        heights: NDArray[np.float32],
        first_sample: tuple[float, float],
        cell: float,
        threshold: float,
    ) -> None:
        """Prepare the ground of a map.

        Args:
            heights: Samples [m], shape (nx, ny).
            first_sample: Position of `heights[0, 0]` [m].
            cell: Distance between samples [m].
            threshold: Difference between neighboring samples above which there is a wall [m].
        """
        # The outermost samples are repeated, since the map ends half a cell beyond them.
        self._heights = np.pad(heights, 1, mode="edge")
        self._walls = WallTable.from_heights(self._heights, threshold)
        self._first, self._cell = np.subtract(first_sample, cell), cell
        self._end = np.array(heights.shape) + 0.5
        self._corners = np.array([[0], [self._heights.shape[1]], [1], [self._heights.shape[1] + 1]])
        top = np.maximum(self._heights[:-1], self._heights[1:])
        tops = [np.maximum(top[:, :-1], top[:, 1:])]
        while len(tops) < _LEVELS:
            top = np.maximum.reduceat(tops[-1], np.arange(0, tops[-1].shape[0], _FACTOR), axis=0)
            tops.append(np.maximum.reduceat(top, np.arange(0, top.shape[1], _FACTOR), axis=1))
        self._top = np.concatenate([top.ravel() for top in tops])
        self._start = np.cumsum([0, *(top.size for top in tops[:-1])])
        self._columns = np.array([top.shape[1] for top in tops])

    def cast(self, origins: Floats, directions: Floats, limits: Floats) -> Floats:
        """Return the distance at which each ray meets the ground [m], its limit where it does not.

        Args:
            origins: Starts [m], shape (n, 3). A ray that starts below the ground has distance 0.
            directions: Unit vectors, shape (n, 3).
            limits: Largest distance of each ray [m], shape (n,).
        """
        result = limits.copy()
        rectangle = np.array([0.5, 0.5]), self._end
        grid = RayGrid.enter((origins, directions, limits), self._first, self._cell, rectangle)
        level = np.ones(len(grid.rays), int)
        while len(grid.rays):
            i, j, leave, z = grid.square(_SIZES.take(level))
            square = (i * self._columns.take(level) + j).astype(np.int64) + self._start.take(level)
            is_above = z[0] > self._top.take(square)
            test = np.flatnonzero(~is_above & (level == 0))
            hit = self._meet(grid.state[:, test], leave.take(test), i.take(test), j.take(test))
            going = np.ones(len(level), bool)
            going[test] = np.isinf(hit)
            result[grid.rays[test]] = np.minimum(hit, result[grid.rays[test]])
            distance = np.where(is_above | (level == 0), leave + NUDGE, grid.state[8])
            level = np.clip(level + np.where(is_above, 1, -1), 0, _LEVELS - 1)
            level = level[grid.move(distance, going)]
        return result

    def _meet(self, state: Floats, leave: Floats, i: Floats, j: Floats) -> Floats:
        """Return where rays meet the ground of a quad, inf where they do not, shape (n,).

        Args:
            state: State of each ray.
            leave: Distance at which it leaves the quad.
            i: Quad along x.
            j: Quad along y.
        """
        line, inverse, start = state[:6].copy(), state[6:8], state[8]
        line[:2] -= i, j
        corner = (i * self._heights.shape[1] + j).astype(np.int64)
        values = self._heights.reshape(-1).take(corner + self._corners)
        result = _meet_triangles(values, line, start, leave)
        number = self._walls.number.reshape(-1).take(corner)
        cut = np.flatnonzero(number)
        quarter, line, start, leave = number[cut] * 4, line[:, cut], start[cut], leave[cut]
        # The middle lines of the quad divide the ray into up to three parts, each in a quarter.
        middle = np.clip((0.5 - line[:2]) * inverse[:, cut], start, leave)
        ends = np.stack([start, middle.min(axis=0), middle.max(axis=0), leave])
        met = np.full(len(cut), np.inf)
        for begin, end in pairwise(ends):
            far = line[:2] + (begin + end) / 2 * line[3:5] >= 0.5
            sign = np.where(far, -2.0, 2.0)
            values = self._walls.values.reshape(-1, 4)[quarter + 2 * far[0] + far[1]].T
            x, y = sign * (line[:2] - far), sign * line[3:5]
            found = _meet_triangles(values, np.stack([*x, line[2], *y, line[5]]), begin, end)
            met = np.where(begin < end, np.minimum(met, found), met)
        result[cut] = met
        return result


_SIZES = np.power(float(_FACTOR), np.arange(_LEVELS), dtype=np.float64)


def _meet_triangles(
    values: NDArray[np.float32], line: Floats, start: Floats, end: Floats
) -> Floats:
    """Return where rays meet a square of two triangles, inf where they do not.

    Args:
        values: Heights at (0, 0), (1, 0), (0, 1) and (1, 1) [m], shape (4, n).
        line: u, v and z of each ray at distance 0, and their change per meter, shape (6, n).
        start: Distance at which each ray enters the square [m].
        end: Distance at which it leaves [m].
    """
    u, v, z, du, dv, dz = line
    turn = du - dv
    diagonal = np.clip((v - u) / np.where(turn == 0, 1.0, turn), start, end)
    times = (start, diagonal, end)
    above = []
    for t in times:
        p, q = u + t * du, v + t * dv
        side = np.where(p > q, values[1], values[2])
        above.append(z + t * dz - on_triangle(values[0], side, values[3], p, q))
    result = np.full(len(start), np.inf)
    for k in (1, 0):
        # Where the ray is below the ground at both ends, an earlier end decides.
        share = above[k] / np.maximum(above[k] - above[k + 1], 1e-12)
        meets = times[k] + np.clip(share, 0.0, 1.0) * (times[k + 1] - times[k])
        result = np.where(above[k + 1] <= 0, meets, result)
    return np.where(above[0] <= 0, start, result)

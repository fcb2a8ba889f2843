"""SolidIndex: the parts of vertical lines that solids occupy."""

import numpy as np
from numpy.typing import NDArray

from terrainkit.geometry.segments import segment_indices
from terrainkit.geometry.solids import Solids, convex_hull, rotation_matrices

MAX_PAIRS = 2_000_000
"""Candidate pairs of points and solids that are evaluated at once, to bound the memory."""

MIN_BIN = 0.5
"""Minimum side of the bins of the index [m]."""

MAX_BINS = 1_000_000
"""Largest number of bins of the index."""

_PARALLEL = 1e-6
"""Largest cosine of the angle between a line and the normal of a face that it is parallel to."""

Floats = NDArray[np.float64]

Crossings = tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]
"""Index of the line, index of the solid, bottom and top [m] of each crossing, shapes (k,)."""


class SolidIndex:
    """Solids, sorted into square bins on the xy plane.

    Every solid is an intersection of half-spaces; a cylinder is also the inside of an infinite
    cylinder. A vertical line therefore meets a solid in one interval, which is computed exactly.
    """

    def __init__(self, solids: Solids, *, radius: float | NDArray[np.float64] = 0.0) -> None:
        """Index `solids`.

        Args:
            solids: The solids.
            radius: Widen every solid horizontally by this distance [m], one number or shape (n,);
                edges become sharp, not round, so corners are widened by more. A negative distance
                narrows solids.
        """
        self._number = len(solids)
        if not self._number:
            return
        self._radius = np.broadcast_to(np.asarray(radius, float), self._number)
        planes, self._num_planes = half_spaces(solids)
        # A half-space n . p <= d that is widened horizontally by r has the distance d + r |n_xy|.
        planes[:, 3] += np.repeat(self._radius, self._num_planes) * np.hypot(*planes[:, :2].T)
        self._planes = np.ascontiguousarray(planes.T)
        self._first_plane = np.cumsum(self._num_planes) - self._num_planes
        self._cylinders, self._num_boxes = solids.cylinders.astype(float), len(solids.boxes)
        self._axes = rotation_matrices(solids.cylinders[:, 6:])[..., 2]
        # Single precision rounds by less than a tenth of a millimeter.
        margin = np.maximum(self._radius[:, None], 0.0) + 1e-4
        lower, upper = solids.bounds()
        self._lower, self._upper = lower[:, :2] - margin, upper[:, :2] + margin
        self._make_bins()

    def _make_bins(self) -> None:
        self._corner = self._lower.min(axis=0)
        extent = self._upper.max(axis=0) - self._corner
        self._bin = max(MIN_BIN, float(np.sqrt(extent.prod() / MAX_BINS)))
        self._shape = (extent / self._bin).astype(np.int64) + 1
        first = ((self._lower - self._corner) / self._bin).astype(np.int64)
        last = ((self._upper - self._corner) / self._bin).astype(np.int64)
        sides = last - first + 1
        solid, place = segment_indices(sides.prod(axis=1))
        column = first[solid, 0] + place // sides[solid, 1]
        bins = column * self._shape[1] + first[solid, 1] + place % sides[solid, 1]
        order = np.argsort(bins, kind="stable")
        self._solids = solid[order]
        self._ends = np.cumsum(np.bincount(bins, minlength=int(self._shape.prod())))

    def intervals(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the parts of the vertical lines through `xy` that solids occupy.

        Args:
            xy: Points [m], shape (n, 2).

        Returns:
            Bottom and top of each solid on each line [m], shape (n, k, 2), in the order of the
            bottoms; NaN where a line has fewer than k solids.
        """
        line, _, bottom, top = self.crossings(xy)
        rank = np.arange(len(line)) - np.searchsorted(line, line)
        result = np.full((len(xy), int(rank.max(initial=-1)) + 1, 2), np.nan)
        result[line, rank] = np.column_stack([bottom, top])
        return result

    def count(self, xy: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the number of solids on the vertical line through each of `xy` [m], shape (n,)."""
        return np.bincount(self.crossings(xy)[0], minlength=len(xy))

    def crossings(self, xy: NDArray[np.float64]) -> Crossings:
        """Return the solids that the vertical lines through `xy` cross.

        Args:
            xy: Points [m], shape (n, 2).

        Returns:
            Index of the line, index of the solid, bottom and top [m] of each crossing, each of
            shape (k,), in the order of the lines and of the bottoms.
        """
        if not self._number or not len(xy):
            none = np.empty(0, np.int64)
            return none, none, np.empty(0), np.empty(0)
        counts, starts = self._candidates(xy)
        # Lines are evaluated in blocks with a bounded number of candidates each.
        cuts = np.searchsorted(np.cumsum(counts), np.arange(MAX_PAIRS, counts.sum() + 1, MAX_PAIRS))
        blocks = np.split(np.arange(len(xy)), np.unique(cuts))
        parts = [self._line_intervals(xy, counts, starts, block) for block in blocks]
        line, solid, bottom, top = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
        order = np.lexsort((bottom, line))
        return line[order], solid[order], bottom[order], top[order]

    def _candidates(self, xy: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the number of solids in the bin of each point, and the position of the first."""
        place = np.floor((xy - self._corner) / self._bin)
        inside = ((place >= 0) & (place < self._shape)).all(axis=1)
        place = np.where(inside[:, None], place, 0).astype(np.int64)
        bins = place[:, 0] * self._shape[1] + place[:, 1]
        ends = np.concatenate([[0], self._ends])
        return np.where(inside, ends[bins + 1] - ends[bins], 0), ends[bins]

    def _line_intervals(
        self,
        xy: NDArray[np.float64],
        counts: NDArray[np.int64],
        starts: NDArray[np.int64],
        block: NDArray[np.int64],
    ) -> Crossings:
        """Return line, solid, bottom and top of each crossing of the lines `block`."""
        row, place = segment_indices(counts[block])
        line = block[row]
        solid = self._solids[starts[line] + place]
        near = ((xy[line] >= self._lower[solid]) & (xy[line] <= self._upper[solid])).all(axis=1)
        line, solid = line[near], solid[near]
        bottom, top = self._between_planes(xy[line], None, solid)
        k = solid - self._num_boxes
        round_ = np.flatnonzero((k >= 0) & (k < len(self._cylinders)))
        k = k[round_]
        z = self._cylinders[k, 2]
        up = np.tile(np.array([0.0, 0.0, 1.0]), (len(k), 1))
        points = np.column_stack([xy[line[round_]], z])
        low, high = self._inside_cylinders(points, up, k)
        bottom[round_] = np.maximum(bottom[round_], z + low)
        top[round_] = np.minimum(top[round_], z + high)
        hit = top > bottom
        return line[hit], solid[hit], bottom[hit], top[hit]

    def cylinder_hits(self, starts: Floats, directions: Floats, k: NDArray[np.int64]) -> Floats:
        """Return the distance at which each ray meets a cylinder [m], inf where it does not.

        Args:
            starts: Starts [m], shape (n, 3). A ray that starts in the cylinder meets its far side.
            directions: Unit vectors, shape (n, 3).
            k: Cylinder of each ray, shape (n,).
        """
        ends = self._between_planes(starts, directions, k + self._num_boxes)
        inside = self._inside_cylinders(starts, directions, k)
        low, high = np.maximum(ends[0], inside[0]), np.minimum(ends[1], inside[1])
        return np.where((high > low) & (high >= 0), np.where(low >= 0, low, high), np.inf)

    def _between_planes(
        self, starts: Floats, directions: Floats | None, solid: NDArray[np.int64]
    ) -> tuple[Floats, Floats]:
        """Return the interval of lines between the faces of each solid; empty if top < bottom.

        Args:
            starts: Points of the lines; shape (n, 2) for vertical lines, else (n, 3).
            directions: Directions, shape (n, 3); None for vertical lines.
            solid: Solids, shape (n,).
        """
        if not len(solid):
            return np.empty(0), np.empty(0)
        pair, place = segment_indices(self._num_planes[solid])
        *normal, left = self._planes.take(self._first_plane[solid][pair] + place, axis=1)
        for n, start in zip(normal, starts.T, strict=False):
            left -= n * start[pair]
        rate = normal[2]
        if directions is not None:
            rate = sum(n * along[pair] for n, along in zip(normal, directions.T, strict=True))
        parallel = np.abs(rate) <= _PARALLEL
        t = left / np.where(parallel, 1.0, rate)
        # A parallel face does not bound the line, which is on one side of it.
        outside = parallel & (left < -1e-9)
        bottom = np.where(outside, np.inf, np.where(~parallel & (rate < 0), t, -np.inf))
        top = np.where(outside, -np.inf, np.where(~parallel & (rate > 0), t, np.inf))
        first = np.cumsum(self._num_planes[solid]) - self._num_planes[solid]
        return np.maximum.reduceat(bottom, first), np.minimum.reduceat(top, first)

    def _inside_cylinders(
        self, starts: Floats, directions: Floats, k: NDArray[np.int64]
    ) -> tuple[Floats, Floats]:
        """Return the interval of lines inside the infinite cylinders `k`; empty if top < bottom."""
        axis, offset = self._axes[k], starts - self._cylinders[k, :3]
        radius = self._cylinders[k, 3] + self._radius[k + self._num_boxes]
        # The distance from the axis of the point at t is |q + t e|.
        q = offset - axis * (axis * offset).sum(axis=1, keepdims=True)
        e = directions - axis * (axis * directions).sum(axis=1, keepdims=True)
        a, b = (e * e).sum(axis=1), (q * e).sum(axis=1)
        c = (q * q).sum(axis=1) - radius**2
        parallel = a < _PARALLEL**2
        # The line is inside where a t^2 + 2 b t + c <= 0. Along the axis, a and b are 0.
        root = np.sqrt(np.clip(b**2 - a * c, 0, None))
        scale = np.where(parallel, 1.0, a)
        miss = np.where(parallel, c > 0, b**2 < a * c)
        low = np.where(parallel, -np.inf, -(b + root) / scale)
        high = np.where(parallel, np.inf, -(b - root) / scale)
        return np.where(miss, np.inf, low), np.where(miss, -np.inf, high)


def half_spaces(solids: Solids) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the half-spaces of each solid.

    Args:
        solids: The solids.

    Returns:
        Unit normal n and distance d of each, shape (k, 4): the points p with n . p <= d; and the
        number of half-spaces of each solid, shape (n,). The half-spaces of a cylinder include the
        sides of its bounding box. Widening the round side of a cylinder that lies on the ground
        would also raise it; the box limits its height.
    """
    shapes = np.concatenate([solids.boxes, solids.cylinders])
    normals = np.swapaxes(rotation_matrices(shapes[:, 6:]), 1, 2)
    middle, half = np.einsum("nkj,nj->nk", normals, shapes[:, :3]), shapes[:, 3:6]
    sides = [np.dstack([normals, middle + half]), np.dstack([-normals, half - middle])]
    planes, counts = [np.concatenate(sides, axis=1).reshape(-1, 4)], [np.full(len(shapes), 6)]
    equations = [convex_hull(vertices).equations.round(9) for vertices in solids.hulls()]
    if equations:
        hull = np.repeat(np.arange(len(equations)), [len(facets) for facets in equations])
        # Coplanar facets of a hull repeat their plane.
        unique = np.unique(np.column_stack([hull, np.concatenate(equations)]), axis=0)
        planes.append(unique[:, 1:] * [1, 1, 1, -1])
        counts.append(np.bincount(unique[:, 0].astype(np.int64)))
    return np.concatenate(planes), np.concatenate(counts)

"""Columns: where the vertical lines through a grid of points cross a mesh.

The triangles are rasterized, which finds every crossing in double precision, also where a line
meets an edge or a vertex. Casting rays finds one crossing at a time, and may miss edges.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import HeightFileError
from terrainkit.geometry.segments import segment_indices

Array = NDArray[np.float64]

MIN_GAP = 1e-3
"""Height of free space below which bodies touch [m]."""

CELLS_PER_STRIP = 1 << 18
"""Points of the grid that are sampled at once, to bound the memory."""

PAIRS_PER_BLOCK = 1 << 20
"""Pairs of a triangle and a point that are intersected at once, to bound the memory."""

MAX_PAIRS = 2_000_000_000
"""Largest number of pairs of a triangle and a point in its bounding box, about 5 minutes."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Columns:
    """The surfaces of a mesh above and below each other, NaN where there are none."""

    top: Array
    """Height of the highest surface [m], shape (nx, ny)."""

    floor: Array
    """Height of the surface below the lowest free space, or the highest [m], shape (nx, ny)."""

    ceiling: Array
    """Height of the surface above the lowest free space [m], shape (nx, ny); NaN where nothing
    hangs over the ground."""

    sheets: Array
    """Distance between the highest and the lowest surface that no face from below closes [m], shape
    (nx, ny): above 0 where sheets without thickness are above each other."""

    def lowered(self, z: float) -> "Columns":
        """Return the columns of the mesh moved down by `z` [m]."""
        return replace(self, top=self.top - z, floor=self.floor - z, ceiling=self.ceiling - z)


def make_columns(vertices: Array, faces: NDArray[np.int64], x: Array, y: Array) -> Columns:
    """Return the columns of a mesh.

    From top to bottom, a face that points up begins a solid, and a face that points down ends it.
    Solids may overlap. If most of the highest faces point down, the mesh is inside out, and all
    faces are flipped.

    Args:
        vertices: Vertices [m], shape (nv, 3).
        faces: Triangles, shape (nf, 3).
        x: Positions along x [m], increasing, shape (nx,).
        y: Positions along y [m], increasing, shape (ny,).

    Raises:
        HeightFileError: if the mesh has too many large triangles.
    """
    blocks = list(_intersections(vertices[faces], x, y))
    column, z, sign = (np.concatenate(part) for part in zip(*blocks, strict=True))
    for _ in range(2):
        order = np.lexsort((-sign, -z, column))
        column, z, sign = column[order], z[order], sign[order]
        is_first = np.diff(column, prepend=-1) > 0
        if sign[is_first].sum() >= 0:
            break
        sign = -sign
    depth = np.cumsum(sign)
    depth -= np.repeat((depth - sign)[is_first], np.diff(np.flatnonzero(is_first), append=len(z)))
    is_gap = (depth[:-1] == 0) & ~is_first[1:] & (z[:-1] - z[1:] > MIN_GAP)
    above = np.flatnonzero(is_gap)
    top, ceiling = np.full((2, len(x) * len(y)), np.nan)
    top[column[is_first]] = z[is_first]
    floor = top.copy()
    # The last of several gaps of a column is the lowest.
    ceiling[column[above]], floor[column[above]] = z[above], z[above + 1]
    top, floor, ceiling = (values.reshape(len(x), len(y)) for values in (top, floor, ceiling))
    sheets = _sheets(column, z, sign, depth, top.size).reshape(top.shape)
    return Columns(top=top, floor=floor, ceiling=ceiling, sheets=sheets)


def _sheets(
    column: NDArray[np.int64],
    z: Array,
    sign: NDArray[np.int64],
    depth: NDArray[np.int64],
    size: int,
) -> Array:
    """Return the distance from the highest to the lowest open surface of each column [m].

    A face that points up is open if the depth does not return below the depth after it.
    """
    # Each column has its own range of numbers, so that the minimum from below does not mix them.
    own = depth + column * (int(depth.max(initial=0)) - int(depth.min(initial=0)) + 1)
    is_open = (sign > 0) & (np.minimum.accumulate(own[::-1])[::-1] == own)
    column, z = column[is_open], z[is_open]
    low, high = np.zeros((2, size))
    low[column] = z  # the last crossing of a column is the lowest
    high[column[::-1]] = z[::-1]
    return high - low


def _intersections(
    corners: Array, x: Array, y: Array
) -> Iterator[tuple[NDArray[np.int64], Array, NDArray[np.int64]]]:
    """Yield number of the column, z, and direction (1 is up) of the crossings, in blocks."""
    yield np.empty(0, np.int64), np.empty(0), np.empty(0, np.int64)
    (ax, ay), (bx, by), (cx, cy) = np.moveaxis(corners[..., :2], 0, -1)
    sign = np.sign((bx - ax) * (cy - ay) - (by - ay) * (cx - ax)).astype(np.int64)
    corners, sign = corners[sign != 0], sign[sign != 0]  # others are vertical
    lower, upper = corners[..., :2].min(axis=1), corners[..., :2].max(axis=1)
    i0, i1 = np.searchsorted(x, lower[:, 0]), np.searchsorted(x, upper[:, 0], "right")
    j0, j1 = np.searchsorted(y, lower[:, 1]), np.searchsorted(y, upper[:, 1], "right")
    pairs = ((i1 - i0) * (j1 - j0)).sum()
    if pairs > MAX_PAIRS:
        raise HeightFileError(
            f"got {len(corners)} triangles over {len(x)} x {len(y)} samples; expected a smaller "
            "mesh, or larger cells"
        )
    length = max(1, CELLS_PER_STRIP // len(y))
    for start in range(0, len(x), length):
        first, end = np.maximum(i0, start), np.minimum(i1, start + length)
        count = np.maximum(end - first, 0) * (j1 - j0)
        within = np.flatnonzero(count)
        block = np.cumsum(count[within]) // PAIRS_PER_BLOCK
        for triangles in np.split(within, np.flatnonzero(np.diff(block)) + 1):
            k, local = segment_indices(count[triangles])
            triangle = triangles[k]
            width = (j1 - j0)[triangle]
            i, j = first[triangle] + local // width, j0[triangle] + local % width
            inside, z = _cross(corners[triangle], sign[triangle], x[i], y[j])
            yield (i * len(y) + j)[inside], z[inside], sign[triangle][inside]


def _cross(
    corners: Array, sign: NDArray[np.int64], x: Array, y: Array
) -> tuple[NDArray[np.bool_], Array]:
    """Return whether each vertical line crosses its triangle, and at which z.

    A line through an edge crosses exactly one of the two triangles of the edge: the weights of both
    are computed from the same numbers, and one of them owns the edge.
    """
    inside = np.ones(len(x), dtype=bool)
    total, z = np.zeros(len(x)), np.zeros(len(x))
    for k in range(3):
        (ax, ay), (bx, by) = corners[:, k, :2].T, corners[:, (k + 1) % 3, :2].T
        swap = (ax > bx) | ((ax == bx) & (ay > by))
        px, py = np.where(swap, bx, ax), np.where(swap, by, ay)
        dx, dy = np.where(swap, ax, bx) - px, np.where(swap, ay, by) - py
        direction = np.where(swap, -sign, sign)
        weight = (dx * (y - py) - dy * (x - px)) * direction
        inside &= (weight > 0) | ((weight == 0) & (direction > 0))
        total += weight
        z += weight * corners[:, (k + 2) % 3, 2]
    with np.errstate(invalid="ignore", divide="ignore"):
        return inside, z / total

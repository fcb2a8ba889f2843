"""Height and gradient of the ground at any point."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from terrainkit.geometry.solid_raster import SolidRaster
from terrainkit.geometry.walls import (
    ALONG_X,
    ALONG_Y,
    WallRule,
    center_heights,
    wall_edges,
)


@dataclass(frozen=True, kw_only=True)
class SurfacePoints:
    """Height and gradient at n points."""

    height: NDArray[np.float64]
    """Height [m], shape (n,)."""

    gradient: NDArray[np.float64]
    """Height difference per cell along x and y [m], shape (n, 2)."""

    def normals(self, cell: float) -> NDArray[np.float64]:
        """Return the normals of the surface at the points.

        Args:
            cell: Distance between two samples [m].

        Returns:
            Unit vectors with a positive z, shape (n, 3).
        """
        downhill = 0.0 - self.gradient / cell
        normals = np.column_stack([downhill, np.ones(len(downhill))])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return normals


def surface_at(
    heights: NDArray[np.float32], points: NDArray[np.float64], *, rule: WallRule
) -> SurfacePoints:
    """Evaluate the surface at `points`.

    Between four samples without a wall the ground is two triangles that share the diagonal from
    (i, j) to (i + 1, j + 1), along which MuJoCo splits a cell as well. A quad with a wall is a fan
    of triangles around its center; see `terrainkit.geometry.walls`. Beyond the outermost
    samples the ground continues level.

    Args:
        heights: Samples [m], shape (nx, ny).
        points: Finite points in units of samples, shape (n, 2); (0, 0) is at `heights[0, 0]`.
        rule: Which edges between neighboring samples are walls.
    """
    limit = np.array(heights.shape) - 1
    beyond = (points < 0) | (points > limit)
    points = np.clip(points, 0, limit)
    low = np.minimum(points.astype(np.int64), np.maximum(limit - 1, 0))
    i, j = low.T
    i1, j1 = np.minimum(low + 1, limit).T
    samples = np.stack([heights[i, j], heights[i1, j], heights[i1, j1], heights[i, j1]], axis=1)
    if isinstance(rule, np.ndarray):
        x, y = rule & ALONG_X, rule & ALONG_Y
        walls = np.stack([x[i, j], y[i1, j], x[i, j1], y[i, j]], axis=1) > 0
    else:
        # Compare as float32, as everywhere, so that all views agree on which edges are walls.
        walls = np.abs(np.roll(samples, -1, axis=1) - samples) > rule
    corners = samples.astype(np.float64)
    u, v = (points - low).T
    height, gradient = _two_triangles(corners, u, v)
    cut = walls.any(axis=1)
    if cut.any():
        height[cut], gradient[cut] = _fan(corners[cut], walls[cut], u[cut], v[cut])
    return SurfacePoints(height=height, gradient=np.where(beyond, 0.0, gradient))


def _two_triangles(
    corners: NDArray[np.float64], u: NDArray[np.float64], v: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    a, b, c, d = corners.T
    below = u >= v
    gradient = np.stack(
        [np.where(below, b - a, c - d), np.where(below, c - b, d - a)],
        axis=1,
    )
    return a + gradient[:, 0] * u + gradient[:, 1] * v, gradient


_ALONG = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]], dtype=float)
"""Direction of each edge; the quad lies to its left."""


def _fan(
    corners: NDArray[np.float64],
    walls: NDArray[np.bool_],
    u: NDArray[np.float64],
    v: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    n = np.arange(len(u))
    edge = np.argmin(np.stack([v, 1 - u, 1 - v, u]), axis=0)  # edge of the triangle
    s = np.choose(edge, [u, v, 1 - u, 1 - v])  # along the edge, 0 to 1
    t = np.choose(edge, [v, 1 - u, 1 - v, u])  # away from it, 0 to 1/2
    start, end = corners[n, edge], corners[n, (edge + 1) % 4]
    center = center_heights(corners, walls)
    wall = walls[n, edge]
    near = np.where(s < 0.5, start, end)
    own = center[n, np.where(s < 0.5, edge, (edge + 1) % 4)]
    # The triangle of a wall is level along the edge; any other interpolates between its ends.
    along = np.where(wall, 0.0, end - start)
    away = np.where(wall, 2 * (own - near), 2 * center[n, edge] - start - end)
    height = np.where(wall, near, start) + along * s + away * t
    direction = _ALONG[edge]
    normal = np.stack([-direction[:, 1], direction[:, 0]], axis=1)
    return height, along[:, None] * direction + away[:, None] * normal


_X_EDGE, _X_CORNER = [0, 2, 0, 2], [1, 2, 0, 3]
_Y_EDGE, _Y_CORNER = [3, 3, 1, 1], [3, 0, 2, 1]
"""Edges along x and y of the corners (0, 0), (0, 1), (1, 0), (1, 1), and their other ends."""


@dataclass(frozen=True, kw_only=True, eq=False)
class WallTable:
    """The ground of the quads with walls, as two triangles for each quarter of a quad.

    Both triangles of a quarter join its corner and the center of the quad, and either the middle of
    the edge along x or of the edge along y. This is the fan of `surface_at`.
    """

    number: NDArray[np.int32]
    """Number of the quad of each sample in the table; 0 for a quad without walls, (nx, ny)."""

    values: NDArray[np.float32]
    """Height of the corner, the middle along x, the middle along y and the center of each quarter
    of each quad [m], shape (k, 4, 4). Quarter 2 p + q is at corner (p, q)."""

    @classmethod
    def from_heights(cls, heights: NDArray[np.float32], rule: WallRule) -> Self:
        """Return the table of a map.

        Args:
            heights: Samples [m], shape (nx, ny).
            rule: Which edges between neighboring samples are walls.
        """
        x, y = wall_edges(heights, rule)
        i, j = np.nonzero(x[:, :-1] | x[:, 1:] | y[:-1] | y[1:])
        corner = np.stack(
            [heights[i, j], heights[i + 1, j], heights[i + 1, j + 1], heights[i, j + 1]]
        )
        walls = np.stack([x[i, j], y[i + 1, j], x[i, j + 1], y[i, j]])
        number = np.zeros(heights.shape, np.int32)
        number[i, j] = np.arange(1, len(i) + 1)
        order = [0, 3, 1, 2]
        own, center = corner[order], center_heights(corner.T, walls.T).T[order]
        middle = [
            np.where(walls[edge], own, (own + corner[other]) / 2)
            for edge, other in ((_X_EDGE, _X_CORNER), (_Y_EDGE, _Y_CORNER))
        ]
        values = np.zeros((len(i) + 1, 4, 4), np.float32)
        values[1:] = np.stack([own, *middle, center]).transpose(2, 1, 0)
        return cls(number=number, values=values)

    def heights(
        self, number: NDArray[np.int32], u: NDArray[np.float32], v: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """Return the height at points of quads with walls.

        Args:
            number: Number of the quad of each point.
            u: Position in the quad along x, 0 to 1.
            v: Position in the quad along y, 0 to 1.
        """
        quarter = number * 4 + (u >= 0.5) * np.int32(2) + (v >= 0.5)
        u, v = 1 - np.abs(2 * u - 1), 1 - np.abs(2 * v - 1)  # from the corner to the center
        flat, first = self.values.reshape(-1), quarter * 4
        side = flat.take(first + 2 - (u > v))
        height: NDArray[np.float32] = on_triangle(
            flat.take(first), side, flat.take(first + 3), u, v
        )
        return height


def on_triangle(near: Any, side: Any, far: Any, u: Any, v: Any) -> Any:
    """Return the height at points of squares of two triangles.

    Args:
        near: Height at the corner (0, 0) [m].
        side: Height at the corner (1, 0) where u > v, else at (0, 1) [m].
        far: Height at the corner (1, 1) [m].
        u: Position along x, 0 to 1.
        v: Position along y, 0 to 1.
    """
    high, low = np.maximum(u, v), np.minimum(u, v)
    return near + high * (side - near) + low * (far - side)


@dataclass(frozen=True, kw_only=True, eq=False)
class HeightfieldSurface:
    """The surface of a heightfield, with walls or with boxes on its samples, and of solids.

    In single precision. A heightfield of MuJoCo has no walls. Looking up the 187 points of a height
    scan takes 3 microseconds; casting rays takes 80 on a heightfield and 4000 on boxes.
    """

    heights: NDArray[np.float32]
    """Heights of the samples [m], shape (nx, ny)."""
    first_sample: tuple[float, float]
    """Position of `heights[0, 0]` [m]."""
    cell: float
    """Distance between samples [m]."""
    box_top: NDArray[np.float32] | None = None
    """Top of the box around each sample, -inf without one [m], shape (nx, ny)."""
    walls: WallTable | None = None
    """The quads with walls."""
    collision: SolidRaster | None = None
    """The solids that collide."""
    visible: SolidRaster | None = None
    """The solids that height scans see."""

    def height(
        self,
        x: NDArray[np.float32],
        y: NDArray[np.float32],
        z: NDArray[np.float32] | float = np.inf,
        *,
        scan: bool = False,
    ) -> NDArray[np.float32]:
        """Return the height at points [m]; the outermost samples extend outwards.

        Args:
            x: Points along x [m].
            y: Points along y [m].
            z: Height of the robot [m], which passes under solids whose bottom is above `z`.
            scan: Return what a height scan sees, not what robots collide with.
        """
        height = self.ground_height(x, y)
        solids = self.visible if scan else self.collision
        return height if solids is None else np.maximum(height, solids.top(x, y, z))

    def ground_height(self, x: NDArray[np.float32], y: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the height at points without solids [m].

        A cell is two triangles with the diagonal of MuJoCo's heightfield, from (i, j) to
        (i + 1, j + 1). Bilinear interpolation is off by up to 3.6 cm on stairs.

        Args:
            x: Points along x [m].
            y: Points along y [m].
        """
        nx, ny = self.heights.shape
        u = np.clip((x - np.float32(self.first_sample[0])) / np.float32(self.cell), 0, nx - 1)
        v = np.clip((y - np.float32(self.first_sample[1])) / np.float32(self.cell), 0, ny - 1)
        i = np.minimum(u.astype(np.int32), nx - 2)
        j = np.minimum(v.astype(np.int32), ny - 2)
        u, v = u - i.astype(np.float32), v - j.astype(np.float32)
        flat, corner = self.heights.reshape(-1), i * ny + j
        # `take` is three times as fast as an index in brackets, and a product as np.where.
        near, far = flat.take(corner), flat.take(corner + (ny + 1))
        side = flat.take(corner + 1 + (u > v) * np.int32(ny - 1))  # the corner off the diagonal
        height: NDArray[np.float32] = on_triangle(near, side, far, u, v)
        if self.walls is not None:
            number = self.walls.number.reshape(-1).take(corner)
            cut = np.flatnonzero(number > 0)
            cut_u, cut_v = u.take(cut), v.take(cut)
            height.put(cut, self.walls.heights(number.take(cut), cut_u, cut_v))
        if self.box_top is None:
            return height
        nearest = (i + (u >= 0.5)) * ny + j + (v >= 0.5)
        top: NDArray[np.float32] = np.maximum(self.box_top.reshape(-1)[nearest], height)
        return top

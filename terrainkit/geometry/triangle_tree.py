"""The first triangle that a ray meets: by embree, or in a tree of boxes."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ids = NDArray[np.int64]

_FACTOR = 4
"""Boxes of a level that the next level unites."""

_RAYS_AT_ONCE = 1024
"""Rays that descend at once, to bound the memory."""

_MARGIN = 1e-6
"""Distance by which boxes are larger than their triangles."""


class TriangleTree:
    """Triangles in a tree of boxes, which all rays descend level by level."""

    def __init__(self, vertices: Floats, triangles: NDArray[np.int32]) -> None:
        """Build the tree.

        Args:
            vertices: Positions, shape (nv, 3).
            triangles: Vertices of each triangle, shape (nf, 3).
        """
        middle = vertices[triangles, :2].mean(axis=1)
        middle -= middle.min(axis=0)
        place = (middle * (65535 / max(middle.max(), 1e-9))).astype(np.int64)
        # Interleaved bits sort the triangles along a curve on which neighbors are near.
        codes = (((place[:, k] >> bit) & 1) << (2 * bit + k) for bit in range(16) for k in (0, 1))
        self._order = np.argsort(sum(codes), kind="stable")
        self._corners = vertices[triangles[self._order]]
        # Lower corners, and upper corners with the other sign: the minimum unites both.
        boxes = np.concatenate([self._corners.min(axis=1), -self._corners.max(axis=1)], axis=1).T
        self._levels = [boxes - _MARGIN]
        while self._levels[-1].shape[1] > _FACTOR:
            starts = np.arange(0, self._levels[-1].shape[1], _FACTOR)
            self._levels.append(np.minimum.reduceat(self._levels[-1], starts, axis=1))

    def first(self, origins: Floats, directions: Floats, limit: float) -> tuple[Ids, Floats]:
        """Return the first triangle of each ray, -1 where there is none, and its distance.

        Args:
            origins: Starts, shape (n, 3).
            directions: Change of the position per meter, shape (n, 3).
            limit: Largest distance [m].
        """
        triangle, distance = np.full(len(origins), -1), np.full(len(origins), limit)
        inverse = 1 / np.where(np.abs(directions) < 1e-12, 1e-12, directions)
        for start in range(0, len(origins), _RAYS_AT_ONCE):
            ray = np.arange(start, min(start + _RAYS_AT_ONCE, len(origins)))
            box = np.zeros(len(ray), np.int64)
            for boxes in reversed(self._levels):
                ray = np.repeat(ray, _FACTOR)
                box = (box[:, None] * _FACTOR + np.arange(_FACTOR)).ravel()
                ray, box = ray[box < boxes.shape[1]], box[box < boxes.shape[1]]
                here, rate = origins[ray].T, inverse[ray].T
                low = (boxes[:3].take(box, axis=1) - here) * rate
                high = -(boxes[3:].take(box, axis=1) + here) * rate
                enter, leave = np.minimum(low, high).max(axis=0), np.maximum(low, high).min(axis=0)
                near = np.flatnonzero((enter <= leave) & (leave >= 0) & (enter <= limit))
                ray, box = ray.take(near), box.take(near)
            t = self._distances(origins[ray], directions[ray], box)
            order = np.argsort(-t, kind="stable")  # the nearest is written last
            order = order[t[order] <= limit]
            triangle[ray[order]], distance[ray[order]] = self._order[box[order]], t[order]
        return triangle, distance

    def _distances(self, origins: Floats, directions: Floats, number: Ids) -> Floats:
        """Return the distance at which each ray meets a triangle, inf where it does not."""
        corners = self._corners[number] - origins[:, None]
        # Both triangles of an edge compute its side from the same numbers: no ray passes between.
        normals = np.cross(corners, np.roll(corners, -1, axis=1))
        sides = np.einsum("nij,nj->ni", normals, directions)
        rate, left = sides.sum(axis=1), (normals.sum(axis=1) * corners[:, 0]).sum(axis=1)
        t = left / np.where(rate == 0, np.nan, rate)
        meets = (sides.min(axis=1) >= 0) | (sides.max(axis=1) <= 0)
        return np.where(meets & (t >= 0), t, np.inf)


def first_triangle(vertices: Floats, triangles: NDArray[Any]) -> Any:
    """Return `TriangleTree.first` of triangles, computed by embree where it is installed."""
    try:
        from embreex import mesh_construction, rtcore_scene
    except ImportError:
        return TriangleTree(vertices, triangles).first
    scene = rtcore_scene.EmbreeScene(robust=True)
    mesh_construction.TriangleMesh(scene, vertices, triangles)

    def first(origins: Floats, directions: Floats, limit: float) -> Any:
        limits = np.full(len(origins), min(limit, 1e30), np.float32)
        starts, steps = origins.astype(np.float32), directions.astype(np.float32)
        found = scene.run(starts, steps, limits, output=True)
        return found["primID"], found["tfar"]

    return first

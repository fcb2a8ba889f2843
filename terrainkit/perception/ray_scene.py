"""RayScene: rays against the ground with its vertical walls, and solids."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.files.memory import check_memory
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.mesh.closed import closed_mesh
from terrainkit.geometry.mesh.merged import merged_mesh
from terrainkit.geometry.mesh.solid_mesh import solid_surfaces
from terrainkit.geometry.solid_index import SolidIndex
from terrainkit.geometry.triangle_tree import first_triangle
from terrainkit.map.terrain_map import TerrainMap

Floats = NDArray[np.float64]

_BYTES_PER_TRIANGLE = 350
"""Peak memory of the scene per triangle [bytes]; measured: 160 with embree and 340 without."""

_DEPTH = 100.0
"""Depth of the sides of the map, where rays from outside enter the ground [m]. Single precision
rounds the edges of longer triangles by more."""

_CHORD_ERROR = 1e-4
"""Largest distance between a cylinder and its triangles [m]. It decides at silhouettes only."""

_GRAZE = 2e-5
"""Height above the ground up to which a ray starts in the ground [m]. Single precision rounds by
that on maps of 1,600 m."""

_MAX_CORRECTION = 0.01
"""Largest difference between the distances in single and in double precision [m]."""

_SHIFT = 3.2e-8
"""Shift of the rays along x and y, as a share of the map, just above what single precision rounds.
A ray in the plane of a wall or along the edges of triangles is on its side of larger x and y, as
embree misses triangles whose bounding box a ray only touches."""

_PLANES_AT_ONCE = 1 << 16


class RayScene:
    """The ground of a map and solids, for rays. The ground ends at the edge of the map.

    Embree or a tree finds the first triangle, and its plane gives the distance in double precision.
    Coordinates are in cells, so that x and y of the vertices of the ground are exact.
    """

    def __init__(self, terrain_map: TerrainMap) -> None:
        """Prepare the triangles.

        Args:
            terrain_map: The map.

        Raises:
            MemoryLimitError: if the triangles would not fit in memory.
        """
        self._map, heights, grid = terrain_map, terrain_map.heights, terrain_map.grid
        solids = terrain_map.solids.select(terrain_map.solids.visible)
        is_round = solids.types == 1
        self._cylinders = SolidIndex(solids.select(is_round))
        # Rounding is small near the origin, which is the corner of a cell.
        level = heights.mean(dtype=np.float64) / grid.cell
        center = np.array([*(np.array(grid.shape) // 2), level])
        self._origin = np.array([*grid.lower, 0.0]) + center * grid.cell
        cells = Grid(shape=grid.shape, cell=1.0)
        ground = closed_mesh(merged_mesh(heights, cells, terrain_map.wall_rule), _DEPTH)
        corners = ground.vertices.astype(np.float64)
        # Vertices are at samples and between them; where walls cross, the mesh parts their edges.
        corners[:, :2] = (2 * corners[:, :2]).round() / 2
        corners[:, 2] /= grid.cell
        parts: list[tuple[Floats, NDArray[Any]]] = [(corners - center, ground.triangles)]
        surfaces = solid_surfaces(solids, _CHORD_ERROR)
        parts += [(self._to_cells(vertices), faces) for vertices, faces in surfaces]
        counts = [len(faces) for _, faces in parts]
        check_memory(sum(counts) * _BYTES_PER_TRIANGLE, "rays on the map")
        number = np.where(is_round, np.cumsum(is_round) - 1, -1).astype(np.int32)
        self._cylinder = np.repeat(np.append(np.int32(-1), number), counts)
        starts = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
        triangles = np.concatenate([part[1] + k for part, k in zip(parts, starts, strict=False)])
        vertices = np.concatenate([part[0] for part in parts])
        self._shift = _SHIFT * max(grid.size)
        self._origin[:2] -= self._shift
        shift = np.array([1.0, 1.0, 0.0]) * self._shift / grid.cell
        self._planes = np.empty((len(triangles), 4))
        for start in range(0, len(triangles), _PLANES_AT_ONCE):
            a, b, c = vertices[triangles[start : start + _PLANES_AT_ONCE].T]
            normal = np.cross(b - a, c - a)
            plane = np.column_stack([normal, _dot(normal, a + shift)])
            self._planes[start : start + _PLANES_AT_ONCE] = plane
        self._first = first_triangle(vertices, triangles)

    def first_hits(self, origins: Floats, directions: Floats, limit: float) -> Floats:
        """Return the distance at which each ray meets the ground or a solid [m].

        Args:
            origins: Starts [m], shape (n, 3). A ray that starts below the ground has distance 0. A
                ray that starts in a solid meets its far side, as with MuJoCo's `mj_ray`.
            directions: Unit vectors of k rays from each start, shape (n, k, 3).
            limit: Largest distance [m].

        Returns:
            Distances, shape (n, k); inf where there is none below the limit.
        """
        starts = np.repeat(self._to_cells(origins), directions.shape[1], axis=0)
        steps = (directions / self._map.grid.cell).reshape(-1, 3)
        triangle, near = self._first(starts, steps, limit)
        planes, hits = self._planes.take(triangle, axis=0), triangle >= 0
        with np.errstate(divide="ignore", invalid="ignore"):
            exact = (planes[:, 3] - _dot(planes, starts)) / _dot(planes, steps)
        # A plane along the ray has no distance, which fmin and fmax ignore.
        exact = np.fmax(np.fmin(exact, near + _MAX_CORRECTION), near - _MAX_CORRECTION)
        cylinder = self._cylinder.take(triangle)
        rays = np.flatnonzero(hits & (cylinder >= 0))
        if len(rays):
            start, along = origins[rays // directions.shape[1]], directions.reshape(-1, 3)[rays]
            found = self._cylinders.cylinder_hits(start, along, cylinder[rays].astype(np.int64))
            exact[rays] = np.where(np.isfinite(found), found, exact[rays])
        distance = np.where(hits, np.maximum(exact, 0.0), np.inf).reshape(directions.shape[:2])
        xy, grid = origins[:, :2] + self._shift, self._map.grid
        inside = np.all((xy >= grid.lower) & (xy <= grid.upper), axis=1)
        distance[inside & (origins[:, 2] <= self._map.height(xy) + _GRAZE)] = 0.0
        return distance

    def _to_cells(self, points: Floats) -> Floats:
        return np.asarray((points - self._origin) / self._map.grid.cell)


def _dot(a: Floats, b: Floats) -> Floats:
    """Return the products of the first three columns, faster than a sum along an axis."""
    return np.asarray(a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2])

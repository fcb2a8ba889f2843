"""Compute convex hulls of meshes."""

import numpy as np

from terrainkit_robots.mesh.surface import MeshError, Points, Surface, is_flat
from terrainkit_robots.quiet_mujoco import quiet_mujoco

_MAX_POINTS = 30_000
"""Maximum number of points of an exact hull. Of more points, one extreme point per grid cell is
used."""

_CELLS = 96
"""Cells of that grid along each axis; the hull is accurate to about one percent."""


def convex_hull(points: Points, max_vertices: int | None = None) -> Surface:
    """Return the convex hull of points.

    Args:
        points: Finite points without duplicates, shape (n, 3).
        max_vertices: Maximum number of vertices; see `reduce_hull`.

    Raises:
        MeshError: If the points lie in a plane.
    """
    if is_flat(points):
        raise MeshError(
            f"is flat and has no convex hull: its {len(points):,} vertices lie in a plane"
        )
    if len(points) > _MAX_POINTS:
        points = _extreme_points_per_cell(points)
    return reduce_hull(_mujoco_hull(points), max_vertices)


def reduce_hull(hull: Surface, max_vertices: int | None) -> Surface:
    """Return a hull with at most that many vertices: extreme points in that many directions."""
    if max_vertices is None or len(hull.points) <= max_vertices:
        return hull
    return _mujoco_hull(hull.points[_extreme_points_per_direction(hull.points, max_vertices)])


def _mujoco_hull(points: Points) -> Surface:
    """Return the hull that MuJoCo computes, and therefore simulates."""
    import mujoco

    lower, sides = points.min(axis=0), np.ptp(points, axis=0)
    unit = ((points - lower) / sides).astype(np.float32)  # a hull is invariant under affine maps
    spec = mujoco.MjSpec()
    spec.add_mesh(name="mesh", uservert=unit.ravel().tolist())
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="mesh")
    try:
        with quiet_mujoco():
            graph = spec.compile().mesh_graph
    except ValueError as error:
        raise MeshError(f"has no convex hull: {str(error).splitlines()[0]}") from None
    n_vertices, faces = int(graph[0]), int(graph[1])
    # graph: the numbers of vertices and faces, start of the edges of each vertex, point index of
    # each vertex, edges, faces by point index
    vertex_indices = np.array(graph[2 + n_vertices : 2 + 2 * n_vertices])
    triangles = np.array(graph[-3 * faces :]).reshape(-1, 3)
    new_index = np.zeros(len(points), np.int64)
    new_index[vertex_indices] = np.arange(n_vertices)
    return Surface(points=points[vertex_indices], faces=new_index[triangles])


def _extreme_points_per_cell(points: Points) -> Points:
    """Return, for each grid cell, the point farthest from the center of all points."""
    lower, sides = points.min(axis=0), np.ptp(points, axis=0)
    unit = (points - lower) / sides
    cell_index = np.minimum(unit * _CELLS, _CELLS - 1).astype(np.int64)
    key = (cell_index[:, 0] * _CELLS + cell_index[:, 1]) * _CELLS + cell_index[:, 2]
    order = np.lexsort((-((unit - 0.5) ** 2).sum(axis=1), key))
    _, first = np.unique(key[order], return_index=True)
    return points[order[first]]


def _extreme_points_per_direction(
    points: Points, count: int
) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Return the indices of extreme points in directions distributed evenly on a sphere."""
    k = np.arange(count) + 0.5
    # Equal steps of z have equal areas on a sphere (Archimedes).
    z = 1 - 2 * k / count
    around = np.pi * (1 + 5**0.5) * k  # multiples of the golden angle
    radius = np.sqrt(1 - z**2)
    directions = np.stack([radius * np.cos(around), radius * np.sin(around), z])
    return np.unique((points @ directions).argmax(axis=0))

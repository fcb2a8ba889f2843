"""Convex hulls, which is what most simulators make of a collision mesh."""

import numpy as np

from terrainkit_robots.mesh.surface import (
    MeshError,
    Points,
    Surface,
    is_flat,
)
from terrainkit_robots.quiet_mujoco import quiet_mujoco

_MOST_POINTS = 30_000
"""Of more points the hull is taken of the outermost in each cell of a grid, to bound the time."""

_CELLS = 96
"""Cells of that grid on each side: the hull is off by about a hundredth of the size."""


def convex_hull(points: Points, most_points: int | None = None) -> Surface:
    """Return the convex hull of points, in their units.

    Args:
        points: Different ones, shape (n, 3), finite.
        most_points: Corners that it may have; of more, it is the hull of those that lie farthest
            out in as many directions.

    Raises:
        MeshError: if there is none, because they lie in a plane.
    """
    if is_flat(points):
        raise MeshError(f"is flat, and has no hull: its {len(points):,} corners lie in a plane")
    if len(points) > _MOST_POINTS:
        points = _outermost_in_cells(points)
    hull = _quickhull(points)
    if most_points is not None and len(hull.points) > most_points:
        hull = _quickhull(hull.points[_outermost_in_directions(hull.points, most_points)])
    return hull


def _quickhull(points: Points) -> Surface:
    """Return the hull as MuJoCo finds it, which is how the robot will be simulated."""
    import mujoco

    lower, sides = points.min(axis=0), np.ptp(points, axis=0)
    unit = ((points - lower) / sides).astype(np.float32)  # a hull stays one under affine maps
    spec = mujoco.MjSpec()
    spec.add_mesh(name="mesh", uservert=unit.ravel().tolist())
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="mesh")
    try:
        with quiet_mujoco():
            graph = spec.compile().mesh_graph
    except ValueError as error:
        raise MeshError(f"has no hull: {str(error).splitlines()[0]}") from None
    corners, faces = int(graph[0]), int(graph[1])
    # in the graph: two counts, where the edges of each corner begin, which point each corner is,
    # the edges, and the faces by points
    which = np.array(graph[2 + corners : 2 + 2 * corners])
    triangles = np.array(graph[-3 * faces :]).reshape(-1, 3)
    place = np.zeros(len(points), np.int64)
    place[which] = np.arange(corners)
    return Surface(points=points[which], faces=place[triangles])


def _outermost_in_cells(points: Points) -> Points:
    """Return, of the points in each cell of a grid, the one farthest from the middle of all."""
    lower, sides = points.min(axis=0), np.ptp(points, axis=0)
    unit = (points - lower) / sides
    place = np.minimum(unit * _CELLS, _CELLS - 1).astype(np.int64)
    key = (place[:, 0] * _CELLS + place[:, 1]) * _CELLS + place[:, 2]
    order = np.lexsort((-((unit - 0.5) ** 2).sum(axis=1), key))
    _, first = np.unique(key[order], return_index=True)
    return points[order[first]]


def _outermost_in_directions(
    points: Points, count: int
) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Return which points lie farthest out in directions spread evenly over a sphere."""
    k = np.arange(count) + 0.5
    z = 1 - 2 * k / count
    around = np.pi * (1 + 5**0.5) * k  # turned by the golden angle each
    radius = np.sqrt(1 - z**2)
    directions = np.stack([radius * np.cos(around), radius * np.sin(around), z])
    return np.unique((points @ directions).argmax(axis=0))

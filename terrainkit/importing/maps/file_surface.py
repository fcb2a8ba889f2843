"""Look up the surface of a file at any point, apart from the sampling that makes the map."""

import numpy as np
from numpy.typing import NDArray

from terrainkit.geometry.triangle_tree import first_triangle
from terrainkit.importing.readers.height_source import Source, VertexSource
from terrainkit.importing.readers.mesh_source import MeshSource
from terrainkit.importing.readers.raster import Raster

Array = NDArray[np.float64]

_NUM_NEIGHBORS = 8
"""Points of a cloud that are compared at each place."""

_PARTS = 2048
"""Parts of each side in which faces without places are found."""


def surface_points(source: Source, xy: Array, cell: float) -> Array:
    """Return points of the highest surface of a file near n places.

    Args:
        source: The ground, in the frame of the file.
        xy: The places [m], shape (n, 2).
        cell: Distance within which the points of a cloud are ground [m].

    Returns:
        Points [m], shape (n, k, 3), with z NaN where the file has no ground.
    """
    if isinstance(source, MeshSource):
        return _mesh_points(source, xy)
    if isinstance(source, Raster):
        return _raster_points(source, xy)
    assert isinstance(source, VertexSource)
    return _cloud_points(source, xy, cell)


def _mesh_points(mesh: MeshSource, xy: Array) -> Array:
    """Cast rays from above; the plane of the first face gives the height in double precision."""
    faces = mesh.faces[_has_place(mesh, xy)]
    z = np.full(len(xy), np.nan)
    if len(faces):
        used, index = np.unique(faces, return_inverse=True)
        vertices = mesh.vertices[used]
        lower, upper = vertices.min(axis=0), vertices.max(axis=0)
        center = (lower + upper) / 2  # single precision rounds little there
        starts = np.column_stack([xy, np.full(len(xy), upper[2] + 1.0)]) - center
        down = np.broadcast_to([0.0, 0.0, -1.0], starts.shape)
        first = first_triangle(vertices - center, index.reshape(faces.shape))
        face, _ = first(starts, down, float(upper[2] - lower[2] + 2.0))
        a, b, c = np.moveaxis(mesh.vertices[faces[face]], 1, 0)
        normal = np.cross(b - a, c - a)
        with np.errstate(invalid="ignore", divide="ignore"):
            rise = (normal[:, :2] * (a[:, :2] - xy)).sum(axis=1) / normal[:, 2]
        low, high = np.minimum(np.minimum(a, b), c)[:, 2], np.maximum(np.maximum(a, b), c)[:, 2]
        z[face >= 0] = np.fmin(np.fmax(a[:, 2] + rise, low), high)[face >= 0]
    return np.column_stack([xy, z])[:, None]


def _has_place(mesh: MeshSource, xy: Array) -> NDArray[np.bool_]:
    """Return which faces may have a place below or above them: rays need no tree of the others."""
    low = xy.min(axis=0, initial=np.inf)
    step = np.maximum(xy.max(axis=0, initial=-np.inf) - low, 1e-9) / _PARTS
    i, j = np.minimum((xy - low) / step, _PARTS - 1).astype(int).T
    sums = np.zeros((_PARTS + 1, _PARTS + 1), np.int32)
    np.add.at(sums, (i + 1, j + 1), 1)
    sums = sums.cumsum(axis=0, dtype=np.int32).cumsum(axis=1, dtype=np.int32)
    parts = (mesh.vertices[:, :2] - low) / step
    # Single precision may move an edge.
    ends = [np.floor(parts + shift).clip(0, _PARTS) for shift in (-0.01, 1.01)]
    bounds = np.hstack([ends[0], -ends[1]]).astype(np.int16)
    a, b, c = (bounds.take(corners, axis=0) for corners in mesh.faces.T)
    i, j, i1, j1 = np.abs(np.minimum(np.minimum(a, b), c)).T
    return np.asarray(sums[i1, j1] - sums[i, j1] - sums[i1, j] + sums[i, j] > 0)


def _raster_points(raster: Raster, xy: Array) -> Array:
    """Interpolate between two samples, since the surface between four is a matter of choice."""
    limit = np.array(raster.values.shape) - 1
    index = np.clip((xy - raster.lower) / raster.spacing - 0.5, 0, limit)
    near = np.rint(index)
    step = index - near
    is_along_x = np.abs(step[:, 0]) >= np.abs(step[:, 1])
    step[~is_along_x, 0] = step[is_along_x, 1] = 0.0
    places = xy + (near + step - index) * raster.spacing
    ends = (near, np.clip(near + np.sign(step), 0, limit))
    z, other = (raster.values[tuple(end.astype(int).T)].astype(float) for end in ends)
    z += np.where(np.isnan(other), 0.0, other - z) * np.abs(step).sum(axis=1)
    return np.column_stack([places, z])[:, None]


def _cloud_points(cloud: VertexSource, xy: Array, cell: float) -> Array:
    """Take the nearest points, without those below the highest surface and a stray one above."""
    from scipy.spatial import KDTree

    tree = KDTree(cloud.vertices[:, :2], balanced_tree=False, compact_nodes=False)
    distance, number = tree.query(xy, _NUM_NEIGHBORS, distance_upper_bound=cell)
    points = cloud.vertices[np.minimum(number, len(cloud.vertices) - 1)]
    z = np.where(np.isfinite(distance), points[..., 2], np.nan)
    top = np.sort(np.nan_to_num(z, nan=-np.inf), axis=1)
    top = np.where(np.isfinite(top[:, -2]), top[:, -2], top[:, -1])[:, None]
    points[..., 2] = np.where(z < top - cell, np.nan, z)
    return np.asarray(points)

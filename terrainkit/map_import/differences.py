"""Compare an imported map with its file."""

import math
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.importing.height_source import Source
from terrainkit.importing.mesh_columns import Columns
from terrainkit.importing.mesh_source import MeshSource
from terrainkit.importing.raster import Raster
from terrainkit.map.import_report import ImportReport
from terrainkit.map.terrain_map import TerrainMap

MAX_POINTS = 1 << 20
"""Most points of a grid where a mesh or cloud and its map are compared."""

MAX_SAMPLES = 1 << 24
"""Most samples of a raster that are compared with its map: all of 4096 x 4096, in about 12 s."""

_POINTS_PER_BLOCK = 1 << 18

_INSIDE = 1e-3
"""Distance from a corner of a face to the point that represents it, as a share of the distance to
the centroid, so that the point is above its own body and not on its outline."""

_BETWEEN = 0.07
"""Distance from the corner of a cell to the point where a mesh is compared [cells]. At the corner
itself are the edges of many meshes."""

_BESIDE = 1e-3
"""Distance from the outline of a solid within which a point is on it as well as beside it [m]."""

_EDGE = 1e-3
"""Distance to a sample below which a point belongs to the cells on both sides [cells]."""


def make_report(
    terrain_map: TerrainMap,
    source: Source,
    origin: NDArray[np.float64],
    columns: Columns | None,
    **counts: Any,
) -> ImportReport:
    """Compare a map with its source.

    Args:
        terrain_map: The map.
        source: The ground of the file, in the frame of the file.
        origin: Point of the file that is at (0, 0, 0) in the map, shape (3,) [m].
        columns: The columns of a mesh at the samples of the map, in the frame of the map.
        counts: Fields of the report that are known.
    """
    worst, _ = _compare(terrain_map, _grid_points(terrain_map, source, origin), only_above=False)
    face = [0.0] * 5
    num_lost = 0
    if isinstance(source, MeshSource):
        points = _face_points(terrain_map, source, origin)
        face, num_lost = _compare(terrain_map, points, only_above=True)
    error, x, y, *_ = max(worst, face)
    lost: dict[str, Any] = {"lost_top": face[3], "map_top": face[4], "lost_at": (face[1], face[2])}
    cell = terrain_map.grid.cell
    num_hidden = 0 if columns is None else int((columns.sheets > cell / 2).sum())
    return ImportReport(
        max_error=error,
        max_error_at=(x, y) if error else None,
        num_lost_faces=num_lost,
        **(lost if num_lost else {}),
        **_overhangs(terrain_map, columns),
        hidden_area=num_hidden * cell**2,
        **counts,
    )


def _compare(
    terrain_map: TerrainMap, blocks: Iterator[NDArray[np.float64]], *, only_above: bool
) -> tuple[list[float], int]:
    """Return the largest error with its x, y, z and map height, and how many exceed half a cell."""
    worst = [0.0] * 5
    number = 0
    for points in blocks:
        error, map_top = _height_errors(terrain_map, points, only_above=only_above)
        number += int((error > terrain_map.grid.cell / 2).sum())
        k = int(np.argmax(error))
        worst = max(worst, [float(error[k]), *points[k].tolist(), float(map_top[k])])
    return worst, number


def _grid_points(
    terrain_map: TerrainMap, source: Source, origin: NDArray[np.float64]
) -> Iterator[NDArray[np.float64]]:
    """Yield the points of the file on its own grid, or of a mesh between the samples, in blocks."""
    grid = terrain_map.grid
    side = source.cell or grid.cell
    steps = source.spacing if isinstance(source, Raster) else (side, side)
    shift = (np.array(source.lower) - origin[:2] - grid.lower) / grid.cell
    if steps == (grid.cell, grid.cell) and np.abs(shift - shift.round()).max() < _EDGE:
        return  # these points are the samples of the map
    # A mesh is compared where the map interpolates: between the samples.
    between = origin[:2] + grid.lower + _BETWEEN * side
    begin = np.array(source.lower) + np.divide(steps, 2) if source.cell else between
    indices = []
    for k in (0, 1):
        low = max(source.lower[k], grid.lower[k] + origin[k])
        high = min(source.upper[k], grid.upper[k] + origin[k])
        first = math.ceil((low - begin[k]) / steps[k] - _EDGE)
        indices.append(np.arange(first, math.floor((high - begin[k]) / steps[k] + _EDGE) + 1))
    most = MAX_SAMPLES if isinstance(source, Raster) else MAX_POINTS
    stride = math.ceil(math.sqrt(len(indices[0]) * len(indices[1]) / most)) or 1
    i, j = (index[::stride] for index in indices)
    x, y = (begin[k] + number * steps[k] for k, number in enumerate((i, j)))
    length = max(1, _POINTS_PER_BLOCK // max(1, len(y)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a cloud warned of stray points before
        if isinstance(source, Raster):  # its method gives means of samples in steps of many cells
            heights: NDArray[np.floating] = source.values[np.ix_(i, j)]
        else:
            heights = source.heights(x, y) if len(x) and len(y) else np.empty((0, 0))
    for start in range(0, len(heights), length):
        z = heights[start : start + length]
        places = np.meshgrid(x[start : start + length], y, indexing="ij")
        points = np.column_stack([places[0].ravel(), places[1].ravel(), z.ravel()]) - origin
        points = points[~np.isnan(points[:, 2])]
        if len(points):
            yield points


def _face_points(
    terrain_map: TerrainMap, source: MeshSource, origin: NDArray[np.float64]
) -> Iterator[NDArray[np.float64]]:
    """Yield a point next to the highest corner of each face above the map, in blocks."""
    lower = np.subtract(terrain_map.grid.lower, _BESIDE)
    upper = np.add(terrain_map.grid.upper, _BESIDE)
    for start in range(0, len(source.faces), _POINTS_PER_BLOCK):
        corners = source.vertices[source.faces[start : start + _POINTS_PER_BLOCK]] - origin
        highest = corners[np.arange(len(corners)), np.argmax(corners[..., 2], axis=1)]
        points = highest + _INSIDE * (corners.mean(axis=1) - highest)
        inside = (points[:, :2] >= lower) & (points[:, :2] <= upper)
        points = points[inside.all(axis=1)]
        if len(points):
            yield points


def _height_errors(
    terrain_map: TerrainMap, points: NDArray[np.float64], *, only_above: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the difference of each point from the map seen from above, and the map's height.

    In a cell with a wall, heights between its lowest and its highest sample are no difference.

    Args:
        terrain_map: The map.
        points: Points in the frame of the map [m], shape (n, 3).
        only_above: Whether points below the map are no difference, since they may be hidden.
    """
    xy, z = points[:, :2], points[:, 2]
    heights = terrain_map.heights
    top = terrain_map.height(xy)
    error = np.abs(z - top)
    if len(terrain_map.solids):
        error = np.full(len(z), np.inf)  # a solid may stand where the file has only ground
        high = max(float(heights.max()), float(terrain_map.solids.bounds()[1][:, 2].max())) + 1.0
        for shift in (-_BESIDE, _BESIDE):
            for direction in ((shift, shift), (shift, -shift)):
                beside = np.column_stack([xy + direction, np.full(len(xy), high)])
                found = terrain_map.scan(beside)
                top, error = np.maximum(top, found), np.minimum(error, np.abs(z - found))
    index = (xy - terrain_map.first_sample) / terrain_map.grid.cell
    limit = np.array(heights.shape) - 1
    first, last = (np.floor(index + shift).astype(int) for shift in (-_EDGE, _EDGE))
    corners = [
        heights[tuple(np.clip(np.column_stack([i, j]), 0, limit).T)]
        for i in (first[:, 0], last[:, 0] + 1)
        for j in (first[:, 1], last[:, 1] + 1)
    ]
    if (first != last).any():
        corners.append(heights[tuple(np.clip(last, 0, limit).T)])
    lowest, highest = np.min(corners, axis=0), np.max(corners, axis=0)
    beyond = np.maximum(np.maximum(z - np.maximum(highest, top), lowest - z), 0.0)
    has_wall = highest - lowest > terrain_map.config.wall_threshold
    error = np.where(has_wall, np.minimum(error, beyond), error)
    return np.where(z > top, error, 0.0) if only_above else error, top


def _overhangs(terrain_map: TerrainMap, columns: Columns | None) -> dict[str, Any]:
    """Compare the map with the mesh at the samples where something hangs over the ground."""
    if columns is None or np.isnan(columns.ceiling).all():
        return {}
    grid = terrain_map.grid
    i, j = np.nonzero(~np.isnan(columns.ceiling))
    xy = np.column_stack([grid.axis(0)[i], grid.axis(1)[j]])
    top, ground, ceiling = columns.top[i, j], columns.floor[i, j], columns.ceiling[i, j]
    map_ground = terrain_map.height(xy)
    map_ceiling = map_ground + terrain_map.clearance(xy)
    map_top = terrain_map.scan(np.column_stack([xy, top + 1.0]))
    is_kept = np.isfinite(map_ceiling)
    error = np.abs(map_ground - ground)
    for mine, theirs in ((map_ceiling, ceiling), (map_top, top)):
        error = np.maximum(error, np.where(is_kept, np.abs(mine - theirs), 0.0))
    worst = int(np.argmax(error))
    return {
        "overhang_area": len(i) * grid.cell**2,
        "lost_area": int((~is_kept).sum()) * grid.cell**2,
        "overhang_error": float(error[worst]),
        "overhang_error_at": (float(xy[worst, 0]), float(xy[worst, 1])),
    }

"""Compare an imported map with its file.

The comparison looks up the file at points that are not the samples of the map, and asks the
finished map for its height there. With the code of the sampling, it would share its mistakes.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.importing.maps.file_surface import surface_points
from terrainkit.importing.readers.height_source import Source
from terrainkit.importing.readers.mesh_columns import Columns
from terrainkit.importing.readers.mesh_source import MeshSource
from terrainkit.importing.readers.raster import Raster
from terrainkit.map.import_report import ImportReport
from terrainkit.map.terrain_map import TerrainMap

Array = NDArray[np.float64]

MAX_POINTS = 1 << 16
"""Most random points where a file and its map are compared."""

TOLERANCES = (0.01, 0.05)
"""Differences whose shares are counted, besides a cell [m]."""

_POINTS_PER_CELL = 4

_POINTS_PER_BLOCK = 1 << 18

_MAX_PLACES = 3
"""Most places of large differences in a report."""

_APART = 10
"""Least distance between two of these places [cells]."""

_INSIDE = 1e-3
"""Distance from a corner of a face to the point that represents it, as a share of the distance to
the centroid, so that the point is above its own body and not on its outline."""

_BESIDE = 1e-3
"""Distance from the outline of a solid within which a point is on it as well as beside it [m]."""

_ROUNDING = 1e-6
"""Difference up to which heights are equal [m]."""

_EDGE = 1e-3
"""Distance to a sample below which a point belongs to the cells on both sides [cells]."""


def make_report(
    terrain_map: TerrainMap,
    source: Source,
    origin: Array,
    columns: Columns | None,
    holes: NDArray[np.bool_],
    **counts: Any,
) -> ImportReport:
    """Compare a map with its source.

    Args:
        terrain_map: The map.
        source: The ground of the file, in the frame of the file.
        origin: Point of the file that is at (0, 0, 0) in the map, shape (3,) [m].
        columns: The columns of a mesh at the samples of the map, in the frame of the map.
        holes: Samples of the map that are in a hole of a mesh.
        counts: Fields of the report that are known.
    """
    grid = terrain_map.grid
    is_mesh = isinstance(source, MeshSource)
    lower = np.maximum(grid.lower, source.lower - origin[:2])
    size = np.maximum(np.minimum(grid.upper, source.upper - origin[:2]) - lower, 0.0)
    places = lower + _random_points(size, grid.cell)
    points = surface_points(source, places + origin[:2], grid.cell) - origin
    is_known = ~np.isnan(points[..., 2])
    errors = np.full(is_known.shape, np.inf)
    errors[is_known] = _height_errors(terrain_map, points[is_known], is_exact=is_mesh)
    is_ground = is_known.any(axis=1)
    error = errors.min(axis=1)[is_ground]
    worst = _distinct(np.column_stack([error, places[is_ground]]), grid.cell)
    num_lost = 0
    for block in _extreme_points(terrain_map, source, origin):
        apart = _height_errors(terrain_map, block, only_above=is_mesh)
        num_lost += int((apart > grid.cell / 2).sum()) if is_mesh else 0
        worst += _distinct(np.column_stack([apart, block[:, :2]]), grid.cell)
    largest = _distinct(np.array(worst).reshape(-1, 3), grid.cell)
    # The edge of a hole moves by up to half a cell.
    index = (places - terrain_map.first_sample) / grid.cell
    near = np.clip([np.floor(index), np.ceil(index)], 0, np.array(grid.shape) - 1).astype(int)
    hole_corners = [holes[i, j] for i in near[..., 0] for j in near[..., 1]]
    is_filled = ~is_ground & ~np.any(hole_corners, axis=0)
    is_lost = is_ground & np.all(hole_corners, axis=0)
    area_per_point = float(size.prod()) / max(1, len(places))
    num_hidden = 0 if columns is None else int((columns.sheets > grid.cell / 2).sum())
    number = max(1, len(error))
    return ImportReport(
        num_points=len(error),
        shares=tuple(int((error <= limit).sum()) / number for limit in (*TOLERANCES, grid.cell)),
        max_error=largest[0][0] if largest else 0.0,
        max_error_at=largest[0][1:] if largest else None,
        further_errors=tuple(place for place in largest[1:] if place[0] > TOLERANCES[0]),
        covered_area=float(is_ground.sum()) * area_per_point,
        filled_area=float(is_filled.sum()) * area_per_point,
        lost_ground_area=float(is_lost.sum()) * area_per_point,
        hole_area=int(holes.sum()) * grid.cell**2,
        num_lost_faces=num_lost,
        hidden_area=num_hidden * grid.cell**2,
        **_overhangs(terrain_map, columns),
        **counts,
    )


def _random_points(size: Array, cell: float) -> Array:
    """Return a random point in each part of an evenly divided rectangle at (0, 0), shape (n, 2)."""
    number = min(MAX_POINTS, _POINTS_PER_CELL * float(size.prod()) / cell**2)
    if number < 1:
        return np.empty((0, 2))
    nx = max(1, round((number * size[0] / size[1]) ** 0.5))
    parts = np.indices((nx, max(1, int(number / nx)))).reshape(2, -1).T
    places = parts + np.random.default_rng(0).random(parts.shape)
    return np.asarray(places * size / (parts[-1] + 1))


def _distinct(rows: Array, cell: float) -> list[tuple[float, float, float]]:
    """Return the largest errors that are apart from each other, with their x and y.

    Args:
        rows: Error, x and y of each point [m], shape (n, 3).
        cell: Distance between two samples of the map [m].
    """
    found: list[tuple[float, float, float]] = []
    rows = rows[rows[:, 0] > _ROUNDING]
    while len(rows) and len(found) < _MAX_PLACES:
        error, x, y = rows[np.argmax(rows[:, 0])].tolist()
        found.append((error, x, y))
        rows = rows[np.hypot(rows[:, 1] - x, rows[:, 2] - y) > _APART * cell]
    return found


def _extreme_points(terrain_map: TerrainMap, source: Source, origin: Array) -> Iterator[Array]:
    """Yield points of a file that its map may miss, in blocks."""
    grid = terrain_map.grid
    lower, upper = np.subtract(grid.lower, _BESIDE), np.add(grid.upper, _BESIDE)
    blocks: Iterator[Array] = iter(())
    if isinstance(source, MeshSource):
        blocks = _face_points(source)
    elif isinstance(source, Raster):
        shift = (np.array(source.lower) - origin[:2] - grid.lower) / grid.cell
        if source.spacing != (grid.cell,) * 2 or np.abs(shift - shift.round()).max() > _EDGE:
            blocks = _sample_points(source)
    for block in blocks:
        points = block - origin
        points = points[((points[:, :2] >= lower) & (points[:, :2] <= upper)).all(axis=1)]
        if len(points):
            yield points


def _face_points(mesh: MeshSource) -> Iterator[Array]:
    """Yield a point next to the highest corner of each face."""
    for start in range(0, len(mesh.faces), _POINTS_PER_BLOCK):
        corners = mesh.vertices[mesh.faces[start : start + _POINTS_PER_BLOCK]]
        highest = corners[np.arange(len(corners)), np.argmax(corners[..., 2], axis=1)]
        centroids = (corners[:, 0] + corners[:, 1] + corners[:, 2]) / 3
        yield highest + _INSIDE * (centroids - highest)


def _sample_points(raster: Raster) -> Iterator[Array]:
    """Yield the samples of a raster."""
    length = max(1, _POINTS_PER_BLOCK // raster.values.shape[1])
    y = raster.lower[1] + (np.arange(raster.values.shape[1]) + 0.5) * raster.spacing[1]
    for start in range(0, len(raster.values), length):
        block = raster.values[start : start + length]
        x = raster.lower[0] + (start + np.arange(len(block)) + 0.5) * raster.spacing[0]
        points = np.column_stack([np.repeat(x, len(y)), np.tile(y, len(x)), block.ravel()])
        yield points[~np.isnan(points[:, 2])]


def _height_errors(
    terrain_map: TerrainMap, points: Array, *, only_above: bool = False, is_exact: bool = False
) -> Array:
    """Return the difference of each point from the map seen from above.

    A wall of the map is up to half a cell from that of its file. In a cell with a wall, the heights
    of all its samples are therefore no difference.

    Args:
        terrain_map: The map.
        points: Points in the frame of the map [m], shape (n, 3).
        only_above: Whether points below the map are no difference, since they may be hidden.
        is_exact: Whether heights between those of the samples of a cell with a wall are a
            difference: they are not if a point may be on the wall itself.
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
    if only_above:
        error[z <= top] = 0.0
    rows = np.flatnonzero(error > _ROUNDING)
    walls = _wall_errors(terrain_map, points[rows], top[rows], is_exact=is_exact)
    error[rows] = np.minimum(error[rows], walls)
    return error


def _wall_errors(terrain_map: TerrainMap, points: Array, top: Array, *, is_exact: bool) -> Array:
    """Return the differences that a wall leaves; infinite where the map has none."""
    heights, z = terrain_map.heights, points[:, 2]
    index = (points[:, :2] - terrain_map.first_sample) / terrain_map.grid.cell
    limit = np.array(heights.shape) - 1
    first, last = (np.floor(index + shift).astype(int) for shift in (-_EDGE, _EDGE))
    # Of a point beside a sample, these are the samples of the cells on both sides.
    both = [last + 1] if (first != last).any() else []
    around = np.clip([first, first + 1, *both], 0, limit)
    corners = [heights[i, j] for i in around[..., 0] for j in around[..., 1]]
    lowest, highest = np.min(corners, axis=0), np.max(corners, axis=0)
    if is_exact:
        beyond = np.abs(corners - z).min(axis=0)
    else:
        beyond = np.maximum(np.maximum(z - np.maximum(highest, top), lowest - z), 0.0)
    has_wall = highest - lowest > terrain_map.config.wall_threshold
    if terrain_map.walls is not None:  # a slope is no wall, however steep
        bits = [terrain_map.walls[i, j] for i in around[..., 0] for j in around[..., 1]]
        has_wall = np.any(bits, axis=0)
    return np.where(has_wall, beyond, np.inf)


def _overhangs(terrain_map: TerrainMap, columns: Columns | None) -> dict[str, Any]:
    """Compare the map with the mesh at the samples where something hangs over the ground."""
    if columns is None or np.isnan(columns.ceiling).all():
        return {}
    grid = terrain_map.grid
    i, j = np.nonzero(~np.isnan(columns.ceiling))
    xy = np.column_stack([grid.axis(0)[i], grid.axis(1)[j]])
    top, ground, ceiling = columns.top[i, j], columns.floor[i, j], columns.ceiling[i, j]
    map_ground = terrain_map.height(xy)
    map_ceiling = map_ground + terrain_map.clearance(xy, step_height=0.0)
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

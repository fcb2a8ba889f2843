"""Import a file of heights or a mesh as a map."""

import hashlib
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError, HeightFileError
from terrainkit.geometry.measured_difficulty import measured_difficulty
from terrainkit.geometry.solids import Solids
from terrainkit.geometry.walls import count_walls, file_walls
from terrainkit.importing.maps.differences import make_report
from terrainkit.importing.maps.ground_friction import read_friction
from terrainkit.importing.maps.import_spawns import place_spawns
from terrainkit.importing.maps.overhangs import find_bodies, overhang_solids
from terrainkit.importing.readers.extent import check_length, check_samples
from terrainkit.importing.readers.height_source import Source, fill_missing, open_source
from terrainkit.importing.readers.holes import dig_holes
from terrainkit.importing.readers.import_options import ImportOptions
from terrainkit.importing.readers.mesh_source import MeshSource
from terrainkit.map.edit import assign_solids
from terrainkit.map.generation import pad_poses
from terrainkit.map.import_report import ImportReport
from terrainkit.map.map_config import MapConfig
from terrainkit.map.patch import PatchParameters
from terrainkit.map.terrain_map import TerrainMap
from terrainkit.settings.type_hint import MAX_VALUE
from terrainkit.terrain.parameter import MAX_TEXT_LENGTH
from terrainkit.terrain.patch_geometry import uniform_friction
from terrainkit.terrain.sub_terrain import SubTerrain

StepProgress = Callable[[Iterator[Any], int], Iterator[Any]]

_NUM_STEPS = 4
"""Steps of an import: reading, sampling, spawn positions, and the comparison with the file."""

DEFAULT_CELL = 0.1
"""Distance between two samples of a map that is made from a mesh [m]."""


_ROUNDING = 1e-4
"""Share of a cell that rounding of the extent of a file may take."""


@dataclass(frozen=True, kw_only=True)
class ImportedMap:
    """A map and the differences from its file."""

    terrain_map: TerrainMap
    """The map, of mode custom, with the report."""

    report: ImportReport
    """The differences."""


def import_map(
    path: str | Path,
    options: ImportOptions | None = None,
    *,
    progress: StepProgress | None = None,
) -> ImportedMap:
    """Return the map of a file of heights or a mesh.

    The difficulty of a patch is its rank by `measured_difficulty`, from 0 for the easiest to
    1 for the hardest; the patches stay where they are in the file.

    Args:
        path: The file: heights, a mesh, a point cloud or an MJCF scene; see docs/importing.md.
        options: How it becomes a map.
        progress: Wraps the steps of the import, given their number, for a progress bar.

    Warns:
        TerrainkitWarning: if heights are missing, an image has 8 bits only, cells are not squares,
            lengths are likely in another unit, or a patch has no flat ground and `spawn_tolerance`
            is None.

    Raises:
        HeightFileError: if the file cannot be read, or heights are missing.
        ConfigError: if an option is invalid, the file is too small for the patches, or a patch has
            no place to spawn.
        MemoryLimitError: if the map would not fit in memory.
    """
    steps = _import_steps(Path(path), options or ImportOptions())
    imported: ImportedMap
    *_, imported = progress(steps, _NUM_STEPS) if progress else steps
    return imported


def _import_steps(path: Path, options: ImportOptions) -> Iterator[Any]:
    """Yield None after each step, and the map last."""
    source = open_source(path, options)
    yield None
    check_length(path, source, options.cell or source.cell or DEFAULT_CELL)
    config, origin = _make_config(path, source, options)
    check_samples(path, source, config.cell, math.prod(config.grid.shape))
    size = config.rows, config.cols
    centers = np.array([config.patch_grid(*k).center for k in np.ndindex(size)])
    types = np.zeros(size, dtype=np.int32)
    yield from make_map(path, source, config, origin, options, centers.reshape(*size, 2), types)


def make_map(
    path: Path,
    source: Source,
    config: MapConfig,
    origin: NDArray[np.float64],
    options: ImportOptions,
    spawn_xy: NDArray[np.float64],
    terrain_types: NDArray[np.int32],
) -> Iterator[Any]:
    """Make the map of a source whose extent has been checked: yield None after each step.

    The last item is the `ImportedMap`.

    Args:
        path: The file, for errors.
        source: The ground.
        config: Configuration of the map.
        origin: Point of the source that becomes (0, 0, 0), shape (3,) [m].
        options: `missing`, `solids` and the options of friction are used.
        spawn_xy: Preferred spawn position of each patch in the map, shape (rows, cols, 2) [m].
        terrain_types: Sub-terrain of each patch, shape (rows, cols).

    Raises:
        HeightFileError: if heights are missing.
        ConfigError: if a patch has no place to spawn.
    """
    grid = config.grid
    if options.solids and not isinstance(source, MeshSource):
        raise ConfigError(f"solids: got {path}; expected a mesh")
    x, y = (grid.axis(k) + origin[k] for k in (0, 1))
    solids = Solids.empty()
    columns = None
    counts = {}
    if isinstance(source, MeshSource):
        ground = source
        if options.solids:
            bodies = find_bodies(source, grid, origin)
            counts = {"num_thin_bodies": len(bodies.thin), "num_open_bodies": bodies.num_open}
            ground = replace(source, faces=source.faces[~bodies.thin_faces])
        columns = ground.columns(x, y).lowered(origin[2])
        found = columns.floor if options.solids else columns.top
        if options.solids:
            parts = overhang_solids(path, bodies, columns, grid, config.wall_threshold)
            solids = assign_solids(config, parts)
    else:
        found = source.heights(x, y) - origin[2]
    found, holes = dig_holes(found, options.hole_depth if columns else 0.0)
    # A sum with 0 makes -0 to 0.
    heights = fill_missing(path, found, options.missing, x, y).astype(np.float32) + np.float32(0)
    if not (np.abs(heights) <= MAX_VALUE).all():
        raise HeightFileError(f"{path}: got heights beyond {MAX_VALUE:g} m")
    friction = read_friction(options, source, x, y)
    yield None
    relax = options.spawn_tolerance is None
    walls = file_walls(heights, config.wall_threshold)
    config, spawns = place_spawns(config, heights, solids, walls, holes, spawn_xy, relax=relax)
    # Several sub-terrains are names of columns: all have the same parameters.
    record = config.sub_terrains[0].at(0.0).requested()
    terrain_map = TerrainMap(
        config=config,
        grid=grid,
        heights=heights,
        walls=walls,
        friction=uniform_friction(config.static_friction, grid.shape)
        if friction is None
        else friction,
        spawns=pad_poses(spawns),
        terrain_types=terrain_types,
        terrain_names=tuple(sub_terrain.name for sub_terrain in config.sub_terrains),
        difficulty=_difficulty(config, heights, spawns),
        parameters=np.full(spawns.shape, PatchParameters(requested=record, realized=record)),
        solids=solids,
        goals=np.empty((*spawns.shape, 0, 4), dtype=np.float32),
    )
    if walls is not None:
        num_walls = count_walls(heights, walls)
        num_steep = count_walls(heights, config.wall_threshold)
        counts |= {"num_walls": num_walls, "num_steep_slopes": num_steep - num_walls}
    counts["num_missing"] = int(np.isnan(found).sum())
    yield None
    report = make_report(terrain_map, source, origin, columns, holes, **counts)
    terrain_map = replace(terrain_map, import_reports=(report,))
    yield ImportedMap(terrain_map=terrain_map, report=report)


def _make_config(
    path: Path, source: Source, options: ImportOptions
) -> tuple[MapConfig, NDArray[np.float64]]:
    """Return the configuration of the map, and its origin in the file.

    Args:
        path: The file, for errors.
        source: The ground.
        options: How the file becomes a map.

    Raises:
        ConfigError: if the patches do not fit in the file.
    """
    cell = options.cell or source.cell or DEFAULT_CELL
    origin = np.array(options.origin or (*source.lower, 0.0))
    counts, sizes = [], []
    for k, count in enumerate((options.rows, options.cols)):
        axis = "xy"[k]
        extent = source.upper[k] - float(origin[k])
        if origin[k] < source.lower[k] - cell / 2 or not cell / 2 <= extent < math.inf:
            raise ConfigError(
                f"origin: got {axis} = {origin[k]:g} m; the file extends from "
                f"{source.lower[k]:g} m to {source.upper[k]:g} m"
            )
        if options.patch_size:
            size = options.patch_size[k]
            count = count or math.floor(extent / size + _ROUNDING)
        else:
            count = count or 1
            size = round(math.floor(extent / cell / count + _ROUNDING) * cell, 9)
        if count < 1 or size < cell or count * size > extent + cell / 2:
            raise ConfigError(
                f"patches along {axis}: got {max(count, 1)} of {size or cell:g} m; {path} has "
                f"{extent:g} m from the origin on"
            )
        counts.append(count)
        sizes.append(size)
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    record = {"file": path.name[:MAX_TEXT_LENGTH], "sha256": digest, **read_settings(options)}
    config = MapConfig(
        rows=counts[0],
        cols=counts[1],
        patch_size=(sizes[0], sizes[1]),
        cell=cell,
        border=options.border,
        terrains=(SubTerrain(terrain="imported", name=path.stem, parameters=record),),
        mode="custom",
        **map_settings(options),
    )
    return config, origin


def map_settings(options: ImportOptions) -> dict[str, Any]:
    """Return the options that are settings of the map as well: walls and spawn positions."""
    names = ("slope_threshold", "spawns_per_patch", "spawn_radius", "spawn_headroom")
    given = options.spawn_tolerance
    tolerance = MapConfig.spawn_tolerance if given is None else given
    return {**{name: getattr(options, name) for name in names}, "spawn_tolerance": tolerance}


def read_settings(options: ImportOptions) -> dict[str, Any]:
    """Return the options that are parameters of the terrain `imported` as well."""
    low, high = options.height_range or (0.0, 0.0)
    x, y = options.file_spacing or (0.0, 0.0)
    return {
        "vertical_exaggeration": 1.0,
        "file_cell": x,
        "file_cell_y": 0.0 if y == x else y,
        "height_span": abs(high - low),
        "scale": options.scale or 0.0,
        "up": options.up,
        "missing": options.missing,
        "hole_depth": options.hole_depth,
    }


def _difficulty(
    config: MapConfig, heights: NDArray[np.float32], spawns: NDArray[np.object_]
) -> NDArray[np.float32]:
    """Return the rank of each patch by measured difficulty, 0 to 1, shape (rows, cols)."""
    measured = [
        measured_difficulty(heights[config.patch_cells(*k)], config.cell, float(spawns[k][0, 2]))
        for k in np.ndindex(spawns.shape)
    ]
    rank = np.unique(np.round(measured, 6), return_inverse=True)[1].reshape(spawns.shape)
    return np.asarray(rank / max(1, rank.max()), dtype=np.float32)

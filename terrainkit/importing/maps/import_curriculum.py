"""Import several files as one map whose rows are levels of difficulty."""

import math
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import (
    ConfigError,
    HeightFileError,
    TerrainkitWarning,
    listing,
    prefixed_errors,
)
from terrainkit.features.gradient_noise import edge_weights
from terrainkit.files.memory import check_memory
from terrainkit.files.suffix import modules_by_suffix
from terrainkit.geometry.measured_difficulty import measured_difficulty
from terrainkit.geometry.solids import Solids
from terrainkit.geometry.walls import file_walls
from terrainkit.importing.maps import import_map
from terrainkit.importing.maps.import_spawns import place_on_flattest, relaxed_config
from terrainkit.importing.readers.extent import check_length, check_samples
from terrainkit.importing.readers.height_source import Source, open_source
from terrainkit.importing.readers.import_options import ImportOptions
from terrainkit.map.import_report import ImportReport
from terrainkit.map.map_config import MapConfig
from terrainkit.map.patch_edges import PatchEdges, cliffs_text
from terrainkit.map.terrain_map import TerrainMap
from terrainkit.settings.type_hint import MAX_VALUE
from terrainkit.terrain.sub_terrain import SubTerrain

FileProgress = Callable[[Iterable[Path], int], Iterable[Path]]
"""Wraps the files, given their number, to show a progress bar."""

_BYTES_PER_SAMPLE = 60

# The spawn positions are placed later, after the edges of the patch have been blended.
_ANYWHERE: dict[str, Any] = {
    "spawns_per_patch": 1,
    "spawn_radius": 1e-4,
    "spawn_headroom": 0.0,
    "spawn_tolerance": MAX_VALUE,
}


class _Patch(NamedTuple):
    path: Path
    patch_map: TerrainMap
    difficulty: float
    report: ImportReport


def import_curriculum(
    paths: Sequence[str | Path],
    options: ImportOptions | None = None,
    *,
    blend: float = 1.0,
    progress: FileProgress | None = None,
) -> TerrainMap:
    """Return one map of several files, with the easiest patches in the first row.

    Each file is one patch, cropped at its center to the size of the smallest file. With
    `options.patch_size`, it is as many patches as fit. The patches are sorted by
    `measured_difficulty`, row by row. The map does not depend on the order of the paths.

    A patch is shifted, so that the median height of its outermost samples is 0, and its heights
    fade to 0 there. The border is flat. The mode is custom: each file is a sub-terrain of the map,
    which records its SHA-256.

    Args:
        paths: Files, and folders whose files are used; folders inside them are not.
        options: How the files are read, and `rows` and `cols` of the map: without them, one column,
            and as many rows as there are patches.
        blend: Distance over which the heights fade to 0 at the edges of a patch [m]; 0 to keep
            them.
        progress: Wraps the files, for a progress bar.

    Warns:
        TerrainkitWarning: if files or patches are left out, such as those that cannot be read or
            are smaller than a patch, patches meet at a cliff, or a patch has no flat ground and
            `spawn_tolerance` is None.

    Raises:
        HeightFileError: if no file can be used.
        ConfigError: if an option is invalid, or a patch has no place to spawn.
        MemoryLimitError: if the map would not fit in memory.
    """
    options = options or ImportOptions()
    _check_options(options, blend)
    files = _find_files(paths)
    is_whole = options.patch_size is None
    options = _with_common_size(files, options)
    patches: list[_Patch] = []
    skipped: list[str] = []
    for path in progress(files, len(files)) if progress else files:
        try:
            places = _places(path, options, is_whole)
        except HeightFileError as error:
            skipped.append(str(error))
            continue
        for source, lower in places:
            try:
                patches.append(_import_patch(path, options, source, lower, blend))
            except HeightFileError as error:
                skipped.append(str(error))
    if not patches:
        raise HeightFileError(f"skipped all files: {listing(skipped)}")
    if skipped:
        warnings.warn(f"skipped {listing(skipped)}", TerrainkitWarning, stacklevel=2)
    filled = [patch for patch in patches if patch.report.num_missing]
    if filled and options.missing == "nearest":
        warnings.warn(
            f"{len(filled)} of {len(patches)} patches have missing heights, such as "
            f"{filled[0].report.num_missing} of {filled[0].path}; they become the nearest heights",
            TerrainkitWarning,
            stacklevel=2,
        )
    return _arrange(patches, options)


def _check_options(options: ImportOptions, blend: float) -> None:
    if options.origin:
        raise ConfigError("origin: got a position; several files are cropped at their centers")
    if options.solids and blend:
        raise ConfigError(f"solids: got blend {blend:g}; expected 0, since solids cannot fade")
    if options.friction:
        raise ConfigError(f"friction: got {options.friction}; expected one file of heights")


def _find_files(paths: Sequence[str | Path]) -> list[Path]:
    """Return the files, and the files in folders that have a reader, sorted by name."""
    readers = modules_by_suffix("terrainkit.importing.readers")
    files = set[Path]()
    for path in map(Path, paths):
        inside = sorted(path.iterdir()) if path.is_dir() else []
        found = [file for file in inside if file.suffix.lower() in readers]
        if path.is_dir() and not found:
            raise HeightFileError(f"{path}: got no file to import; expected {listing(readers)}")
        # Other files of the same name belong to a file, such as the .mtl of an .obj.
        stems = tuple(f"{file.stem}." for file in found)
        if others := [file.name for file in inside if not file.name.startswith((*stems, "."))]:
            text = f"{path}: ignored what has no reader: {listing(others)}"
            warnings.warn(text, TerrainkitWarning, stacklevel=3)
        files |= {*found} if path.is_dir() else {path}
    return sorted(files, key=lambda path: (path.name, path))


def _with_common_size(files: Sequence[Path], options: ImportOptions) -> ImportOptions:
    """Return the options with the smallest cell and the smallest size of the files."""
    extents = []
    for path in files if options.patch_size is None or options.cell is None else ():
        # Errors and warnings come when the file is imported.
        with suppress(HeightFileError), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            source = open_source(path, options)
            size = np.subtract(source.upper, source.lower)
            extents.append((*size.tolist(), source.cell or import_map.DEFAULT_CELL))
    if not extents:
        return options
    *sizes, cell = map(min, zip(*extents, strict=True))
    cell = options.cell or cell
    x, y = (round(math.floor(size / cell + 1e-6) * cell, 9) for size in sizes)
    return replace(options, cell=cell, patch_size=options.patch_size or (x, y))


def _places(
    path: Path, options: ImportOptions, is_whole: bool
) -> list[tuple[Source, NDArray[np.float64]]]:
    """Return the ground and the lower corner of each patch of a file, centered in the file."""
    source = open_source(path, options)
    size = np.array(options.patch_size)
    step = source.cell or import_map.DEFAULT_CELL
    check_length(path, source, options.cell or step)
    lower, extent = np.array(source.lower), np.subtract(source.upper, source.lower)
    counts = np.floor(extent / size + 1e-6).astype(int)
    if not counts.all():
        text = " x ".join(f"{length:g} m" for length in extent)
        raise HeightFileError(f"{path}: got {text}; expected at least patch_size, {size} m")
    counts = np.ones_like(counts) if is_whole else counts
    samples = math.prod(counts * size) / (options.cell or step) ** 2
    check_samples(path, source, options.cell or step, round(samples))
    # Whole cells, so that a map with the cells of the file has its heights.
    lower += np.floor((extent - counts * size) / 2 / step + 1e-6) * step
    return [(source, lower + index * size) for index in np.ndindex(*counts)]


def _import_patch(
    path: Path,
    options: ImportOptions,
    source: Source,
    lower: NDArray[np.float64],
    blend: float,
) -> _Patch:
    """Return a patch of a file, whose edges fade to height 0."""
    place = replace(options, origin=(*lower.tolist(), 0.0), rows=1, cols=1, border=0.0)
    # The whole map records the files, once each.
    config, origin = import_map.make_config(path, source, place, SubTerrain(terrain="imported"))
    anywhere = replace(config, **_ANYWHERE)
    center = np.array([[config.patch_grid(0, 0).center]])
    types = np.zeros((1, 1), dtype=np.int32)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*heights are missing", TerrainkitWarning)
        *_, imported = import_map.make_map(path, source, anywhere, origin, place, center, types)
    made, grid = imported.terrain_map, config.grid
    edges = np.ones(grid.shape, dtype=bool)
    edges[1:-1, 1:-1] = False
    level = float(np.median(made.heights[edges]))
    weights = edge_weights(grid, blend) if blend else 1.0
    heights = ((made.heights - level) * weights).astype(np.float32)
    solids = made.solids.transform(np.eye(3), (0.0, 0.0, -level))
    with prefixed_errors(f"{path}: "):
        walls = file_walls(heights, config.wall_threshold)
        placed = place_on_flattest(
            config, heights, solids, walls, imported.holes, (0, 0), center[0, 0]
        )
    spawns, tolerance = placed
    config = replace(config, spawn_tolerance=tolerance)
    made = replace(made, config=config, heights=heights, solids=solids, spawns=spawns[None, None])
    difficulty = measured_difficulty(heights, grid.cell, float(spawns[0, 2]))
    return _Patch(path, made, round(difficulty, 6), imported.report)


def _arrange(patches: Sequence[_Patch], options: ImportOptions) -> TerrainMap:
    """Return the map of the patches, sorted by difficulty."""
    cols = options.cols or 1
    rows = options.rows or max(1, len(patches) // cols)
    if rows * cols > len(patches):
        number = len(patches)
        raise ConfigError(f"rows, cols: got {rows} x {cols}; expected at most {number} patches")
    # Sorting is stable, and the files are sorted by name.
    ordered = sorted(patches, key=lambda patch: patch.difficulty)
    kept = np.linspace(0, len(ordered) - 1, rows * cols).round().astype(int)
    chosen = [ordered[k] for k in kept]
    if len(chosen) < len(ordered):
        text = f"used {len(chosen)} of {len(ordered)} patches, at equal distances in their order"
        warnings.warn(text, TerrainkitWarning, stacklevel=3)
    terrains = {}
    used = {patch.path for patch in chosen}
    numbers = Counter[str]()
    for path in dict.fromkeys(patch.path for patch in patches if patch.path in used):
        numbers[path.name] += 1  # files in several folders may have the same name
        name = path.name if numbers[path.name] == 1 else f"{path.name} ({numbers[path.name]})"
        terrains[path] = import_map.sub_terrain(path, name, options)
    config = MapConfig(
        rows=rows,
        cols=cols,
        patch_size=options.patch_size or MapConfig.patch_size,
        cell=options.cell or MapConfig.cell,
        border=options.border,
        terrains=tuple(terrains.values()),
        mode="custom",
        **import_map.map_settings(options),
    )
    samples = math.prod(config.grid.shape)
    check_memory(samples * _BYTES_PER_SAMPLE, f"a map of {samples} samples")
    heights = np.zeros(config.grid.shape, dtype=np.float32)
    solids = []
    spawns = np.empty((rows, cols), dtype=object)
    types = np.empty((rows, cols), dtype=np.int32)
    tolerances = {}
    for (path, made, _, _), index in zip(chosen, np.ndindex(rows, cols), strict=True):
        x, y = config.patch_grid(*index).lower
        heights[config.patch_cells(*index)] = made.heights
        moved = made.solids.transform(np.eye(3), (x, y, 0.0))
        solids.append(replace(moved, patch=np.full((len(moved), 2), index, dtype=np.int32)))
        spawns[index] = made.spawns[0, 0] + np.array([x, y, 0.0, 0.0], dtype=np.float32)
        types[index] = list(terrains).index(path)
        tolerances[index] = made.config.spawn_tolerance
    config = relaxed_config(config, tolerances, relax=options.spawn_tolerance is None)
    walls = file_walls(heights, config.wall_threshold)
    made = import_map.assemble_map(
        config, heights, Solids.concatenate(solids), spawns, types, walls
    )
    if cliffs := PatchEdges(terrain_map=made).cliffs():
        text = f"cliffs between patches: {cliffs_text(cliffs, made.patch_names)}"
        warnings.warn(text, TerrainkitWarning, stacklevel=3)
    return replace(made, import_reports=tuple(patch.report for patch in chosen))

"""Several files as the levels of a curriculum, which the terrain `imported` generates."""

import math
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from terrainkit.errors import ConfigError, HeightFileError, TerrainkitWarning, listing
from terrainkit.importing.maps.import_map import DEFAULT_CELL, map_settings, read_settings
from terrainkit.importing.readers.height_source import files_in
from terrainkit.importing.readers.import_options import ImportOptions
from terrainkit.importing.readers.raster import read_raster
from terrainkit.map.generation import Progress, generate
from terrainkit.map.map_config import MapConfig
from terrainkit.map.terrain_map import TerrainMap
from terrainkit.terrain.parameter import MAX_TEXTS
from terrainkit.terrain.sub_terrain import SubTerrain

_SINGLE = (
    *("nodata", "detect_nodata", "band", "key", "point_class"),
    *("friction", "friction_range", "friction_classes", "origin", "solids"),
)
"""Options that the terrain `imported` does not have."""

_PLATFORM = 2.0
"""Usual side of the flat square at the center of a patch [m]."""


def import_curriculum(
    paths: Sequence[str | Path],
    options: ImportOptions | None = None,
    *,
    progress: Progress | None = None,
) -> TerrainMap:
    """Generate a map of several files, with the easiest in the first row.

    The map has one sub-terrain, `imported`, and can be generated again from its config. It does not
    depend on the order of the paths. With several columns, each has another part of the files.

    Args:
        paths: Files, and folders whose files are used; folders inside them are not.
        options: How the files are read, and the map. By default, it has a row for each file and one
            column, the smallest cell of the files, and the size of the smallest file as the size of
            a patch.
        progress: Wraps the iterator over the patches, for a progress bar.

    Warns:
        TerrainkitWarning: if files are left out, which cannot be read or are smaller than a patch.

    Raises:
        HeightFileError: if no file can be used.
        ConfigError: if an option is invalid or is one for single files, or a patch has no place to
            spawn.
        MemoryLimitError: if the map would not fit in memory.
    """
    options = options or ImportOptions()
    for name in _SINGLE:
        if (value := getattr(options, name)) != getattr(ImportOptions, name):
            raise ConfigError(f"{name}: got {value} for several files; expected one file, alone")
    if options.height_range and options.height_range[0] > options.height_range[1]:
        low, high = options.height_range
        raise ConfigError(f"height_range: got {low:g} {high:g}; expected the lower height first")
    extents: dict[Path, tuple[float, ...]] = {}
    skipped = []
    for path in _find_files(paths):
        try:
            extents[path] = _extent(path, options)
        except HeightFileError as error:
            skipped.append(str(error))
    if not extents:
        raise HeightFileError(f"skipped all files: {listing(skipped)}")
    if skipped:
        warnings.warn(f"skipped {listing(skipped)}", TerrainkitWarning, stacklevel=2)
    *smallest, finest = map(min, zip(*extents.values(), strict=True))
    cell = options.cell or finest
    x, y = (round(math.floor(side / cell + 1e-6) * cell, 9) for side in smallest)
    patch_size = options.patch_size or (x, y)
    rows, cols = options.rows or len(extents), options.cols or 1
    side = min(patch_size)
    platform = max(2 * options.spawn_radius + 4 * cell, min(_PLATFORM, side / 4))
    parameters: dict[str, Any] = {
        **_named(list(extents), paths),
        **read_settings(options),
        "crop": "random" if cols > 1 else "center",
        "platform": min(platform, 0.75 * side),
    }
    config = MapConfig(
        rows=rows,
        cols=cols,
        patch_size=patch_size,
        cell=cell,
        border=options.border,
        terrains=(SubTerrain(terrain="imported", parameters=parameters),),
        **map_settings(options),
    )
    return generate(config, progress=progress)


def _extent(path: Path, options: ImportOptions) -> tuple[float, ...]:
    """Return the size of a file along x and y, and its cell [m]."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the terrain reads the file again
        raster = read_raster(path, options, options.missing, options.cell or DEFAULT_CELL)
    x, y = np.subtract(raster.upper, raster.lower).tolist()
    least_x, least_y = options.patch_size or (0.0, 0.0)
    if x < least_x - raster.cell / 2 or y < least_y - raster.cell / 2:
        expected = f"at least patch_size, {least_x:g} m x {least_y:g} m"
        raise HeightFileError(f"{path}: got {x:g} m x {y:g} m; expected {expected}")
    return x, y, raster.cell


def _find_files(paths: Sequence[str | Path]) -> list[Path]:
    """Return the files, and the files in folders that have a reader, sorted by name."""
    files = set[Path]()
    for path in map(Path, paths):
        found = files_in(path) if path.is_dir() else [path]
        # Other files of the same name belong to a file, such as the .mtl of an .obj.
        stems = (".", *(f"{file.stem}." for file in found))
        inside = sorted(path.iterdir()) if path.is_dir() else []
        if others := [file.name for file in inside if not file.name.startswith(stems)]:
            text = f"{path}: ignored what has no reader: {listing(others)}"
            warnings.warn(text, TerrainkitWarning, stacklevel=3)
        files |= {*found}
    return sorted(files, key=lambda path: (path.name, path))


def _named(files: list[Path], paths: Sequence[str | Path]) -> dict[str, Any]:
    """Return the parameter of `imported` that names the files: their folder, if it has no other."""
    folder = Path(paths[0])
    if len(paths) == 1 and folder.is_dir() and {*files_in(folder)} == {*files}:
        return {"file": folder.as_posix()}
    if len(files) > MAX_TEXTS:
        raise ConfigError(f"got {len(files)} files; expected at most {MAX_TEXTS}, or one folder")
    return {"files": tuple(path.as_posix() for path in files)}

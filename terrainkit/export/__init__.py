"""Export: a map as a file, in the format that the suffix names.

Every file in this folder that has `SUFFIXES` is an exporter; nothing else lists them. It has one
function, `export(terrain_map, path, ...)`, which writes `path` in full; its keyword-only arguments
are the options of the format.
"""

import importlib
import inspect
import pkgutil
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from terrainkit.atomic import atomic_write, check_target
from terrainkit.errors import ExportError, listing

if TYPE_CHECKING:
    from terrainkit.terrain_map import TerrainMap


def export(
    terrain_map: "TerrainMap", path: str | Path, *, overwrite: bool = False, **options: Any
) -> Path:
    """Write `terrain_map` to `path`, and return `path`.

    Args:
        terrain_map: The map.
        path: Target; its suffix names the format.
        overwrite: Replace an existing file.
        **options: Options of that format.

    Raises:
        ExportError: if the suffix or an option is unknown, the format cannot hold the map, or the
            target cannot be written; whatever was there is as it was.
    """
    path = Path(path)
    write = find(path).export
    known = options_of(path)
    for name in options:
        if name not in known:
            raise ExportError(f"{path.suffix} has no option {name!r}; it has: {listing(known)}")
    terrain_map.require_finite()
    with atomic_write(path, overwrite=overwrite) as temporary:
        write(terrain_map, temporary, **options)
    return path


def check(path: str | Path, *, overwrite: bool = False) -> None:
    """Raise the ExportError that :func:`export` would, before a map is made for it."""
    find(Path(path))
    check_target(Path(path), overwrite=overwrite)


def find(path: Path) -> ModuleType:
    """Return the exporter for the suffix of `path`, or raise the error that lists them."""
    exporters = suffixes()
    if path.suffix.lower() not in exporters:
        raise ExportError(
            f"no format for {path.suffix or 'a name without suffix'!r} ({path}); "
            f"there are: {listing(exporters)}"
        )
    return exporters[path.suffix.lower()]


def options_of(path: Path) -> tuple[str, ...]:
    """Return the names of the options that the format of `path` has."""
    parameters = inspect.signature(find(path).export).parameters.values()
    return tuple(p.name for p in parameters if p.kind is p.KEYWORD_ONLY)


@cache
def suffixes() -> dict[str, ModuleType]:
    """Return the exporter for each suffix."""
    modules = (
        importlib.import_module(f"{__name__}.{module.name}")
        for module in pkgutil.iter_modules(__path__)
    )
    return {suffix: module for module in modules for suffix in getattr(module, "SUFFIXES", ())}

"""Write a map in the format of the file suffix.

Each module in this folder that defines `SUFFIXES` is an exporter. Its function
`export(terrain_map, path, ...)` writes `path`; the keyword-only arguments of that function are the
options of the format. `BYTES_PER_SAMPLE` is its peak memory per sample.
"""

import inspect
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from terrainkit.errors import ExportError, listing
from terrainkit.export.npz import is_map_file
from terrainkit.export.requirements import require_finite
from terrainkit.files.atomic_write import atomic_write, check_target
from terrainkit.files.memory import check_memory
from terrainkit.files.suffix import find_module, modules_by_suffix

if TYPE_CHECKING:
    from terrainkit.map.terrain_map import TerrainMap


def export_files(
    terrain_map: "TerrainMap", path: str | Path, *, overwrite: bool = False, **options: Any
) -> tuple[Path, ...]:
    """Write `terrain_map` to `path`, and return `path` and the files that were written beside it.

    Args:
        terrain_map: The map.
        path: Target; its suffix selects the format.
        overwrite: Replace an existing file.
        **options: Options of the format.

    Raises:
        ExportError: if the suffix or an option is unknown, the format cannot represent the map, or
            the target cannot be written, also because a file beside it would replace a map; an
            existing target is unchanged.
    """
    path = Path(path)
    write = get_exporter(path).export
    known = export_options(path)
    for name in options:
        if name not in known:
            raise ExportError(f"option of {path.suffix}: got {name!r}; expected {listing(known)}")
    require_finite(terrain_map)
    with atomic_write(path, overwrite=overwrite) as temporary:
        write(terrain_map, temporary, **options)
        names = sorted({file.name for file in temporary.parent.iterdir()} - {path.name})
        files = tuple(path.with_name(name) for name in names)
        for file in filter(is_map_file, files):
            raise ExportError(f"cannot write {path}: {file} is a map; use another name")
    return (path, *files)


def check_export(path: str | Path, samples: int, *, rows: int = 0, overwrite: bool = False) -> None:
    """Raise the errors that are known before the map is generated: suffix, target, memory.

    With `rows`, the error about the memory says how many rows of the map would fit.
    """
    exporter = get_exporter(Path(path))
    check_target(Path(path), overwrite=overwrite)
    what = f"writing {samples} samples to {path}"
    check_memory(samples * exporter.BYTES_PER_SAMPLE, what, ("rows", rows))


def get_exporter(path: Path) -> ModuleType:
    """Return the exporter for the suffix of `path`.

    Raises:
        ExportError: if there is none.
    """
    return find_module(path, __name__, "format", ExportError)


def export_options(path: Path) -> tuple[str, ...]:
    """Return the names of the options of the format of `path`."""
    parameters = inspect.signature(get_exporter(path).export).parameters.values()
    return tuple(p.name for p in parameters if p.kind is p.KEYWORD_ONLY)


def exporters_by_suffix() -> dict[str, ModuleType]:
    """Return the exporters by suffix."""
    return modules_by_suffix(__name__)

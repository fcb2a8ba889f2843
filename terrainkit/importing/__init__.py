"""Import files of heights and meshes.

Each module in this folder that defines `SUFFIXES` is a reader. Its function `read(path, options)`
returns a `Source`. `terrainkit.import_map` makes a map of
it.
"""

from importlib import import_module
from typing import Any

__all__ = ["ImportOptions", "ImportReport", "ImportedMap", "import_map", "import_terrain_mesh"]


def __getattr__(name: str) -> Any:
    # They are in packages that import this one.
    if name in __all__:
        return getattr(import_module("terrainkit"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

"""Import files of heights and meshes: `readers` read files, and `maps` makes maps of them.

The two are layers. Terrains have readers, and a map has terrains; a map of a file is above both.
"""

from importlib import import_module
from typing import Any

__all__ = ["ImportOptions", "ImportReport", "ImportedMap", "import_map", "import_terrain_mesh"]


def __getattr__(name: str) -> Any:
    # They are in layers above the readers, which import this package.
    if name in __all__:
        return getattr(import_module("terrainkit"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

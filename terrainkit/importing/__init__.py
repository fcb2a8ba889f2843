"""Import files of heights and meshes.

Each module in this folder that defines `SUFFIXES` is a reader. Its function `read(path, options)`
returns a :class:`~terrainkit.importing.source.Source`.
"""

from terrainkit.importing.import_map import ImportedMap, ImportReport, import_map
from terrainkit.importing.options import ImportOptions
from terrainkit.importing.terrain_mesh import import_terrain_mesh

__all__ = ["ImportOptions", "ImportReport", "ImportedMap", "import_map", "import_terrain_mesh"]

"""Terrain for legged robots: heightfields with a curriculum, their trimesh, and spawn origins.

>>> import terrainkit
>>> terrain_map = terrainkit.generate(terrainkit.MapConfig(rows=4, cols=10))
>>> terrain_map.env_origins.shape
(4, 10, 3)
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from terrainkit.curriculum import update_levels
    from terrainkit.curriculum.waypoints import Waypoints
    from terrainkit.errors import TerrainkitError, TerrainkitWarning
    from terrainkit.features.building_codes import check_flight
    from terrainkit.features.flight import Flight
    from terrainkit.geometry.solids import Solids, make_boxes, make_cylinders, make_hulls
    from terrainkit.importing.import_options import ImportOptions
    from terrainkit.map.generation import generate
    from terrainkit.map.import_report import ImportReport
    from terrainkit.map.map_config import MapConfig
    from terrainkit.map.patch import Patch, make_patch
    from terrainkit.map.terrain_map import TerrainMap
    from terrainkit.map_import.import_curriculum import import_curriculum
    from terrainkit.map_import.import_map import ImportedMap, import_map
    from terrainkit.map_import.terrain_mesh import import_terrain_mesh
    from terrainkit.suites import Suite, generate_suite, get_suite, suite_hash, suite_names
    from terrainkit.terrain import parameter
    from terrainkit.terrain.overlay import Overlay
    from terrainkit.terrain.registry import register_overlay, register_terrain
    from terrainkit.terrain.sub_terrain import SubTerrain

__all__ = [
    "Flight",
    "ImportOptions",
    "ImportReport",
    "ImportedMap",
    "MapConfig",
    "Overlay",
    "Patch",
    "Solids",
    "SubTerrain",
    "Suite",
    "TerrainMap",
    "TerrainkitError",
    "TerrainkitWarning",
    "Waypoints",
    "check_flight",
    "generate",
    "generate_suite",
    "get_suite",
    "import_curriculum",
    "import_map",
    "import_terrain_mesh",
    "make_boxes",
    "make_cylinders",
    "make_hulls",
    "make_patch",
    "parameter",
    "register_overlay",
    "register_terrain",
    "suite_hash",
    "suite_names",
    "update_levels",
]
__version__ = "0.1.0"

_NAMES = {
    "curriculum": ("update_levels",),
    "curriculum.waypoints": ("Waypoints",),
    "errors": ("TerrainkitError", "TerrainkitWarning"),
    "features.building_codes": ("check_flight",),
    "features.flight": ("Flight",),
    "geometry.solids": ("Solids", "make_boxes", "make_cylinders", "make_hulls"),
    "importing.import_options": ("ImportOptions",),
    "map.generation": ("generate",),
    "map.import_report": ("ImportReport",),
    "map.map_config": ("MapConfig",),
    "map.patch": ("Patch", "make_patch"),
    "map.terrain_map": ("TerrainMap",),
    "map_import.import_curriculum": ("import_curriculum",),
    "map_import.import_map": ("ImportedMap", "import_map"),
    "map_import.terrain_mesh": ("import_terrain_mesh",),
    "suites.suite": ("Suite", "generate_suite", "get_suite", "suite_hash", "suite_names"),
    "terrain": ("parameter",),
    "terrain.overlay": ("Overlay",),
    "terrain.registry": ("register_overlay", "register_terrain"),
    "terrain.sub_terrain": ("SubTerrain",),
}
_MODULES = {name: module for module, names in _NAMES.items() for name in names}
"""Module of each public name, imported on first use: a robot needs no terrain."""


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

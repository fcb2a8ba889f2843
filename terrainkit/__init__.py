"""Terrain for legged robots: heightfields with a curriculum, their trimesh, and spawn origins.

>>> import terrainkit
>>> terrain_map = terrainkit.generate(terrainkit.MapConfig(rows=4, cols=10))
>>> terrain_map.env_origins.shape
(4, 10, 3)
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from terrainkit.config import MapConfig
    from terrainkit.curriculum import update_levels
    from terrainkit.errors import TerrainkitError, TerrainkitWarning
    from terrainkit.generation import generate
    from terrainkit.patch import Patch, make_patch
    from terrainkit.registry import register_overlay, register_terrain
    from terrainkit.sub_terrain import SubTerrain
    from terrainkit.suites import generate_suite, get_suite, suite_hash, suite_names
    from terrainkit.terrain_map import TerrainMap

__all__ = [
    "MapConfig",
    "Patch",
    "SubTerrain",
    "TerrainMap",
    "TerrainkitError",
    "TerrainkitWarning",
    "generate",
    "generate_suite",
    "get_suite",
    "make_patch",
    "register_overlay",
    "register_terrain",
    "suite_hash",
    "suite_names",
    "update_levels",
]
__version__ = "0.1.0"

_MODULES = {
    "MapConfig": "config",
    "Patch": "patch",
    "SubTerrain": "sub_terrain",
    "TerrainMap": "terrain_map",
    "TerrainkitError": "errors",
    "TerrainkitWarning": "errors",
    "generate": "generation",
    "generate_suite": "suites",
    "get_suite": "suites",
    "make_patch": "patch",
    "register_overlay": "registry",
    "register_terrain": "registry",
    "suite_hash": "suites",
    "suite_names": "suites",
    "update_levels": "curriculum",
}
"""Module of each public name, so that only those in use are imported: a robot needs no terrain."""


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

"""Terrain for legged robots: heightfields with a curriculum, their trimesh, and spawn origins.

>>> import terrainkit
>>> terrain_map = terrainkit.generate(terrainkit.MapConfig(rows=4, cols=10))
>>> terrain_map.env_origins.shape
(4, 10, 3)

The public names are those of `__init__.pyi`, imported on first use: a robot needs no terrain.
"""

from typing import Any

__version__ = "0.2.0"


def __getattr__(name: str) -> Any:
    from terrainkit.lazy_names import import_name

    value = globals()[name] = import_name(__name__, name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__getattr__("__all__")})

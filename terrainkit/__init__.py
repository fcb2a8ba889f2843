"""Terrain for legged robots: heightfields with a curriculum, their trimesh, and spawn origins.

>>> import terrainkit
>>> terrain_map = terrainkit.generate(terrainkit.MapConfig(rows=4, cols=10))
>>> terrain_map.env_origins.shape
(4, 10, 3)
"""

from terrainkit.choice import TerrainChoice
from terrainkit.config import MapConfig
from terrainkit.config_text import read_config
from terrainkit.curriculum import update_levels
from terrainkit.errors import TerrainkitError, TerrainkitWarning
from terrainkit.generate import generate
from terrainkit.patch import Patch, tile
from terrainkit.terrain_map import TerrainMap

__all__ = [
    "MapConfig",
    "Patch",
    "TerrainChoice",
    "TerrainMap",
    "TerrainkitError",
    "TerrainkitWarning",
    "generate",
    "read_config",
    "tile",
    "update_levels",
]
__version__ = "0.1.0"

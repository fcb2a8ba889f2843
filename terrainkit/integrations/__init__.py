"""Use maps in other frameworks.

There is one module for each framework. terrainkit does not depend on the frameworks: a module
raises an error with one line if its framework is not installed.
"""

from pathlib import Path

from terrainkit.terrain_map import TerrainMap


def load_map(source: TerrainMap | str | Path) -> TerrainMap:
    """Return the map `source`, or load it if it is the path of a .npz file."""
    return source if isinstance(source, TerrainMap) else TerrainMap.load(source)


def missing(framework: str, install: str) -> ModuleNotFoundError:
    """Return the error of a module whose framework is not installed."""
    return ModuleNotFoundError(f"{framework} is not installed; install it with: {install}")

"""The registry of terrains.

Each module in `terrainkit/terrains` is one terrain, named after its file. Other packages add
terrains as entry points of the group `terrainkit.terrains`.
"""

import importlib
import pkgutil
from functools import cache
from typing import TYPE_CHECKING

from terrainkit import terrains
from terrainkit.errors import ConfigError
from terrainkit.parameter import parameters_of
from terrainkit.terrain import Terrain
from terrainkit.text import expected_names

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

ENTRY_POINTS = "terrainkit.terrains"

INVERTED = "_inverted"
"""Suffix of the name of an inverted terrain in presets and maps."""


@cache
def terrain_names() -> tuple[str, ...]:
    """Return the names of the built-in terrains in alphabetical order, without importing them."""
    return tuple(sorted(module.name for module in pkgutil.iter_modules(terrains.__path__)))


def plugin_terrains() -> dict[str, "EntryPoint"]:
    """Return the entry points of terrains from other installed packages, by name."""
    from importlib.metadata import entry_points

    return {point.name: point for point in entry_points(group=ENTRY_POINTS)}


@cache
def get_terrain(name: str) -> type[Terrain]:
    """Return the terrain class `name`. Built-in terrains take precedence over plugins.

    Raises:
        ConfigError: if there is no such terrain, or a plugin cannot be loaded.
    """
    if name in terrain_names():
        return _builtin_terrain(name)
    plugins = plugin_terrains()
    if name not in plugins:
        base = name.removesuffix(INVERTED)
        if base in terrain_names() and "inverted" in parameters_of(get_terrain(base)):
            raise ConfigError(f"no terrain {name!r}; use {base} with inverted = true")
        expected = expected_names(name, [*terrain_names(), *plugins])
        raise ConfigError(f"no terrain {name!r}; {expected}")
    try:
        terrain = plugins[name].load()
    except (ImportError, AttributeError) as error:
        raise ConfigError(f"{name} ({plugins[name].value}) cannot be loaded: {error}") from error
    if not (isinstance(terrain, type) and issubclass(terrain, Terrain)):
        raise ConfigError(
            f"{name} ({plugins[name].value}): got {terrain!r}; expected a subclass of Terrain"
        )
    return terrain


def _builtin_terrain(name: str) -> type[Terrain]:
    module = importlib.import_module(f"{terrains.__name__}.{name}")
    classes = [
        value
        for value in vars(module).values()
        if isinstance(value, type) and issubclass(value, Terrain) and value.kind() == name
    ]
    if len(classes) != 1:
        raise ConfigError(
            f"{module.__file__}: got {len(classes)} subclasses of Terrain; expected one"
        )
    return classes[0]

"""The registry: every file in `terrainkit/terrains` is a terrain, named as its file is."""

import importlib
import pkgutil
from functools import cache

from terrainkit import terrains
from terrainkit.errors import ConfigError, listing
from terrainkit.terrain import Terrain


@cache
def names() -> tuple[str, ...]:
    """Return the name of each terrain, in alphabetical order; imports none of them."""
    return tuple(sorted(module.name for module in pkgutil.iter_modules(terrains.__path__)))


@cache
def find(name: str) -> type[Terrain]:
    """Return the terrain called `name`.

    Raises:
        ConfigError: if there is none, listing those that exist.
    """
    if name not in names():
        raise ConfigError(f"no terrain {name!r}; there are: {listing(names())}")
    module = importlib.import_module(f"{terrains.__name__}.{name}")
    found = [
        value
        for value in vars(module).values()
        if isinstance(value, type) and issubclass(value, Terrain) and value.kind() == name
    ]
    if len(found) != 1:
        raise ConfigError(f"{module.__file__} has {len(found)} subclasses of Terrain; wanted one")
    return found[0]

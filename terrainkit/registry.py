"""The registry: every file in `terrainkit/terrains` is a terrain, named as its file is.

Another package brings terrains of its own as entry points of the group `terrainkit.terrains`.
"""

import importlib
import pkgutil
from functools import cache
from typing import TYPE_CHECKING

from terrainkit import terrains
from terrainkit.errors import ConfigError
from terrainkit.parameter import parameters_of
from terrainkit.terrain import Terrain
from terrainkit.text import known_names

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

ENTRY_POINTS = "terrainkit.terrains"

INVERTED = "_inverted"
"""Ends the name that a terrain which stands upside down has in a preset, and so in a map."""


@cache
def names() -> tuple[str, ...]:
    """Return the name of each terrain of ours, in alphabetical order; imports none of them."""
    return tuple(sorted(module.name for module in pkgutil.iter_modules(terrains.__path__)))


def plugins() -> dict[str, "EntryPoint"]:
    """Return the entry point of each terrain that another installed package brings, by name."""
    from importlib.metadata import entry_points

    return {point.name: point for point in entry_points(group=ENTRY_POINTS)}


@cache
def find(name: str) -> type[Terrain]:
    """Return the terrain called `name`; ours go before those of other packages.

    Raises:
        ConfigError: if there is none, listing those that exist.
    """
    if name in names():
        return _ours(name)
    others = plugins()
    if name not in others:
        upright = name.removesuffix(INVERTED)
        if upright != name and upright in names() and "inverted" in parameters_of(find(upright)):
            raise ConfigError(f"no terrain {name!r}; it is {upright} with inverted = true")
        raise ConfigError(f"no terrain {name!r}; {known_names(name, [*names(), *others])}")
    try:
        found = others[name].load()
    except (ImportError, AttributeError) as error:
        raise ConfigError(f"{name} ({others[name].value}) cannot be loaded: {error}") from error
    if not (isinstance(found, type) and issubclass(found, Terrain)):
        raise ConfigError(
            f"{name} ({others[name].value}) is {found!r}; wanted a subclass of Terrain"
        )
    return found


def _ours(name: str) -> type[Terrain]:
    module = importlib.import_module(f"{terrains.__name__}.{name}")
    found = [
        value
        for value in vars(module).values()
        if isinstance(value, type) and issubclass(value, Terrain) and value.kind() == name
    ]
    if len(found) != 1:
        raise ConfigError(f"{module.__file__} has {len(found)} subclasses of Terrain; wanted one")
    return found[0]

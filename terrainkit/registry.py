"""The registry of terrains and overlays.

Each module in `terrainkit/terrains` is one terrain, named after its file, and each module in
`terrainkit/overlays` one overlay. Other packages add
terrains as entry points of the group `terrainkit.terrains`, and a program or notebook registers its
own classes.
"""

import importlib
import inspect
import pkgutil
from collections.abc import Mapping
from functools import cache
from types import ModuleType
from typing import TYPE_CHECKING, Any, TypeVar

from terrainkit import overlays, terrains
from terrainkit.errors import ConfigError
from terrainkit.overlay import Overlay
from terrainkit.parameter import check_names, parameters_of
from terrainkit.terrain import Terrain
from terrainkit.text import expected_names

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

ENTRY_POINTS = "terrainkit.terrains"

INVERTED = "_inverted"
"""Suffix of the name of an inverted terrain in presets and maps."""

_T = TypeVar("_T", bound=type[Terrain])

_registered: dict[str, type[Terrain]] = {}
"""The classes that this process has registered, by name."""


@cache
def terrain_names() -> tuple[str, ...]:
    """Return the names of the built-in terrains in alphabetical order, without importing them."""
    return tuple(sorted(module.name for module in pkgutil.iter_modules(terrains.__path__)))


def plugin_terrains() -> dict[str, "EntryPoint"]:
    """Return the entry points of terrains from other installed packages, by name."""
    from importlib.metadata import entry_points

    return {point.name: point for point in entry_points(group=ENTRY_POINTS)}


def registered_terrains() -> tuple[str, ...]:
    """Return the names of the terrains that this process has registered."""
    return tuple(_registered)


def register_terrain(terrain: _T) -> _T:
    """Register a terrain class, so that its name can be used in TOML and in maps.

    The name is that of the class in snake_case, `my_terrain` for `MyTerrain`. A class that is
    defined again, as in a notebook, replaces the previous one. Use it as a decorator above
    `@dataclass`, or as a function.

    Args:
        terrain: The class; a class that exists under this name already is not registered again.

    Returns:
        `terrain`.

    Raises:
        ConfigError: if it is not a terrain, or another terrain has the name.
    """
    if not (isinstance(terrain, type) and issubclass(terrain, Terrain)):
        raise ConfigError(f"terrain: got {terrain!r}; expected a subclass of Terrain")
    name = terrain.kind()
    if inspect.isabstract(terrain):
        missing = ", ".join(sorted(terrain.__abstractmethods__))
        raise ConfigError(f"{terrain.__name__}: got no method {missing}; expected one")
    if "__dataclass_fields__" not in vars(terrain):
        raise ConfigError(f"{terrain.__name__} lacks @dataclass(frozen=True, kw_only=True)")
    parameters_of(terrain)
    existing = _registered.get(name)
    if existing is None and (name in terrain_names() or name in plugin_terrains()):
        existing = get_terrain(name)
    if existing is None or _path(existing) == _path(terrain):
        if existing is not terrain:
            _registered[name] = terrain
            get_terrain.cache_clear()
    elif existing is not terrain:
        raise ConfigError(
            f"the name {name!r} of {_path(terrain)} is that of {_path(existing)}; expected another "
            "class name"
        )
    return terrain


def _path(terrain: type[Terrain]) -> str:
    return f"{terrain.__module__}.{terrain.__qualname__}"


@cache
def get_terrain(name: str) -> type[Terrain]:
    """Return the terrain class `name`: a built-in or registered one, or that of a plugin.

    Raises:
        ConfigError: if there is no such terrain, or a plugin cannot be loaded.
    """
    if name in terrain_names():
        return _load_class(terrains, name, Terrain)  # type: ignore[no-any-return]
    if name in _registered:
        return _registered[name]
    plugins = plugin_terrains()
    if name not in plugins:
        base = name.removesuffix(INVERTED)
        if base in terrain_names() and "inverted" in parameters_of(get_terrain(base)):
            raise ConfigError(f"no terrain {name!r}; use {base} with inverted = true")
        expected = expected_names(name, [*terrain_names(), *plugins, *_registered])
        raise ConfigError(
            f"no terrain {name!r} is built in, installed, or registered with "
            f"terrainkit.register_terrain; {expected}"
        )
    try:
        terrain = plugins[name].load()
    except (ImportError, AttributeError) as error:
        raise ConfigError(f"{name} ({plugins[name].value}) cannot be loaded: {error}") from error
    if not (isinstance(terrain, type) and issubclass(terrain, Terrain)):
        raise ConfigError(
            f"{name} ({plugins[name].value}): got {terrain!r}; expected a subclass of Terrain"
        )
    return terrain


@cache
def overlay_names() -> tuple[str, ...]:
    """Return the names of the overlays in alphabetical order, without importing them."""
    return tuple(sorted(module.name for module in pkgutil.iter_modules(overlays.__path__)))


@cache
def get_overlay(name: str) -> type[Overlay]:
    """Return the overlay class `name`.

    Raises:
        ConfigError: if there is no such overlay.
    """
    if name not in overlay_names():
        raise ConfigError(f"no overlay {name!r}; {expected_names(name, overlay_names())}")
    return _load_class(overlays, name, Overlay)  # type: ignore[no-any-return]


def make_overlay(name: str, parameters: Mapping[str, Any]) -> Overlay:
    """Return the overlay `name` with these parameters: values, or ranges (easy, hard).

    Raises:
        ConfigError: if there is no such overlay, or a parameter is unknown or invalid.
    """
    overlay = get_overlay(name)
    check_names(name, parameters, parameters_of(overlay))
    return overlay(**parameters)


def _load_class(package: ModuleType, name: str, parent: type[Any]) -> Any:
    """Return the subclass of `parent` in module `name` of a package."""
    module = importlib.import_module(f"{package.__name__}.{name}")
    found: list[Any] = [value for value in vars(module).values() if inspect.isclass(value)]
    classes = [each for each in found if issubclass(each, parent) and each.kind() == name]
    if len(classes) != 1:
        raise ConfigError(
            f"{module.__file__}: got {len(classes)} subclasses of {parent.__name__} named like the "
            "file; expected one"
        )
    return classes[0]

"""The registry of terrains and overlays.

Each module in `terrainkit/terrains` is one terrain, named after its file, and each module in
`terrainkit/overlays` one overlay. Other packages add their own as entry points of the groups
`terrainkit.terrains` and `terrainkit.overlays`, and a program or notebook registers its classes.
"""

import importlib
import inspect
import pkgutil
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, TypeVar

from terrainkit.errors import ConfigError, TerrainkitError, is_built_in, plugin_errors
from terrainkit.settings.text import closest_names
from terrainkit.terrain import Terrain
from terrainkit.terrain.overlay import Overlay
from terrainkit.terrain.parameter import check_names, parameters_of

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

INVERTED = "_inverted"
"""Suffix of the name of an inverted terrain in presets and maps."""

_Terrain = TypeVar("_Terrain", bound=type[Terrain])
_Overlay = TypeVar("_Overlay", bound=type[Overlay])


@dataclass(frozen=True, kw_only=True, eq=False)
class Group:
    """The classes of one parent."""

    label: str
    """What a class is called in errors: terrain or overlay."""

    parent: Any
    """Their parent class."""

    package: str
    """Name of the package of the built-in classes, and of the group of entry points of other
    packages."""


TERRAINS = Group(label="terrain", parent=Terrain, package="terrainkit.terrains")
OVERLAYS = Group(label="overlay", parent=Overlay, package="terrainkit.overlays")

_registered: dict[tuple[str, str], type[Any]] = {}
"""The classes that this process has registered, by label and name."""


def terrain_names() -> tuple[str, ...]:
    """Return the names of the built-in terrains in alphabetical order, without importing them."""
    return _module_names(TERRAINS)


def overlay_names() -> tuple[str, ...]:
    """Return the names of the built-in overlays in alphabetical order, without importing them."""
    return _module_names(OVERLAYS)


@cache
def _module_names(group: Group) -> tuple[str, ...]:
    package = importlib.import_module(group.package)
    return tuple(sorted(module.name for module in pkgutil.iter_modules(package.__path__)))


def plugins(group: Group) -> dict[str, "EntryPoint"]:
    """Return the entry points of other installed packages, by name."""
    from importlib.metadata import entry_points

    return {point.name: point for point in entry_points(group=group.package)}


def registered_names(group: Group) -> tuple[str, ...]:
    """Return the names of the classes that this process has registered."""
    return tuple(name for label, name in _registered if label == group.label)


def register_terrain(terrain: _Terrain) -> _Terrain:
    """Register a terrain class, so that its name can be used in TOML and in maps.

    The name is the class name in snake_case, `my_terrain` for `MyTerrain`. A class that is defined
    again, as in a notebook, replaces the previous one. Use it as a decorator above `@dataclass`, or
    as a function.

    Args:
        terrain: The class. Nothing changes if it is built in or belongs to an installed package.

    Returns:
        `terrain`.

    Raises:
        ConfigError: if it is not a terrain, or another terrain has the name.
    """
    _register(TERRAINS, terrain)
    return terrain


def register_overlay(overlay: _Overlay) -> _Overlay:
    """Register an overlay class, as `register_terrain` does a terrain.

    Raises:
        ConfigError: if it is not an overlay, or another overlay has the name.
    """
    _register(OVERLAYS, overlay)
    return overlay


def _register(group: Group, item: Any) -> None:
    name = _checked_name(group, item)
    existing: Any = _registered.get((group.label, name))
    if existing is None and (name in _module_names(group) or name in plugins(group)):
        existing = _get(group, name)
    if existing is None or _path(existing) == _path(item):
        if existing is not item:
            _registered[group.label, name] = item
            _get.cache_clear()
    elif existing is not item:
        raise ConfigError(
            f"the name {name!r} of {_path(item)} is taken by {_path(existing)}; expected another "
            "class name"
        )


def _checked_name(group: Group, item: Any) -> str:
    """Return the name of a class, after checking how it is declared."""
    is_subclass = isinstance(item, type) and issubclass(item, group.parent)
    if not is_subclass:
        raise ConfigError(
            f"{group.label}: got {item!r}; expected a subclass of {group.parent.__name__}"
        )
    if inspect.isabstract(item):
        missing = ", ".join(sorted(item.__abstractmethods__))
        raise ConfigError(f"{item.__name__}: got no method {missing}; expected one")
    if "__dataclass_fields__" not in vars(item):
        raise ConfigError(f"{item.__name__} lacks @dataclass(frozen=True, kw_only=True)")
    parameters_of(item)
    return item.kind()  # type: ignore[no-any-return]


def plugin_name(item: type[Any]) -> str | None:
    """Return the name of a terrain or overlay class in errors; None if it is built in."""
    if is_built_in(item):
        return None
    label = (OVERLAYS if issubclass(item, Overlay) else TERRAINS).label
    return f"{label} {item.kind()} ({item.__module__}:{item.__qualname__})"


def _path(item: type[Any]) -> str:
    return f"{item.__module__}.{item.__qualname__}"


def get_terrain(name: str) -> type[Terrain]:
    """Return the terrain class `name`, which is built in, registered, or from a plugin.

    Raises:
        ConfigError: if there is no such terrain, or a plugin cannot be loaded.
    """
    return _get(TERRAINS, name)  # type: ignore[no-any-return]


def get_overlay(name: str) -> type[Overlay]:
    """Return the overlay class `name`, which is built in, registered, or from a plugin.

    Raises:
        ConfigError: if there is no such overlay, or a plugin cannot be loaded.
    """
    return _get(OVERLAYS, name)  # type: ignore[no-any-return]


@cache
def _get(group: Group, name: str) -> Any:
    if name in _module_names(group):
        return _load_class(group, name)
    if (group.label, name) in _registered:
        return _registered[group.label, name]
    points = plugins(group)
    if name not in points:
        raise _unknown_name(group, name)
    with plugin_errors(f"{group.label} {name} ({points[name].value}) cannot be loaded"):
        found = points[name].load()
        _checked_name(group, found)
    return found


def _unknown_name(group: Group, name: str) -> ConfigError:
    base = name.removesuffix(INVERTED)
    if (
        base != name
        and base in _module_names(group)
        and "inverted" in parameters_of(_get(group, base))
    ):
        return ConfigError(f"no {group.label} {name!r}; use {base} with inverted = true")
    near = closest_names(name, [*_module_names(group), *plugins(group), *registered_names(group)])
    hint = f"did you mean {' or '.join(map(repr, near))}? " if near else ""
    return ConfigError(
        f"no {group.label} {name!r} is built in, installed, or registered with --plugin FILE.py or "
        f"terrainkit.register_{group.label}; {hint}terrainkit list prints all"
    )


def make_overlay(name: str, parameters: Mapping[str, Any]) -> Overlay:
    """Return an overlay with some parameters.

    Args:
        name: Name of the overlay.
        parameters: Values or ranges (easy, hard) by name; the others have their defaults.

    Raises:
        ConfigError: if there is no such overlay, or a parameter is unknown or invalid.
    """
    overlay = get_overlay(name)
    check_names(name, parameters, parameters_of(overlay))
    with plugin_errors(plugin_name(overlay), TerrainkitError):
        return overlay(**parameters)


def _load_class(group: Group, name: str) -> type[Any]:
    """Return the class in module `name` of the package of a group."""
    module = importlib.import_module(f"{group.package}.{name}")
    found: list[Any] = [value for value in vars(module).values() if inspect.isclass(value)]
    classes = [item for item in found if issubclass(item, group.parent) and item.kind() == name]
    if len(classes) != 1:
        raise ConfigError(
            f"{module.__file__}: got {len(classes)} subclasses of {group.parent.__name__} named "
            "like the file; expected one"
        )
    return classes[0]  # type: ignore[no-any-return]

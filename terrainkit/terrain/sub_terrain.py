"""SubTerrain: an entry of a map's configuration."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Any, Self

from msgspec import Meta

from terrainkit.errors import (
    ConfigError,
    PluginError,
    TerrainkitError,
    plugin_errors,
    prefixed_errors,
)
from terrainkit.settings.schema import Config, field_keys
from terrainkit.settings.text import closest, truncate
from terrainkit.settings.type_hint import MAX_VALUE, convert, show
from terrainkit.terrain import Terrain, registry
from terrainkit.terrain.overlay import Overlay
from terrainkit.terrain.parameter import Parameter, convert_range, parameters_of


@dataclass(frozen=True, kw_only=True)
class SubTerrain(Config):
    """A terrain type of a map.

    It is an entry of the map's configuration: a terrain with its parameters. In Python, `terrain`
    may be a subclass of `Terrain`, which is registered and replaced by
    its name. The classes of `overlays` are registered, too.

    Raises:
        ConfigError: if there is no such terrain, or a parameter is unknown or invalid.
    """

    terrain: Annotated[Any, Meta(description="a string")]
    """Name of the terrain; `terrainkit list` prints all of them."""

    proportion: Annotated[float, Meta(ge=0, le=MAX_VALUE)] = 1.0
    """Share of the columns, relative to the sum of all proportions."""

    name: str = ""
    """Name in the map; defaults to the name of the terrain."""

    overlays: tuple[Overlay, ...] = ()
    """Changes to the patches, in their order. In TOML, each is a `[[terrains.overlays]]` table."""

    friction: Annotated[Any, Meta(description="a number >= 0, or a pair (easy, hard)")] | None = (
        None
    )
    """Friction coefficient of the patches; none for `static_friction` of the map."""

    parameters: Mapping[str, Annotated[Any, Meta(description="a finite value or a range")]] = field(
        default_factory=dict
    )
    """Parameters that replace the defaults: a value, or a range (easy, hard). In TOML they are keys
    of the table itself."""

    def __post_init__(self) -> None:
        if isinstance(self.terrain, type):
            terrain: type[Terrain] = registry.register_terrain(self.terrain)
            object.__setattr__(self, "terrain", terrain.kind())
        convert("terrain", self.terrain, str)
        try:
            super().__post_init__()
        except ConfigError as error:
            message = str(error).removeprefix("parameters.")  # they are keys of the table itself
            raise ConfigError(f"{self.terrain}.{message}") from None
        for overlay in self.overlays:
            registry.register_overlay(type(overlay))
        if self.friction is not None:
            friction = convert_range(self.terrain, "friction", self.friction, _FRICTION)
            object.__setattr__(self, "friction", friction)
        cls: Any = type(self)  # mypy does not take it as hashable
        if reserved := field_keys(cls).keys() & parameters_of(self.terrain_class).keys():
            raise ConfigError(
                f"{self.terrain}: got parameters with the names {', '.join(sorted(reserved))}; "
                "expected others, since they are keys of [[terrains]]"
            )
        for name, declared in parameters_of(self.terrain_class).items():
            if declared.table and name in self.parameters:
                tables = convert_range(self.terrain, name, self.parameters[name], declared)
                object.__setattr__(self, "parameters", {**self.parameters, name: tables})
        if not self.name:
            object.__setattr__(self, "name", self.terrain)
        for difficulty in (0.0, 1.0):  # the constructor validates both ends of the ranges
            self.at(difficulty)

    @classmethod
    def from_table(
        cls, table: Mapping[str, Any], default: Self | None = None, path: str = ""
    ) -> Self:
        """Return the sub-terrain of a `[[terrains]]` table; its other keys are parameters."""
        kind: Any = cls
        keys = field_keys(kind).keys() - {"parameters"}
        own = {key: table[key] for key in table if key in keys}
        parameters = {key: value for key, value in table.items() if key not in own}
        with prefixed_errors(f"{path.removesuffix('.')}: "):
            if "terrain" not in own and (near := closest("terrain", parameters)):
                raise ConfigError(f"got the key {near!r}; did you mean 'terrain'?")
            if isinstance(parameters.get("elements"), Mapping):
                raise ConfigError("elements: got a table; expected [[terrains.elements]]")
            if "overlays" in own:
                own["overlays"] = _read_overlays(own["overlays"])
            return super().from_table({**own, "parameters": parameters}, default)

    @classmethod
    def from_map(cls, table: Mapping[str, Any], path: str) -> "SubTerrain":
        """Return the sub-terrain in a map file; without its class, an `UnavailableSubTerrain`.

        Args:
            table: Values by key.
            path: Prefix of the keys in error messages.

        Raises:
            ConfigError: if a value is invalid that does not depend on a class of the user.
        """
        try:
            return cls.from_table(table, path=path)
        except PluginError:  # a class that fails is not a class that is missing
            raise
        except ConfigError as error:
            if {*registry.terrain_names(), *registry.overlay_names()}.issuperset(_names(table)):
                raise
            own = {key: table[key] for key in ("proportion", "name") if key in table}
            return UnavailableSubTerrain(
                terrain=table.get("terrain"),
                **own,
                parameters={k: v for k, v in table.items() if k not in {"terrain", *own}},
                problem=truncate(str(error).removeprefix(f"{path}: "), MAX_PROBLEM),
            )

    def to_table(self) -> dict[str, Any]:
        """Return the keys of a `[[terrains]]` table."""
        optional = {
            "name": self.name if self.name != self.terrain else "",
            "friction": self.friction,
            "overlays": self.overlays,
        }
        raw = {key: value for key, value in optional.items() if value not in ("", None, ())}
        return {"terrain": self.terrain, "proportion": self.proportion, **raw, **self.parameters}

    @cached_property
    def terrain_class(self) -> type[Terrain]:
        """The class of the terrain. It is looked up once, and pickled with the instance."""
        return registry.get_terrain(self.terrain)

    @property
    def plugin(self) -> str | None:
        """Name of the terrain in errors; None if it is built in."""
        return registry.plugin_name(self.terrain_class)

    def at(self, difficulty: float) -> Terrain:
        """Return the terrain at `difficulty`, 0 to 1."""
        with plugin_errors(self.plugin, TerrainkitError):
            return self.terrain_class.at(difficulty, self.parameters)

    def friction_at(self, difficulty: float) -> float | None:
        """Return the friction of the patches at `difficulty`, 0 to 1; None for the map's."""
        if self.friction is None:
            return None
        friction: float = _FRICTION.value_at(self.friction, difficulty)  # type: ignore[assignment]
        return friction

    @cached_property
    def declarations(self) -> dict[str, Parameter]:
        """The parameters of the terrain by name, and the parameters of its overlays by path."""
        with plugin_errors(self.plugin):
            declared = dict(self.at(1.0).declarations())
        for k, overlay in enumerate(self.overlays):
            for name, parameter in parameters_of(type(overlay)).items():
                declared[overlay_path(k, name)] = parameter
        return declared


@dataclass(frozen=True, kw_only=True)
class UnavailableSubTerrain(SubTerrain):
    """A sub-terrain of a map file whose class, or the class of a part of it, is not available.

    Its patches are in the file. Whatever needs the class raises `ConfigError`. `parameters`
    has all other keys of its table, such as `overlays`.
    """

    problem: str
    """Why the class is not available, and how to add it."""

    def __post_init__(self) -> None:
        Config.__post_init__(self)
        object.__setattr__(self, "name", self.name or convert("terrain", self.terrain, str))

    @cached_property
    def terrain_class(self) -> type[Terrain]:
        """Raise ConfigError."""
        raise ConfigError(self.problem)


_FRICTION = Parameter(easy=1.0, hard=1.0)

MAX_PROBLEM = 300
"""Longest text about an unavailable class [characters]."""


def overlay_path(number: int, name: str) -> str:
    """Return the name of a parameter of overlay `number` in the parameters of a patch."""
    return f"overlays[{number}].{name}"


def _names(value: Any) -> Iterator[str]:
    """Yield the names of the classes in a `[[terrains]]` table."""
    for key, entry in value.items() if isinstance(value, Mapping) else enumerate(value):
        if key in ("terrain", "overlay") and isinstance(entry, str):
            yield entry
        elif isinstance(entry, Mapping | list):
            yield from _names(entry)


def _read_overlays(tables: Any) -> tuple[Overlay, ...]:
    """Return the overlays that `[[terrains.overlays]]` tables describe."""
    if not isinstance(tables, list) or not all(isinstance(table, Mapping) for table in tables):
        raise ConfigError(f"overlays: got {show(tables)}; expected [[terrains.overlays]] tables")
    overlays = []
    for k, table in enumerate(tables):
        parameters = dict(table)
        with prefixed_errors(f"overlays[{k}]: "):
            name = convert("overlay", parameters.pop("overlay", None), str)
            overlays.append(registry.make_overlay(name, parameters))
    return tuple(overlays)

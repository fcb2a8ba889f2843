"""SubTerrain: a terrain type of a map, with its proportion and parameters."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Any, Self

from msgspec import Meta

from terrainkit import registry
from terrainkit.errors import ConfigError
from terrainkit.parameter import MAX_VALUE
from terrainkit.schema import Config
from terrainkit.terrain import Terrain
from terrainkit.type_hint import convert


@dataclass(frozen=True, kw_only=True)
class SubTerrain(Config):
    """A terrain type of a map.

    Raises:
        ConfigError: if there is no such terrain, or a parameter is unknown or invalid.
    """

    terrain: Annotated[Any, Meta(description="a string")]
    """Name of the terrain; `terrainkit list` prints all of them. In Python, it may be a subclass of
    :class:`~terrainkit.terrain.Terrain`, which is registered and replaced by its name."""

    proportion: Annotated[float, Meta(ge=0, le=MAX_VALUE)] = 1.0
    """Share of the columns, relative to the sum of all proportions."""

    name: str = ""
    """Name in the map; defaults to the name of the terrain."""

    parameters: Mapping[str, Annotated[Any, Meta(description="a value or a range")]] = field(
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
            raise ConfigError(f"{self.terrain}.{error}") from None
        if not self.name:
            object.__setattr__(self, "name", self.terrain)
        for difficulty in (0.0, 1.0):
            self.at(difficulty)

    @classmethod
    def from_table(
        cls, table: Mapping[str, Any], default: Self | None = None, path: str = ""
    ) -> Self:
        """Return the sub-terrain of a `[[terrains]]` table; its other keys are parameters."""
        own = {key: table[key] for key in ("terrain", "proportion", "name") if key in table}
        parameters = {key: value for key, value in table.items() if key not in own}
        try:
            return super().from_table({**own, "parameters": parameters}, default)
        except ConfigError as error:
            raise ConfigError(f"{path.removesuffix('.')}: {error}") from error

    def to_table(self) -> dict[str, Any]:
        """Return the keys of a `[[terrains]]` table."""
        name = {"name": self.name} if self.name != self.terrain else {}
        return {"terrain": self.terrain, "proportion": self.proportion, **name, **self.parameters}

    @cached_property
    def terrain_class(self) -> type[Terrain]:
        """The class of the terrain. It is looked up once, and pickled with the instance."""
        return registry.get_terrain(self.terrain)

    def at(self, difficulty: float) -> Terrain:
        """Return the terrain at `difficulty`, 0 to 1."""
        return self.terrain_class.at(difficulty, self.parameters)

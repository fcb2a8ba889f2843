"""One terrain of a mix: which, how much of it, and with what parameters."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from terrainkit import registry
from terrainkit.coerce import coerce
from terrainkit.errors import ConfigError
from terrainkit.parameter import MAX_VALUE, Range, Value
from terrainkit.terrain import Terrain


@dataclass(frozen=True, kw_only=True)
class TerrainChoice:
    """A terrain as a mix holds it.

    Raises:
        ConfigError: if there is no such terrain, or it has no such parameter or value.
    """

    terrain: str
    """Which terrain: one of those that `terrainkit list` prints."""

    proportion: float = 1.0
    """Its share of the columns, relative to the sum over the mix."""

    name: str = ""
    """What to call it in the map; the terrain's own name unless given."""

    parameters: Mapping[str, Value | Range] = field(default_factory=dict)
    """Parameters to use instead of the defaults: a value, or a range (easy, hard)."""

    def __post_init__(self) -> None:
        for name, kind in (("terrain", str), ("proportion", float), ("name", str)):
            object.__setattr__(self, name, coerce(name, getattr(self, name), kind))
        if not self.name:
            object.__setattr__(self, "name", self.terrain)
        if not 0 <= self.proportion <= MAX_VALUE:
            raise ConfigError(
                f"{self.name}: proportion is {self.proportion:g}; wanted 0 to {MAX_VALUE:g}"
            )
        if not isinstance(self.parameters, Mapping):
            raise ConfigError(f"{self.name}: parameters is {self.parameters!r}; wanted a mapping")
        # A copy of its own: the caller's dict may change later, a config never does.
        own = {name: _plain(value) for name, value in self.parameters.items()}
        object.__setattr__(self, "parameters", own)
        for end in (0.0, 1.0):
            self.at(end)

    def at(self, difficulty: float) -> Terrain:
        """Return the terrain at `difficulty`, 0 to 1."""
        return registry.get_terrain(self.terrain).at(difficulty, self.parameters)


def _plain(value: Any) -> Any:
    """Return `value` with lists as tuples, and numpy's numbers as Python's."""
    if isinstance(value, list | tuple):
        return tuple(_plain(item) for item in value)
    return value.item() if isinstance(value, np.generic) else value

"""MapConfig as TOML, and back."""

import dataclasses
import os
import stat
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from terrainkit.choice import TerrainChoice
from terrainkit.config import MapConfig
from terrainkit.errors import ConfigError, listing
from terrainkit.toml_text import parsed

if TYPE_CHECKING:
    from pathlib import Path

_NO_WALLS = "none"
"""How TOML, which has no null, writes a slope_threshold of None."""


def to_toml(config: MapConfig) -> str:
    """Return `config` as TOML; :func:`from_toml` makes an equal one of it."""
    import tomli_w

    table: dict[str, Any] = {}
    for field in dataclasses.fields(config):
        value = getattr(config, field.name)
        if field.name != "terrains":
            table[field.name] = _NO_WALLS if value is None else value
    if config.terrains:
        del table["preset"]
        table["terrains"] = [_choice_table(choice) for choice in config.terrains]
    return tomli_w.dumps(table)


def from_toml(text: str) -> MapConfig:
    """Return the config that `text` describes; what it leaves out has its default.

    Raises:
        ConfigError: if it is not TOML, or names a key or holds a value that is not known.
    """
    table = parsed(text)
    known = [field.name for field in dataclasses.fields(MapConfig)]
    _refuse_unknown("config", table, known)
    if table.get("slope_threshold") == _NO_WALLS:
        table["slope_threshold"] = None
    if "terrains" in table:
        if "preset" in table:
            raise ConfigError("config has both preset and terrains; wanted one of them")
        table["terrains"] = _choices(table["terrains"])
    return MapConfig(**table)


def read_config(path: "str | Path") -> MapConfig:
    """Return the config in the TOML file `path`.

    Raises:
        ConfigError: if it cannot be read, is over a megabyte, or as :func:`from_toml`.
    """
    try:
        if not stat.S_ISREG(os.stat(path).st_mode):  # noqa: PTH116 (pathlib is slow to import)
            raise ConfigError(f"cannot read {path}: not a plain file; wanted a TOML file of a map")
        with open(path, "rb") as file:  # noqa: PTH123
            data = file.read(_LARGEST + 1)
    except OSError as error:
        raise ConfigError(f"cannot read {path}: {error.strerror or error}") from error
    if len(data) > _LARGEST:
        raise ConfigError(f"{path}: over {_LARGEST} bytes; wanted a TOML file of a map")
    try:
        return from_toml(data.decode())
    except (ConfigError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: {error}") from error


_LARGEST = 1 << 20


def _choice_table(choice: TerrainChoice) -> dict[str, Any]:
    table: dict[str, Any] = {"terrain": choice.terrain, "proportion": choice.proportion}
    if choice.name != choice.terrain:
        table["name"] = choice.name
    return table | dict(choice.parameters)


def _choices(tables: object) -> tuple[TerrainChoice, ...]:
    if not isinstance(tables, list) or not tables:
        raise ConfigError(f"terrains is {tables!r}; wanted one or more [[terrains]] tables")
    return tuple(_choice(table) for table in tables)


def _choice(table: object) -> TerrainChoice:
    if not isinstance(table, Mapping) or "terrain" not in table:
        raise ConfigError(f"{table!r} in terrains; wanted a table with a key 'terrain'")
    own = {name: table[name] for name in ("terrain", "proportion", "name") if name in table}
    parameters = {name: value for name, value in table.items() if name not in own}
    return TerrainChoice(**own, parameters=parameters)


def _refuse_unknown(what: str, table: Mapping[str, Any], known: list[str]) -> None:
    for name in table:
        if name not in known:
            raise ConfigError(f"{what} has no key {name!r}; it has: {listing(known)}")

"""Names of the settings of legged_gym and LeggedGym-Ex: what they are here, and their values.

The table is `legged_gym_names.toml`. It is what the page of names, the errors about settings that
are pasted into a task file, and `import_config` consist of.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from terrainkit.errors import ConfigError
from terrainkit.settings.schema import Config, nested_table
from terrainkit.settings.toml_text import parse_toml, value_text
from terrainkit.settings.type_hint import NONE, show

Values = Mapping[str, Any]
"""The settings of a class by name. A conversion may also need `joints`, their names, and `--robot`:
a table with `bodies`, `limits` of joints and `leg_length` [m]."""


@cache
def _table() -> dict[str, Any]:
    return parse_toml(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))


CONVERSIONS: dict[str, Callable[[Any, Values], Any]] = {
    "same": lambda value, _: value,
    "not": lambda value, _: not value,
    "third": lambda value, _: value[2],
    "center of mass": lambda value, own: (
        value if own.get("domain_rand.randomize_com_displacement", True) else NONE
    ),
    "tilt": lambda value, _: math.acos(-value),
    "patch size": lambda _, own: [own[f"terrain.terrain_{side}"] for side in ("length", "width")],
    "seconds": lambda value, own: [n * own["sim.dt"] * own["control.decimation"] for n in value],
    "times joints": lambda value, own: value * len(own["joints"]),
    "leg lengths": lambda value, own: value / own["--robot"]["leg_length"],
    "pose": lambda value, own: {name: value[name] for name in own["joints"] if name in value},
    # The last part of a name holds, as in legged_gym.
    "joints": lambda value, own: {
        joint: value[part] for joint in own["joints"] for part in value if part in joint
    },
    "bodies": lambda value, own: [
        body
        for part in ([value] if isinstance(value, str) else value)
        for body in own["--robot"]["bodies"]
        if part in body
    ],
    "soft limits": lambda value, own: {
        joint: [(low + high - sign * value * (high - low)) / 2 for sign in (1, -1)]
        for joint, (low, high) in own["--robot"]["limits"].items()
    },
    "terrains": lambda value, _: [
        [name, share * part]
        for names, share in zip(_table()["terrains"], value, strict=False)
        for name, part in names.items()
    ],
}
"""Function from a value and all settings to our value, by the name of the conversion."""


@dataclass(frozen=True, kw_only=True)
class Name(Config):
    """What a setting of legged_gym or LeggedGym-Ex is here."""

    here: str = ""
    """Our setting: `robot.` is robot.toml, `map.` a map's config; empty for the same name."""
    how: str = "same"
    """Name of the conversion of the value."""
    values: Mapping[str, str] = field(default_factory=dict)
    """Our value for each of theirs."""
    off: Any = None
    """Value of our setting for a flag that is false; a flag that is true sets nothing."""
    no: str = ""
    """Why there is no such setting."""
    fixed: Any = None
    """Value with which that makes no difference."""
    about: str = ""
    """How our setting differs."""


@cache
def names() -> dict[str, Name]:
    """Return what each setting of legged_gym and LeggedGym-Ex is here, by its name there."""
    return {key: Name.from_table({"here": key, **row}) for key, row in _table()["names"].items()}


def base_settings() -> Any:
    """Return the table of a task that does what legged_gym's code does without a setting."""
    return _table()["base"]


def find_name(key: str) -> Name | None:
    """Return the row of a setting; a row holds for all names below its own."""
    return names().get(key) or (find_name(key.rpartition(".")[0]) if "." in key else None)


def convert_value(row: Name, value: Any, settings: Values) -> Any:
    """Return the value of our setting.

    Raises:
        ConfigError: if it needs what `settings` lacks, or the value has another type.
    """
    if row.values and str(value).lower() not in row.values:
        raise ConfigError(f"got {show(value)}; expected one of: {', '.join(row.values)}")
    if row.values:
        return row.values[str(value).lower()]
    try:
        converted = CONVERSIONS[row.how](value, settings)
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        key = str(error.args[0]) if isinstance(error, KeyError) else ""
        if "." in key or key in ("joints", "--robot"):
            needed = "--robot" if key == "joints" else key
            raise ConfigError(f"got {show(value)}; needs {needed}") from None
        raise ConfigError(f"got {show(value)}; expected a value as in legged_gym") from None
    if value and converted in ({}, []):
        raise ConfigError(f"got {show(value)}; the robot has none of these names")
    return converted


def pasted_settings(table: Mapping[str, Any]) -> Iterator[tuple[dict[str, Any], str]]:
    """Yield each setting of a task file that has another meaning or no place here.

    Args:
        table: Content of the file.

    Yields:
        A table with the setting alone, and the error about it.
    """
    for key, value in _settings(table):
        row = find_name(key)
        if row and row != Name(here=key, about=row.about):
            message = f"{key}: got {show(value)} of legged_gym; {_expected(row, value)}"
            yield nested_table({key: value}), message


def _settings(table: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        row = names().get(path + key)
        if isinstance(value, Mapping) and (row is None or row.no):
            yield from _settings(value, f"{path}{key}.")
        else:
            yield path + key, value


def place_of(row: Name, value: Any = None) -> str:
    """Return our setting, its value and its file in words; of a task, only the setting."""
    file, _, name = row.here.partition(".")
    where = {"robot": " in robot.toml", "map": " in the config of a map"}.get(file)
    text = "" if value is None else f" = {value_text(value, 1000)}"
    return f"{name}{text}{where}" if where else f"{row.here}{text}"


def _expected(row: Name, value: Any) -> str:
    if row.no:
        return f"there is no such setting here: {row.no}"
    about = row.about
    try:
        ours = convert_value(row, value, {}) if row.off is None else row.off
    except ConfigError:
        ours = None
    if row.off is not None and value:
        about, ours = f"{value_text(row.off)} is off", None
    return f"expected {place_of(row, ours)}{about and f' ({about})'}"

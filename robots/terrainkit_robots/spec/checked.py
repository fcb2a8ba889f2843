"""Checks of a spec's values: of the right kind, finite, in range. Errors name the key."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, get_args, get_origin

from terrainkit.coerce import coerce
from terrainkit.errors import ConfigError
from terrainkit_robots.spec.toml_text import key_text

if TYPE_CHECKING:
    from dataclasses import Field


def checked(field: "Field[Any]", value: object) -> Any:
    """Return a value as the type of its field has it: 8 becomes 8.0, a list a tuple.

    Args:
        field: The field; `unit` and `least` in its metadata say what numbers are right.
        value: What it is given.

    Raises:
        ConfigError: if the value is of another kind, not finite, or out of range.
    """
    if get_origin(field.type) is not Mapping:
        return _one(field, field.name, value, field.type)
    if not isinstance(value, Mapping):
        raise ConfigError(f"{field.name} is {value!r}; wanted a table")
    kind = get_args(field.type)[1]
    table = {}
    for key, item in value.items():
        _check_name(f"a key of {field.name}", key)
        table[key] = _one(field, f"{field.name}.{key_text(key)}", item, kind)
    return table


def _one(field: "Field[Any]", name: str, value: object, kind: Any) -> Any:
    if isinstance(value, Mapping):
        parts = ", a name with a dot goes in quotes" if "." in name else ""
        raise ConfigError(f"{name} is a table; wanted {_wanted(field, kind)}{parts}")
    value = coerce(name, value, kind)
    match value:
        case float():
            _check_numbers(field, name, (value,))
        case (float(), float()):
            _check_numbers(field, name, value)
        case str():
            _check_name(name, value)
        case tuple():
            _check_names(name, value)
    return value


def _check_numbers(field: "Field[Any]", name: str, numbers: Sequence[float]) -> None:
    least, above = field.metadata.get("least"), field.metadata.get("above", False)
    for number in numbers:
        low = least is not None and (number < least or (above and number == least))
        if low or not math.isfinite(number):
            raise ConfigError(f"{name} is {number:g}; wanted {_wanted(field, float)}")
    if list(numbers) != sorted(numbers):
        raise ConfigError(f"{name} is {list(numbers)}; wanted the lower number first")


def _wanted(field: "Field[Any]", kind: Any) -> str:
    least, unit = field.metadata.get("least"), field.metadata.get("unit", "")
    if not unit:
        return "a text" if kind is str else "a list of texts"
    what = "a finite number" if least is None else f"{least:g} or more"
    if field.metadata.get("above"):
        what = f"more than {least:g}"
    pair = get_origin(kind) is tuple
    return ("two numbers, each " if pair else "") + what + ("" if unit == "1" else f" {unit}")


def _check_names(name: str, names: tuple[str, ...]) -> None:
    seen = set()
    for each in names:
        _check_name(name, each)
        if each in seen:
            raise ConfigError(f"{name} has {each!r} twice; wanted each name once")
        seen.add(each)


def _check_name(what: str, name: object) -> None:
    """Refuse what no file can hold as a name."""
    if not isinstance(name, str) or not name:
        raise ConfigError(f"{what} is {name!r}; wanted a name")
    if "\0" in name or any(0xD800 <= ord(letter) <= 0xDFFF for letter in name):
        raise ConfigError(f"{what} is {name!r}; wanted text without NUL and lone surrogates")

"""Type hints that state the type and range of a value: conversion, and description in words."""

import dataclasses
import math
import types
import typing
from collections.abc import Mapping
from typing import Annotated, Any, Literal, NamedTuple, get_args, get_origin

import msgspec
import numpy as np
from msgspec import Meta

from terrainkit.errors import ConfigError
from terrainkit.settings.text import closest, truncate
from terrainkit.settings.toml_text import key_text

NONE = "none"
"""How TOML and the command line, which have no null, write None."""

SORTED = Meta(extra={"sorted": True})
"""Of two numbers, the second may not be below the first."""

UNIQUE = Meta(extra={"unique": True})
"""No item of the list may occur twice."""

MAX_VALUE = 1_000_000
"""Largest number that a setting or parameter accepts. It is beyond any terrain, and far below
overflow."""

MIN_SIZE = 1e-4
"""Smallest length that a setting accepts [m]."""

Size = Annotated[float, Meta(ge=MIN_SIZE, le=MAX_VALUE)]
NonNegative = Annotated[float, Meta(ge=0, le=MAX_VALUE)]
Count = Annotated[int, Meta(ge=1, le=MAX_VALUE)]
PositiveFloat = Annotated[float, Meta(gt=0)]
NonNegativeFloat = Annotated[float, Meta(ge=0)]
Fraction = Annotated[float, Meta(ge=0, le=1)]
PositiveInt = Annotated[int, Meta(ge=1)]
Interval = Annotated[tuple[float, float], SORTED]
NonNegativeInterval = Annotated[tuple[NonNegativeFloat, NonNegativeFloat], SORTED]

_MAX_INT = 2**63
# Larger numbers overflow single precision; robot files have the same limit. Numbers that can be 0
# can also be smaller: a computed angle of 0 has a rounding error.
_MIN_FLOAT, _MAX_FLOAT = 1e-12, 1e30
_NAMES = {int: "an integer", float: "a number", str: "a string", bool: "true or false"}
_LIMITS = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}


class TypeHint(NamedTuple):
    """The parts of a type hint."""

    kind: Any
    """The type, such as `float` or `tuple[float, float]`."""

    origin: Any
    """Its origin, such as `tuple`; None for a plain class."""

    args: tuple[Any, ...]
    """Its arguments, such as (float, float)."""

    constraints: Mapping[str, Any]
    """Constraints of `msgspec.Meta`, and what its `extra` holds: sorted, unique, unit."""

    is_optional: bool
    """Whether None is accepted."""


def parse_hint(hint: Any) -> TypeHint:
    """Return the parts of a type hint, which may be in an `Annotated` and a union with None."""
    parts = (hint,)
    is_optional = False
    if get_origin(hint) in (typing.Union, types.UnionType):
        parts = tuple(part for part in get_args(hint) if part is not types.NoneType)
        is_optional = types.NoneType in get_args(hint)
    (kind,) = parts
    constraints: dict[str, Any] = {}
    if get_origin(kind) is Annotated:
        names = (*_LIMITS, "min_length", "description")
        for meta in kind.__metadata__:
            constraints |= {n: v for n in names if (v := getattr(meta, n)) is not None}
            constraints |= meta.extra or {}
        kind = kind.__origin__
    return TypeHint(kind, get_origin(kind), get_args(kind), constraints, is_optional)


def is_table(kind: Any) -> bool:
    """Return whether a type is a dataclass, which is a table in TOML."""
    return isinstance(kind, type) and dataclasses.is_dataclass(kind)


def convert(name: str, value: object, hint: Any) -> Any:
    """Return `value` as the annotated type: 8 as 8.0 for a float, a list as a tuple.

    Nothing is guessed: a string is never a number, a boolean never an integer.

    Args:
        name: Name of the value in the error message.
        value: A value from a caller or a file; numpy's scalars become Python's.
        hint: A type, with its range as in `Annotated[float, msgspec.Meta(ge=0)]`.

    Raises:
        ConfigError: if the value has another type, is out of range or not finite.
    """
    value = _to_python(value)
    kind, origin, args, constraints, is_optional = parse_hint(hint)
    if value is None and is_optional:
        return None
    if kind is Any:
        return value
    if origin is Mapping and isinstance(value, Mapping):
        return {
            convert(f"key of {name}", k, args[0]): convert(f"{name}.{key_text(k)}", item, args[1])
            for k, item in value.items()
        }
    if origin is tuple and is_table(args[0]) and isinstance(value, tuple):
        return tuple(convert(f"{name}[{i}]", item, args[0]) for i, item in enumerate(value))
    if is_table(kind) and isinstance(value, kind):
        return value
    if not is_table(kind) and not isinstance(value, Mapping) and _is_valid(value, constraints):
        try:
            return msgspec.convert(value, hint)
        except (msgspec.ValidationError, UnicodeEncodeError):
            pass
    near = closest(str(value), map(str, args)) if origin is Literal else ""
    suggestion = f"; did you mean {near!r}?" if near else ""
    if isinstance(value, Mapping) and "." in name:
        suggestion += " (a key with a dot needs quotes)"
    if isinstance(value, Mapping) and is_table(kind):
        suggestion += f"; in Python, write {kind.__name__}(...)"
    raise ConfigError(f"{name}: got {show(value)}; expected {describe(hint)}{suggestion}")


def _to_python(value: Any) -> Any:
    """Return `value` with lists as tuples, and numpy's scalars as Python's."""
    if isinstance(value, list | tuple):
        return tuple(_to_python(item) for item in value)
    return value.item() if isinstance(value, np.generic) else value


def _is_valid(value: Any, constraints: Mapping[str, Any]) -> bool:
    """Return whether numbers are in range, and constraints hold that msgspec does not check."""
    items = value if isinstance(value, tuple) else (value,)
    numbers = [item for item in items if isinstance(item, int | float)]
    return (
        all(-_MAX_INT < item < _MAX_INT for item in numbers if isinstance(item, int))
        and all(abs(item) <= _MAX_FLOAT for item in numbers if isinstance(item, float))
        and ("gt" not in constraints or all(abs(item) >= _MIN_FLOAT for item in numbers))
        and ("sorted" not in constraints or numbers == sorted(numbers))
        and ("unique" not in constraints or len({*map(repr, items)}) == len(items))
    )


def show(value: object) -> str:
    """Return `value` as an error message quotes it."""
    if isinstance(value, float) and _MAX_FLOAT < abs(value) < math.inf:
        return f"{value!r}, which is beyond {_MAX_FLOAT:g}"
    if isinstance(value, float) and 0 < value < _MIN_FLOAT:
        return f"{value!r}, which is below {_MIN_FLOAT:g}"
    if isinstance(value, int) and abs(value) >= _MAX_INT:  # Python does not print 5000 digits
        return "an integer beyond 64 bits"
    if isinstance(value, tuple):
        return truncate(f"[{', '.join(map(show, value))}]")
    if isinstance(value, Mapping):
        return "a table"
    return type(value).__name__ if is_table(type(value)) else truncate(repr(value))


def describe(hint: Any) -> str:
    """Return in words what a type hint accepts, such as `an integer from 1 to 10`."""
    kind, origin, args, constraints, is_optional = parse_hint(hint)
    if "description" in constraints:
        text = str(constraints["description"])
    elif origin is Literal:
        text = f"one of: {', '.join(map(str, args))}"
    elif origin is tuple:
        empty = "" if "min_length" not in constraints else "non-empty "
        count = f"a {empty}list, each value" if Ellipsis in args else f"{len(args)} values, each"
        text = f"{count} {describe(args[0])}"
        text += ", the lower one first" if "sorted" in constraints else ""
        text += ", each one once" if "unique" in constraints else ""
    elif origin is Mapping:
        text = f"a table, each value {describe(args[1])}"
    elif is_table(kind):
        text = f"a table ({kind.__name__})"
    else:
        text = _NAMES.get(kind, f"a {kind.__name__.lower()}")
    limits = {name: _number(value) for name, value in constraints.items() if name in _LIMITS}
    if {"ge", "le"} <= set(limits):
        text += f" from {limits['ge']} to {limits['le']}"
    else:
        text += " and".join(f" {_LIMITS[name]} {limit}" for name, limit in limits.items())
    unit = constraints.get("unit", "1")
    return text + (f" [{unit}]" if unit != "1" else "") + (f", or {NONE}" if is_optional else "")


def _number(value: float) -> str:
    return str(value) if isinstance(value, int) else f"{value:.15g}"

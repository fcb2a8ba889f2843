"""Values from files and callers, checked against the annotation of the field they are for."""

import types
from typing import Any, Literal, Union, get_args, get_origin

import numpy as np

from terrainkit.errors import ConfigError, listing

_LARGEST = 2**63
_WORDS = {int: "a whole number", float: "a number", bool: "true or false", str: "a text"}


def coerce(name: str, value: object, annotation: Any) -> Any:
    """Return `value` as `annotation` wants it: 8 for a float becomes 8.0, a list becomes a tuple.

    Args:
        name: What to call the value in the error.
        value: A number (numpy's too), text, list or tuple, or an instance of the annotated class.
        annotation: A plain class, Literal, tuple[...] or X | None.

    Raises:
        ConfigError: if `value` is of another kind; nothing is guessed, a text is never a number.
    """
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, int) and not -_LARGEST <= value < _LARGEST:
        raise ConfigError(f"{name} is a whole number beyond 64 bits with sign")
    origin = get_origin(annotation)
    if origin is Literal:
        return _one_of(name, value, get_args(annotation))
    if origin in (Union, types.UnionType):
        (kind,) = (arg for arg in get_args(annotation) if arg is not types.NoneType)
        return None if value is None else coerce(name, value, kind)
    if origin is tuple:
        return _tuple(name, value, get_args(annotation))
    if annotation is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if isinstance(value, bool) != (annotation is bool) or not isinstance(value, annotation):
        wanted = _WORDS.get(annotation, getattr(annotation, "__name__", annotation))
        raise ConfigError(f"{name} is {value!r}; wanted {wanted}")
    return value


def _one_of(name: str, value: object, choices: tuple[Any, ...]) -> Any:
    if not isinstance(value, str) or value not in choices:
        raise ConfigError(f"{name} is {value!r}; wanted one of: {listing(map(str, choices))}")
    return value


def _tuple(name: str, value: object, kinds: tuple[Any, ...]) -> tuple[Any, ...]:
    any_length = kinds[-1] is Ellipsis
    if not isinstance(value, list | tuple):
        raise ConfigError(f"{name} is {value!r}; wanted a list")
    if any_length:
        kinds = (kinds[0],) * len(value)
    if len(value) != len(kinds):
        raise ConfigError(f"{name} has {len(value)} values; wanted {len(kinds)}")
    return tuple(coerce(name, item, kind) for item, kind in zip(value, kinds, strict=True))

"""Validation, TOML and help texts of the frozen dataclasses that users configure."""

import dataclasses
import math
import types
import typing
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Literal, Self, TypeVar, get_args, get_origin

import msgspec
import numpy as np
from msgspec import Meta

from terrainkit.errors import ConfigError, known_names, nearest, shorten
from terrainkit.toml_text import key_text, line_text, parse_toml, read_text

if typing.TYPE_CHECKING:
    from pathlib import Path

NONE = "none"
"""How TOML and the command line, which have no null, write None."""

_MAX_MESSAGE = 500
"""Longest error message about a file [characters]: it may quote what is in the file."""

_MAX_INT = 2**63

_DOT_HINT = " (a key with a dot needs quotes)"

SORTED = Meta(extra={"sorted": True})
"""Of two numbers, the second may not be below the first."""

UNIQUE = Meta(extra={"unique": True})
"""No item of the list may occur twice."""

PositiveFloat = Annotated[float, Meta(gt=0)]
NonNegativeFloat = Annotated[float, Meta(ge=0)]
Fraction = Annotated[float, Meta(ge=0, le=1)]
PositiveInt = Annotated[int, Meta(ge=1)]
Interval = Annotated[tuple[float, float], SORTED]
NonNegativeInterval = Annotated[tuple[NonNegativeFloat, NonNegativeFloat], SORTED]


@dataclass(frozen=True, kw_only=True)
class Config:
    """A frozen dataclass whose values are validated when an instance is made.

    The annotation of a field states its type and range, its docstring the help text.
    """

    def __post_init__(self) -> None:
        """Validate every field, those of a subclass included.

        Raises:
            ConfigError: if a value has the wrong type or is out of range.
        """
        cls = type(self)
        if "__dataclass_fields__" not in vars(cls):
            raise ConfigError(f"{cls.__name__} lacks @dataclass(frozen=True, kw_only=True)")
        for name, annotation in field_types(cls).items():
            object.__setattr__(self, name, convert(name, getattr(self, name), annotation))

    @classmethod
    def from_table(
        cls, table: Mapping[str, Any], default: Self | None = None, path: str = ""
    ) -> Self:
        """Return the config that a TOML table describes.

        Args:
            table: Values by key.
            default: Config that missing keys take their values from; else the class's defaults.
            path: Prefix of the keys in error messages, such as "rewards.".

        Raises:
            ConfigError: if a key is unknown or missing, or a value is invalid.
        """
        cls = cls if default is None else type(default)
        annotations = field_types(cls)
        for key in table:
            if key not in annotations:
                nested = (k for k, _ in flatten(default or ()) if k.endswith(f".{key}"))
                known = known_names(key, annotations, "it has", next(nested, ""))
                owner = path.removesuffix(".") or "config"
                hint = _DOT_HINT if isinstance(table[key], Mapping) and path else ""
                raise ConfigError(f"{owner} has no key {shorten(repr(key))}{hint}; {known}")
        values = {
            key: _with_configs(path + key_text(key), value, annotations[key], default, key)
            for key, value in table.items()
        }
        for field in dataclasses.fields(cls) if default is None else ():
            if field.name not in values and is_required(field):
                expected = describe(annotations[field.name])
                raise ConfigError(f"{path}{field.name}: missing; expected {expected}")
        if default is not None:
            return replace(path, default, values)
        try:
            return cls(**values)
        except ConfigError as error:
            raise ConfigError(f"{path}{error}") from error

    @classmethod
    def from_toml(cls, text: str, default: Self | None = None) -> Self:
        """Return the config that TOML text describes, as :meth:`from_table` does."""
        try:
            return cls.from_table(parse_toml(text), default)
        except ConfigError as error:
            message = " ".join(str(error).split())
            raise ConfigError(shorten(message, _MAX_MESSAGE)) from error

    @classmethod
    def load(cls, path: "str | Path", default: Self | None = None) -> Self:
        """Return the config in the TOML file `path`, as :meth:`from_table` does.

        Raises:
            ConfigError: if the file cannot be read, is larger than a megabyte, or is invalid.
        """
        text = read_text(path)
        try:
            return cls.from_toml(text, default)
        except ConfigError as error:
            raise ConfigError(f"{path}: {error}") from error

    def to_table(self) -> dict[str, Any]:
        """Return the values that a TOML file holds, by key."""
        return {name: getattr(self, name) for name in field_types(type(self))}

    def to_toml(self) -> str:
        """Return the config as TOML with comments; :meth:`from_toml` restores it."""
        return "\n".join([*_toml_lines("", self), ""])


_C = TypeVar("_C", bound=Config)


@cache
def field_types(cls: type[Any]) -> dict[str, Any]:
    """Return the annotation of each field of a dataclass, by name."""
    annotations = typing.get_type_hints(cls, include_extras=True)
    return {field.name: annotations[field.name] for field in dataclasses.fields(cls)}


@cache
def field_docs(cls: type[Any]) -> dict[str, str]:
    """Return the docstring of each field of a dataclass on one line, by name."""
    import docstring_parser

    return {
        param.arg_name: " ".join((param.description or "").split())
        for owner in reversed(cls.__mro__[:-1])  # a subclass inherits the docs of its parents
        for param in docstring_parser.parse_from_object(owner).params
    }


def is_required(field: "dataclasses.Field[Any]") -> bool:
    """Return whether a field has no default."""
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING


def is_config(kind: Any) -> bool:
    """Return whether `kind` is a subclass of Config."""
    return isinstance(kind, type) and issubclass(kind, Config)


def without_none(annotation: Any) -> Any:
    """Return `X` for an annotation `X | None`; any other annotation is returned as it is."""
    if get_origin(annotation) not in (typing.Union, types.UnionType):
        return annotation
    (kind,) = (part for part in get_args(annotation) if part is not types.NoneType)
    return kind


def without_meta(annotation: Any) -> tuple[Any, list[Meta]]:
    """Return the type in an `Annotated`, and its constraints."""
    if get_origin(annotation) is not Annotated:
        return annotation, []
    return annotation.__origin__, [m for m in annotation.__metadata__ if isinstance(m, Meta)]


def flatten(config: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield name and value of each field, those of nested configs included ("env.num_envs")."""
    for name in field_types(type(config)) if isinstance(config, Config) else ():
        value = getattr(config, name)
        if isinstance(value, Config):
            yield from flatten(value, f"{path}{name}.")
        else:
            yield path + name, value


def replace(path: str, config: _C, values: Mapping[str, Any]) -> _C:
    """Return a copy of a config with other values.

    Args:
        path: Prefix of the names in error messages, such as "rewards.".
        config: The config.
        values: New values by name.

    Raises:
        ConfigError: if a value is invalid.
    """
    try:
        return dataclasses.replace(config, **values)
    except ConfigError as error:
        raise ConfigError(f"{path}{error}") from error


def convert(name: str, value: object, annotation: Any) -> Any:
    """Return `value` as the annotated type: 8 as 8.0 for a float, a list as a tuple.

    Nothing is guessed: a string is never a number, a boolean never an integer.

    Args:
        name: Name of the value in the error message.
        value: A value from a caller or a file; numpy's scalars become Python's.
        annotation: A type, with its range as in `Annotated[float, msgspec.Meta(ge=0)]`.

    Raises:
        ConfigError: if the value has another type, is out of range or not finite.
    """
    value = _plain(value)
    kind, metas = without_meta(without_none(annotation))
    origin, args = get_origin(kind), get_args(kind)
    if value is None and kind is not annotation and without_none(annotation) is not annotation:
        return None
    if origin is Mapping and isinstance(value, Mapping):
        return {
            convert(f"key of {name}", k, args[0]): convert(f"{name}.{key_text(k)}", item, args[1])
            for k, item in value.items()
        }
    if origin is tuple and is_config(args[0]) and isinstance(value, tuple):
        return tuple(convert(f"{name}[{i}]", item, args[0]) for i, item in enumerate(value))
    if is_config(kind) and isinstance(value, kind):
        return value
    if not is_config(kind) and not isinstance(value, Mapping):
        try:
            converted = msgspec.convert(value, annotation)
            if _is_valid(value, metas):
                return converted
        except (msgspec.ValidationError, UnicodeEncodeError):
            pass
    near = nearest(str(value), map(str, args)) if origin is Literal else ""
    meant = f"; did you mean {near!r}?" if near else ""
    meant += _DOT_HINT if isinstance(value, Mapping) and "." in name else ""
    raise ConfigError(f"{name}: got {show(value)}; expected {describe(annotation)}{meant}")


def _plain(value: Any) -> Any:
    """Return `value` with lists as tuples, and numpy's scalars as Python's."""
    if isinstance(value, list | tuple):
        return tuple(_plain(item) for item in value)
    return value.item() if isinstance(value, np.generic) else value


def _is_valid(value: Any, metas: list[Meta]) -> bool:
    """Return whether numbers are finite, and the constraints that msgspec does not know hold."""
    items = value if isinstance(value, tuple) else (value,)
    extra = {key for meta in metas for key in meta.extra or {}}
    return (
        all(math.isfinite(item) for item in items if isinstance(item, float))
        and all(abs(item) < _MAX_INT for item in items if isinstance(item, int))
        and ("sorted" not in extra or list(items) == sorted(items))
        and ("unique" not in extra or len(set(items)) == len(items))
    )


def show(value: object) -> str:
    """Return `value` as an error message quotes it."""
    if isinstance(value, int) and abs(value) >= _MAX_INT:  # Python does not print 5000 digits
        return "an integer beyond 64 bits"
    if isinstance(value, Config | Mapping):
        return "a table" if isinstance(value, Mapping) else type(value).__name__
    if isinstance(value, tuple):
        return shorten(f"[{', '.join(map(show, value))}]")
    return shorten(repr(value))


def describe(annotation: Any) -> str:
    """Return in words what an annotation accepts, such as `an integer from 1 to 10`."""
    inner = without_none(annotation)
    return _describe(inner) + ("" if inner is annotation else f", or {NONE}")


_WORDS = {int: "an integer", float: "a number", str: "a string", bool: "true or false"}
_LIMITS = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}


def _describe(annotation: Any) -> str:
    kind, metas = without_meta(annotation)
    origin, args = get_origin(kind), get_args(kind)
    limits = {k: v for m in metas for k in _LIMITS if (v := getattr(m, k)) is not None}
    extra = {key: value for meta in metas for key, value in (meta.extra or {}).items()}
    description = next((meta.description for meta in metas if meta.description), "")
    if description:
        text = description
    elif origin is Literal:
        text = f"one of: {', '.join(map(str, args))}"
    elif origin is tuple:
        non_empty = "non-empty " if any(meta.min_length for meta in metas) else ""
        count = (
            f"a {non_empty}list, each value" if Ellipsis in args else f"{len(args)} values, each"
        )
        text = f"{count} {_describe(args[0])}"
        text += ", the lower one first" if "sorted" in extra else ""
        text += ", each one once" if "unique" in extra else ""
    elif origin is Mapping:
        text = f"a table, each value {_describe(args[1])}"
    else:
        text = f"a table ({kind.__name__})" if is_config(kind) else _WORDS.get(kind, str(kind))
    if {"ge", "le"} <= set(limits):
        text += f" from {_number(limits['ge'])} to {_number(limits['le'])}"
    else:
        limit_texts = (f" {_LIMITS[key]} {_number(limit)}" for key, limit in limits.items())
        text += " and".join(limit_texts)
    return f"{text} [{extra['unit']}]" if extra.get("unit", "1") != "1" else text


def _number(value: float) -> str:
    return str(value) if isinstance(value, int) else f"{value:.15g}"


def _with_configs(path: str, value: Any, annotation: Any, owner: Config | None, key: str) -> Any:
    """Return a value from TOML, with a Config for each table where one is expected."""
    kind, _ = without_meta(without_none(annotation))
    args, default = get_args(kind), getattr(owner, key, None)
    if value == NONE and without_none(annotation) is not annotation:
        return None
    if is_config(kind) and isinstance(value, Mapping):
        return kind.from_table(value, default, f"{path}.")
    if is_config(args[-1] if get_origin(kind) is Mapping else None) and isinstance(value, Mapping):
        parts = {k: f"{path}.{key_text(k)}" for k in value}
        return {k: _with_configs(parts[k], v, args[-1], None, "") for k, v in value.items()}
    if get_origin(kind) is tuple and is_config(args[0]) and isinstance(value, list):
        return tuple(
            _with_configs(f"{path}[{i}]", v, args[0], None, "") for i, v in enumerate(value)
        )
    return value


def _toml_lines(path: str, config: Config) -> Iterator[str]:
    """Yield the lines of a config: values first, then a table for each nested config."""
    docs, tables = field_docs(type(config)), []
    for key, value in config.to_table().items():
        several = isinstance(value, tuple) and value and isinstance(value[0], Config)
        if several:
            tables += [(f"[[{path}{key}]]", each) for each in value]
        elif isinstance(value, Config):
            tables.append((f"[{path}{key}]", value))
        else:
            yield line_text(key, NONE if value is None else value, docs.get(key, ""))
    for header, nested in tables:
        yield from ["", f"# {(type(nested).__doc__ or '').splitlines()[0]}", header]
        yield from _toml_lines(f"{header.strip('[]')}.", nested)

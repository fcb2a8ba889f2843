"""Validation, TOML and help texts of the frozen dataclasses that users configure."""

import dataclasses
import typing
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Self

from terrainkit.errors import (
    ConfigError,
    TerrainkitError,
    is_built_in,
    plugin_errors,
    prefixed_errors,
)
from terrainkit.settings.field_docs import field_docs
from terrainkit.settings.text import expected_names, truncate
from terrainkit.settings.toml_text import key_text, line_text, parse_toml, read_text
from terrainkit.settings.type_hint import NONE, convert, describe, is_table, parse_hint

if typing.TYPE_CHECKING:
    from pathlib import Path

_MAX_MESSAGE = 500
"""Longest error message about a file [characters]: it may quote what is in the file."""


@dataclass(frozen=True, kw_only=True)
class Config:
    """A frozen dataclass whose values are validated when an instance is made.

    The annotation of a field states its type and range, its docstring the help text.
    """

    def __post_init__(self) -> None:
        """Validate every field, including the fields of a subclass.

        Raises:
            ConfigError: if a value has the wrong type or is out of range.
        """
        cls: Any = type(self)
        if "__dataclass_fields__" not in vars(cls):
            raise ConfigError(f"{cls.__name__} lacks @dataclass(frozen=True, kw_only=True)")
        hints = field_types(cls)
        for key, name in field_keys(cls).items():
            object.__setattr__(self, name, convert(key, getattr(self, name), hints[name]))

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
        kind: Any = cls if default is None else type(default)
        hints, names = field_types(kind), field_keys(kind)
        for key in table:
            if key not in names:
                nested = (k for k, _ in flatten(default or ()) if k.endswith(f".{key}"))
                known = expected_names(key, names, "it has", next(nested, ""))
                owner = path.removesuffix(".") or "config"
                is_nested = isinstance(table[key], Mapping) and path
                note = " (a key with a dot needs quotes)" if is_nested else ""
                raise ConfigError(f"{owner} has no key {truncate(repr(key))}{note}; {known}")
        values = {
            names[key]: nested_values(
                path + key_text(key), value, hints[names[key]], getattr(default, key, None)
            )
            for key, value in table.items()
        }
        for field in dataclasses.fields(kind) if default is None else ():
            if field.name not in values and is_required(field):
                expected = describe(hints[field.name])
                raise ConfigError(f"{path}{field.name}: missing; expected {expected}")
        plugin = None if is_built_in(kind) else f"{kind.__module__}:{kind.__qualname__}"
        with prefixed_errors(path), plugin_errors(plugin, TerrainkitError):
            return cls(**values) if default is None else dataclasses.replace(default, **values)

    @classmethod
    def from_toml(cls, text: str, default: Self | None = None) -> Self:
        """Return the config that TOML text describes, as `from_table` does.

        Args:
            text: The TOML text.
            default: Config whose values missing keys take; None for the defaults of the class.

        Raises:
            ConfigError: if the text is not TOML, or a key or value is invalid.
        """
        try:
            return cls.from_table(parse_toml(text), default)
        except ConfigError as error:
            message = " ".join(str(error).split())
            raise ConfigError(truncate(message, _MAX_MESSAGE)) from error

    @classmethod
    def load(cls, path: "str | Path", default: Self | None = None) -> Self:
        """Return the config in the TOML file `path`, as `from_table` does.

        Args:
            path: The TOML file.
            default: Config whose values missing keys take; None for the defaults of the class.

        Raises:
            ConfigError: if the file cannot be read, is larger than a megabyte, or is invalid.
        """
        text = read_text(path)
        with prefixed_errors(f"{path}: "):
            return cls.from_toml(text, default)

    def with_defaults(self) -> Self:
        """Return a config with the defaults of its class.

        Nested configs keep their classes, and fields without a default their values.
        """
        kept = {
            field.name: value.with_defaults() if isinstance(value, Config) else value
            for field in dataclasses.fields(self)
            if isinstance(value := getattr(self, field.name), Config) or is_required(field)
        }
        return type(self)(**kept)

    def to_table(self) -> dict[str, Any]:
        """Return the values that a TOML file holds, by key."""
        kind: Any = type(self)
        return {name: getattr(self, name) for name in field_types(kind)}

    def to_toml(self) -> str:
        """Return the config as TOML with comments; `from_toml` restores it.

        Raises:
            ConfigError: if it has a file name that is not UTF-8, as TOML must be.
        """
        text = "\n".join([*_toml_lines("", self), ""])
        try:
            text.encode()
        except UnicodeEncodeError as error:
            line = text[: error.end].rpartition("\n")[2]
            raise ConfigError(f"got {truncate(line)!a}; expected a name that is UTF-8") from None
        return text


@cache
def field_types(cls: type[Any]) -> dict[str, Any]:
    """Return the annotation of each field of a dataclass, by name."""
    hints = typing.get_type_hints(cls, include_extras=True)
    return {field.name: hints[field.name] for field in dataclasses.fields(cls)}


@cache
def field_keys(cls: type[Any]) -> dict[str, str]:
    """Return the name of each field by its TOML key: `key` in its metadata, or else the name."""
    return {field.metadata.get("key", field.name): field.name for field in dataclasses.fields(cls)}


def is_required(field: "dataclasses.Field[Any]") -> bool:
    """Return whether a field has no default."""
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING


def flatten(config: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield name and value of each field, including fields of nested configs ("env.num_envs")."""
    kind: Any = type(config)
    for name in field_types(kind) if isinstance(config, Config) else ():
        value = getattr(config, name)
        if isinstance(value, Config):
            yield from flatten(value, f"{path}{name}.")
        else:
            yield path + name, value


def nested_table(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values with keys such as "env.num_envs" as nested mappings."""
    nested: dict[str, Any] = {}
    for key, value in values.items():
        *sections, name = key.split(".")
        table = nested
        for section in sections:
            table = table.setdefault(section, {})
        table[name] = value
    return nested


def nested_values(path: str, value: Any, hint: Any, default: Any = None) -> Any:
    """Return a value from TOML, with a Config for each table where one is expected."""
    kind, origin, args, _, is_optional = parse_hint(hint)
    if value == NONE and is_optional:
        return None
    if is_table(kind) and isinstance(value, Mapping):
        return kind.from_table(value, default, f"{path}.")
    if origin is Mapping and is_table(args[1]) and isinstance(value, Mapping):
        return {
            key: nested_values(f"{path}.{key_text(key)}", item, args[1])
            for key, item in value.items()
        }
    if origin is tuple and is_table(args[0]) and isinstance(value, list):
        return tuple(nested_values(f"{path}[{i}]", item, args[0]) for i, item in enumerate(value))
    return value


def _summary(kind: type[Any]) -> str:
    """Return the first line of the docstring of a config, or of its nearest base with one."""
    # A dataclass without a docstring gets its signature as one.
    docs = {parent.__name__: parent.__doc__ or "" for parent in kind.__mro__}
    return next(d for name, d in docs.items() if not d.startswith(f"{name}(")).partition("\n")[0]


def _toml_lines(path: str, config: Config) -> Iterator[str]:
    """Yield the lines of a config: values first, then a table for each nested config."""
    kind: Any = type(config)
    docs = field_docs(kind)
    tables = []
    for key, value in config.to_table().items():
        if isinstance(value, tuple) and value and isinstance(value[0], Config):
            tables += [(f"[[{path}{key}]]", item) for item in value]
        elif isinstance(value, Config):
            tables.append((f"[{path}{key}]", value))
        else:
            yield line_text(key, NONE if value is None else value, docs.get(key, ""))
    for header, nested in tables:
        yield from ["", f"# {_summary(type(nested))}", header]
        yield from _toml_lines(f"{header.strip('[]')}.", nested)

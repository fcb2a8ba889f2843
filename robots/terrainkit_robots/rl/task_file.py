"""Task as TOML, and back: a table for each section, such as `[rewards]`, a key for each value.

What a file leaves out stays as it is in the task that it is read onto; `"none"` writes None. A
subclass of Task, or of a section, has keys for its own fields: the class of that task decides.
"""

import types
from collections.abc import Iterator, Mapping
from dataclasses import fields, replace
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from terrainkit.errors import ConfigError, listing
from terrainkit.toml_text import parse_toml
from terrainkit_robots.mesh.sniff import open_regular
from terrainkit_robots.rl.section import Section
from terrainkit_robots.rl.task import Task
from terrainkit_robots.spec.toml_text import LINE, comment_text, key_text, value_text
from terrainkit_robots.text import closest, short

NONE = "none"
"""How TOML, which has no null, writes None."""

_LARGEST = 1 << 20
"""No task is larger [bytes]."""

_MESSAGE = 500
"""Errors are cut to so many characters: they may repeat what is in the file."""

_CLOSE = 0.7
"""Share of common letters from which a key is what another was meant for."""

_HEAD = """\
# A task: every number of training. SI units and radians. What is left out has its default;
# "none" is none.
"""

_SomeSection = TypeVar("_SomeSection", bound=Section)


def to_toml(task: Task) -> str:
    """Return a task as TOML; :func:`from_toml` makes an equal one of it."""
    return "\n".join([_HEAD, *_tables("", task)])


def from_toml(text: str, default: Task | None = None) -> Task:
    """Return the task that `text` describes; what it leaves out is as in `default`.

    Raises:
        ConfigError: if it is not TOML, names a key that is not known, or holds a value of another
            kind or outside its limits.
    """
    try:
        return _changed("", Task() if default is None else default, parse_toml(text))
    except ConfigError as error:
        raise ConfigError(short(" ".join(str(error).split()), _MESSAGE)) from error


def read_task(path: str | Path, default: Task | None = None) -> Task:
    """Return the task in the TOML file `path`; what it leaves out is as in `default`.

    Raises:
        ConfigError: if it cannot be read, is no plain file or over a megabyte, or as
            :func:`from_toml`.
    """
    try:
        with open_regular(Path(path)) as file:
            data = file.read(_LARGEST + 1)
    except (OSError, ValueError) as error:  # ValueError for a path with NUL
        reason = error.strerror if isinstance(error, OSError) else None
        raise ConfigError(f"cannot read {path}: {reason or error}") from error
    if len(data) > _LARGEST:
        raise ConfigError(f"{path}: over {_LARGEST} bytes; wanted the TOML file of a task")
    try:
        return from_toml(data.decode(), default)
    except (ConfigError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: {error}") from error


def values_of(section: Section, path: str = "") -> Iterator[tuple[str, object]]:
    """Yield the name of each value of a section and of those in it, with dots, and the value."""
    for each in fields(section):
        value = getattr(section, each.name)
        if isinstance(value, Section):
            yield from values_of(value, f"{path}{each.name}.")
        else:
            yield path + each.name, value


def may_be_none(kind: object) -> bool:
    """Return whether None is a value of a field of that type."""
    return get_origin(kind) in (Union, types.UnionType) and types.NoneType in get_args(kind)


def told_of(section: type[Section]) -> dict[str, str]:
    """Return what the docstrings of a section's fields say, on one line each, by name."""
    return _told(section.__mro__)


@cache  # the source is read and parsed
def _told(classes: tuple[type, ...]) -> dict[str, str]:
    import docstring_parser

    told = {}
    for each in reversed(classes):
        if issubclass(each, Section):
            for field in docstring_parser.parse_from_object(each).params:
                told[field.arg_name] = " ".join((field.description or "").split())
    return told


def changed(path: str, section: _SomeSection, values: Mapping[str, object]) -> _SomeSection:
    """Return a section with some of its values changed.

    Args:
        path: What the section is called in errors, with a dot at the end unless it is empty.
        section: The section.
        values: The new values, by name.

    Raises:
        ConfigError: if a value is of another kind, or outside its limits.
    """
    try:
        return replace(section, **values)
    except ConfigError as error:
        raise ConfigError(f"{path}{error}") from error


def _tables(path: str, section: Section) -> Iterator[str]:
    """Yield the table of a section, and of each section in it."""
    told, inner, lines = told_of(type(section)), [], []
    for each in fields(section):
        value = getattr(section, each.name)
        if isinstance(value, Section):
            inner.append((each.name, value))
        else:
            text = value_text(NONE if value is None else value, LINE - len(f"{each.name} = "))
            lines.append(f"{each.name} = {text}{comment_text(told.get(each.name, ''))}\n")
    if path:
        about = comment_text((section.__doc__ or "").partition("\n")[0]).lstrip()
        yield "".join([f"{about}\n" if about else "", f"[{path}]\n", *lines])
    else:
        yield from lines
    for name, value in inner:
        yield from _tables(f"{path}.{name}" if path else name, value)


def _changed(path: str, section: _SomeSection, table: Mapping[str, Any]) -> _SomeSection:
    """Return a section with the values that a table of TOML has."""
    kinds, values = get_type_hints(type(section)), {}
    _refuse_unknown(path, section, table)
    for key, value in table.items():
        old = getattr(section, key)
        if not isinstance(old, Section):
            none = isinstance(value, str) and value == NONE and may_be_none(kinds[key])
            values[key] = None if none else value
        elif isinstance(value, Mapping):
            values[key] = _changed(f"{path}{key}.", old, value)
        else:
            raise ConfigError(f"{path}{key} is {value!r}; wanted a table, [{path}{key}]")
    return changed(path, section, values)


def _refuse_unknown(path: str, section: Section, table: Mapping[str, Any]) -> None:
    known = [each.name for each in fields(section)]
    for key in table:
        if key in known:
            continue
        inside = [name for name, _ in values_of(section) if name.endswith(f".{key}")]
        near = inside[0] if inside else closest(key, known, _CLOSE)
        meant = f"; did you mean {path}{near}?" if near else ""
        where = f"{path.removesuffix('.')} has" if path else "a task has"
        raise ConfigError(f"no key {path}{short(key_text(key))}{meant}; {where}: {listing(known)}")

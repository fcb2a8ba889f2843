"""RobotSpec as TOML, and back: the robot.toml of a robot.

Each number has its unit beside it, and where it came from. The same is kept as data in the table
`provenance`, so that a file that is read and written again stays what it was.
"""

import textwrap
from collections.abc import Mapping
from dataclasses import MISSING, Field, fields
from pathlib import Path
from typing import Any, get_args, get_origin

from terrainkit.errors import ConfigError, listing
from terrainkit.toml_text import parse_toml
from terrainkit_robots.mesh.sniff import open_regular
from terrainkit_robots.spec.robot_spec import Provenance, RobotSpec, Twin, unit_of
from terrainkit_robots.spec.toml_text import LINE, comment_text, key_text, value_text
from terrainkit_robots.text import closest, short

FORMAT_VERSION = 1
"""Version of the file's format; it changes when an old file would be read wrongly."""

_LARGEST = 1 << 20
"""No spec is larger [bytes]."""

_MESSAGE = 500
"""Errors are cut to so many characters: they may repeat what is in the file."""

_HEAD = """\
# {name} as training sees it. SI units, radians, z up; edit what you like.
#
# In a table by joint a key is the name of a joint, or a regular expression that matches the whole
# of it, such as ".*_hip_joint"; every joint has to be matched exactly once. Beside each number are
# its unit and where it came from when this file was written; the table [provenance] keeps that.
"""


def to_toml(spec: RobotSpec) -> str:
    """Return a spec as TOML; :func:`from_toml` makes an equal one of it."""
    import docstring_parser

    documented = docstring_parser.parse_from_object(RobotSpec).params
    told = {field.arg_name: _about(field.description or "") for field in documented}
    values, tables = [], []
    for field in fields(spec):
        value = getattr(spec, field.name)
        about = told.get(field.name, "")
        if isinstance(value, Mapping):
            tables.append(f"{about}[{field.name}]{_beside(spec, field.name)}\n")
            tables[-1] += "".join(map(_line, _entries(spec, field.name, value)))
        elif value is not None:
            text = value_text(value, LINE - len(field.name) - len(" = "))
            values.append(f"{about}{field.name} = {text}{_beside(spec, field.name)}\n")
    head = _HEAD.format(name=comment_text(spec.name)[4:] or "The robot")
    version = f"format_version = {FORMAT_VERSION}\n"
    return "\n".join([head, version, *values, *tables])


def _about(description: str) -> str:
    """Return comment lines that say what a field is."""
    lines = textwrap.wrap(" ".join(description.split()), LINE - len("# "))
    return "".join(f"# {line}\n" for line in lines)


def _beside(spec: RobotSpec, name: str) -> str:
    """Return the comment beside a number: unit and origin."""
    unit = unit_of(name)
    if not unit:
        return comment_text(_told(spec.provenance.get(name)))
    return comment_text("no unit" if unit == "1" else unit, _told(spec.provenance.get(name)))


def _told(origin: Provenance | None) -> str:
    if origin is None:
        return ""
    return f"{origin.origin}: {origin.reason}" if origin.reason else origin.origin


def _entries(spec: RobotSpec, name: str, table: Mapping[str, Any]) -> list[tuple[str, object, str]]:
    """Return key, value and comment of each line of a table."""
    if name == "provenance":
        return [(key, _origin_table(origin), "") for key, origin in table.items()]
    if name == "mirror":
        table = {key: {"joint": twin.joint, "sign": twin.sign} for key, twin in table.items()}
    own = spec.provenance
    return [(key, value, _told(own.get(f"{name}.{key}"))) for key, value in table.items()]


def _origin_table(origin: Provenance) -> dict[str, str]:
    return {"origin": origin.origin} | ({"reason": origin.reason} if origin.reason else {})


def _line(entry: tuple[str, object, str]) -> str:
    key, value, comment = entry
    return f"{key_text(key)} = {value_text(value)}{comment_text(comment)}\n"


def from_toml(text: str) -> RobotSpec:
    """Return the spec that `text` describes; what may be left out has its default.

    Raises:
        ConfigError: if it is not TOML, lacks a key or names one that is not known, or holds a value
            of another kind or out of its range.
    """
    try:
        return _spec(parse_toml(text))
    except ConfigError as error:
        raise ConfigError(short(" ".join(str(error).split()), _MESSAGE)) from error


def read_spec(path: Path) -> RobotSpec:
    """Return the spec in the TOML file `path`.

    Raises:
        ConfigError: if it cannot be read, is no plain file or over a megabyte, or as
            :func:`from_toml`.
    """
    try:
        with open_regular(path) as file:
            data = file.read(_LARGEST + 1)
    except (OSError, ValueError) as error:  # ValueError for a path with NUL
        reason = error.strerror if isinstance(error, OSError) else None
        raise ConfigError(f"cannot read {path}: {reason or error}") from error
    if len(data) > _LARGEST:
        raise ConfigError(f"{path}: over {_LARGEST} bytes; wanted the TOML file of a robot's spec")
    try:
        return from_toml(data.decode())
    except (ConfigError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: {error}") from error


def _spec(table: dict[str, Any]) -> RobotSpec:
    version = table.pop("format_version", None)
    if version != FORMAT_VERSION or isinstance(version, bool):
        got = "missing" if version is None else repr(version)
        raise ConfigError(f"format_version is {got}; wanted {FORMAT_VERSION}")
    known = {field.name: field for field in fields(RobotSpec)}
    _refuse_unknown("the spec", table, list(known))
    for name, field in known.items():
        if name not in table and _required(field):
            kind = "table" if get_origin(field.type) is Mapping else "key"
            raise ConfigError(f"the {kind} {name} is missing")
    for name, field in known.items():
        if name in table and get_origin(field.type) is Mapping:
            made = get_args(field.type)[1]
            if made in (Twin, Provenance):
                table[name] = _records(name, table[name], made)
    return RobotSpec(**table)


def _required(field: "Field[Any]") -> bool:
    return field.default is MISSING and field.default_factory is MISSING


def _refuse_unknown(what: str, table: Mapping[str, Any], known: list[str]) -> None:
    for key in table:
        if key not in known:
            near = closest(key, known, 0.7)
            meant = f"; did you mean {near}?" if near else ""
            raise ConfigError(f"{what} has no key {short(key)!r}{meant}; it has: {listing(known)}")


def _records(name: str, table: object, kind: type[Any]) -> dict[str, Any]:
    """Return a table of records such as { joint = "FR_hip_joint", sign = -1 }."""
    if not isinstance(table, Mapping):
        raise ConfigError(f"{name} is {table!r}; wanted a table")
    made = {}
    own = {field.name: field for field in fields(kind)}
    wanted = " and ".join(own)
    for key, record in table.items():
        what = f"{name}.{key_text(key)}"
        if not isinstance(record, Mapping):
            raise ConfigError(f"{what} is {record!r}; wanted a table with {wanted}")
        parts = "; a name with a dot goes in quotes" if _is_nested(record) else ""
        for part in record:
            if part not in own:
                raise ConfigError(f"{what} has {short(part)!r}; wanted {wanted}{parts}")
        for part, field in own.items():
            if part not in record and _required(field):
                raise ConfigError(f"{what} lacks {part}; wanted {wanted}")
        try:
            made[key] = kind(**record)
        except ConfigError as error:
            raise ConfigError(f"{what}.{error}") from error
    return made


def _is_nested(record: Mapping[str, Any]) -> bool:
    return any(isinstance(value, Mapping) for value in record.values())

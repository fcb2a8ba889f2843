"""Settings: what is asked of robots, from the command line and from files above them.

[tool.terrainkit.check-robot]          # pyproject.toml; [check-robot] in terrainkit.toml
select = ["INR", "JNT"]
ignore = { JNT009 = "the gripper is passive" }
package = { my_robot = "." }
xacro-arg = { arm = false }
strict = true
simulation = false                     # as --no-simulation
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from terrainkit.errors import ConfigError, listing
from terrainkit.toml_text import parse_toml
from terrainkit_robots.lint.rule import FAMILIES, Rule, rules


@dataclass(frozen=True, kw_only=True)
class Settings:
    """How robots are read and checked."""

    select: tuple[str, ...] = ()
    """Rules to ask, by code, start of a code, or name; all of them if empty."""

    ignore: Mapping[str, str] = field(default_factory=dict)
    """Why a rule is not asked, by code, start of a code, or name."""

    packages: Mapping[str, Path] = field(default_factory=dict)
    """Folder of each ROS package that a search would not find."""

    xacro_arguments: Mapping[str, str] = field(default_factory=dict)
    """Value of each xacro argument."""

    strict: bool = False
    """Whether warnings count as errors in the exit code."""

    simulate: bool = True
    """Whether rules that simulate are asked."""

    def over(self, other: "Settings") -> "Settings":
        """Return both, where these go before the `other` ones."""
        return Settings(
            select=self.select or other.select,
            ignore={**other.ignore, **self.ignore},
            packages={**other.packages, **self.packages},
            xacro_arguments={**other.xacro_arguments, **self.xacro_arguments},
            strict=self.strict or other.strict,
            simulate=self.simulate and other.simulate,
        )


def matching(word: str) -> tuple[Rule, ...]:
    """Return the rules that a code, the start of a code, or a name stands for.

    Raises:
        ConfigError: if there is none.
    """
    code, name = word.strip().upper(), word.strip().lower()
    found = tuple(r for r in rules() if code and (r.code.startswith(code) or r.name == name))
    if not found:
        raise ConfigError(
            f"no rule {word!r}; wanted a code, the start of one, or a name, of the families "
            f"{listing(FAMILIES)} (terrainkit rule --all lists them)"
        )
    return found


_FILES = {
    "terrainkit.toml": ("check-robot",),
    "pyproject.toml": ("tool", "terrainkit", "check-robot"),
}
"""Where settings are kept, and in which table."""

_KEYS = ("select", "ignore", "package", "xacro-arg", "strict", "simulation")

_LARGEST = 1 << 20
"""No configuration is larger [bytes]."""


def read_settings(folder: Path) -> Settings:
    """Return the settings for robots in `folder`: those in the nearest folder upwards that has any.

    Raises:
        ConfigError: if a file cannot be read, or has a key or a value that is not known.
    """
    # Not resolve(): it follows links, and the files are looked for along the path as it is given.
    start = Path(os.path.normpath(folder.absolute()))
    for parent in (start, *start.parents):
        for name, keys in _FILES.items():
            path = parent / name
            try:
                table = _table(path, keys)
                if table is not None:
                    return _settings(table, parent)
            except ConfigError as error:
                raise ConfigError(f"{path}: {error}") from error
            except OSError as error:
                raise ConfigError(f"cannot read {path}: {error.strerror or error}") from error
    return Settings()


def _table(path: Path, keys: Sequence[str]) -> dict[str, Any] | None:
    """Return the table of settings in a file; None if there is no such file or table."""
    if not path.is_file():
        return None
    with path.open("rb") as file:
        data = file.read(_LARGEST + 1)
    if len(data) > _LARGEST:
        raise ConfigError(f"over {_LARGEST} bytes; wanted a TOML file of settings")
    if path.name == "pyproject.toml" and b"terrainkit" not in data:
        return None  # somebody else's, sound or not
    try:
        table = parse_toml(data.decode())
    except UnicodeDecodeError as error:
        raise ConfigError(f"not a TOML file: {error}") from error
    for key in keys[:-1]:
        table = _subtable(table, key)
    _refuse_unknown(table, keys[-1:])
    return _subtable(table, keys[-1]) if keys[-1] in table else None


def _subtable(table: Mapping[str, Any], key: str) -> dict[str, Any]:
    value = table.get(key, {})
    if not isinstance(value, dict):
        raise ConfigError(f"{key} is {value!r}; wanted a table")
    return value


def _refuse_unknown(table: Mapping[str, Any], known: Sequence[str]) -> None:
    for key in table:
        if key not in known:
            raise ConfigError(f"no key {key!r}; there are: {listing(known)}")


def _settings(table: Mapping[str, Any], folder: Path) -> Settings:
    _refuse_unknown(table, _KEYS)
    for key in ("strict", "simulation"):
        if not isinstance(table.get(key, False), bool):
            raise ConfigError(f"{key} is {table[key]!r}; wanted true or false")
    packages = _texts(table, "package", "a folder")
    settings = Settings(
        select=_words(table.get("select", [])),
        ignore=_texts(table, "ignore", "a reason"),
        packages={name: package_folder(name, folder / path) for name, path in packages.items()},
        xacro_arguments=_arguments(table),
        strict=table.get("strict", False),
        simulate=table.get("simulation", True),
    )
    for word in (*settings.select, *settings.ignore):
        matching(word)
    return settings


def _words(value: object) -> tuple[str, ...]:
    words = value.split(",") if isinstance(value, str) else value
    if not isinstance(words, list) or not all(isinstance(word, str) for word in words):
        raise ConfigError(f"select is {value!r}; wanted a list of codes, or one text")
    return tuple(word.strip() for word in words if word.strip())


def _texts(table: Mapping[str, Any], key: str, what: str) -> dict[str, str]:
    value = table.get(key, {})
    if not isinstance(value, dict):
        raise ConfigError(f"{key} is {value!r}; wanted a table with {what} for each name")
    for name, item in value.items():
        if not isinstance(item, str) or not item.strip():
            raise ConfigError(f"{key}.{name} is {item!r}; wanted {what}, as a text")
    return dict(value)


def _arguments(table: Mapping[str, Any]) -> dict[str, str]:
    value = table.get("xacro-arg", {})
    if not isinstance(value, dict):
        raise ConfigError(f"xacro-arg is {value!r}; wanted a table with a value for each name")
    for name, item in value.items():
        if not isinstance(item, str | int | float):
            raise ConfigError(f"xacro-arg.{name} is {item!r}; wanted a text, a number or a boolean")
    return {n: str(v).lower() if isinstance(v, bool) else str(v) for n, v in value.items()}


def package_folder(name: str, folder: Path) -> Path:
    """Return the folder of a package.

    Raises:
        ConfigError: if there is no such folder.
    """
    if not folder.is_dir():
        raise ConfigError(f"package {name} is to be in {folder}, where there is no folder")
    return folder

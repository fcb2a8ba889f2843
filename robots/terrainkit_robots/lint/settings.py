"""Settings: how robots are read and checked, from the command line and from configuration files.

[tool.terrainkit.check-robot]          # pyproject.toml; [check-robot] in terrainkit.toml
select = ["INR", "JNT"]
ignore = { JNT009 = "the gripper is passive" }
package = { my_robot = "." }
xacro-arg = { arm = false }
strict = true
simulation = false                     # as --no-simulation
"""

import dataclasses
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Self

from msgspec import Meta

from terrainkit.errors import ConfigError, listing
from terrainkit.settings.schema import Config
from terrainkit.settings.text import closest
from terrainkit.settings.toml_text import parse_toml, read_text
from terrainkit.settings.type_hint import show
from terrainkit_robots.lint.rule import Rule, families, rules

Reason = Annotated[str, Meta(pattern=r"\S", description="a reason, as a string")]

_FILES = {
    "terrainkit.toml": ("check-robot",),
    "pyproject.toml": ("tool", "terrainkit", "check-robot"),
}
"""Configuration files, and the table with the settings in each."""


@dataclass(frozen=True, kw_only=True)
class Settings(Config):
    """How robots are read and checked."""

    select: tuple[str, ...] = ()
    """Rules to run, by code, prefix of a code, or name; all of them if empty."""

    ignore: Mapping[str, Reason] = field(default_factory=dict)
    """Reason for ignoring a rule, by code, prefix of a code, or name."""

    packages: Mapping[str, Path] = field(default_factory=dict, metadata={"key": "package"})
    """Folder of each ROS package that is not found otherwise."""

    xacro_arguments: Mapping[str, str] = field(default_factory=dict, metadata={"key": "xacro-arg"})
    """Value of each xacro argument."""

    feet: tuple[str, ...] = ()
    """Links that are the feet, one for each leg; none: found by geometry."""

    strict: bool | None = None
    """Whether warnings count as errors in the exit code; none: no."""

    simulate: bool | None = field(default=None, metadata={"key": "simulation"})
    """Whether to run the rules that simulate; none: yes."""

    @classmethod
    def from_table(
        cls, table: Mapping[str, Any], default: Self | None = None, path: str = ""
    ) -> Self:
        """Return the settings of a TOML table; see `Config.from_table`."""
        values = dict(table)
        if isinstance(select := table.get("select"), str):
            values["select"] = [word.strip() for word in select.split(",") if word.strip()]
        for key, convert in (("package", _to_path), ("xacro-arg", _to_text)):
            if isinstance(table.get(key), Mapping):
                values[key] = {name: convert(value) for name, value in table[key].items()}
        return super().from_table(values, default, path)

    def over(self, other: "Settings") -> "Settings":
        """Return both settings combined; these have priority over the `other` ones."""
        return Settings(
            select=self.select or other.select,
            ignore={**other.ignore, **self.ignore},
            packages={**other.packages, **self.packages},
            xacro_arguments={**other.xacro_arguments, **self.xacro_arguments},
            feet=self.feet or other.feet,
            strict=other.strict if self.strict is None else self.strict,
            simulate=other.simulate if self.simulate is None else self.simulate,
        )


def matching(word: str) -> tuple[Rule, ...]:
    """Return the rules with a code, a prefix of a code, or a name.

    Args:
        word: Code such as `JNT007`, prefix such as `JNT`, or name such as `inverted-limits`.

    Raises:
        ConfigError: if there is none.
    """
    code, name = word.strip().upper(), word.strip().lower()
    every = rules() + rules("task")
    found = tuple(r for r in every if code and (r.code.startswith(code) or r.name == name))
    if not found:
        near = closest(name, [rule.name for rule in every])
        meant = f"did you mean {near}? Expected" if near else "expected"
        raise ConfigError(
            f"no rule {word!r}; {meant} a code, a prefix of one, or a name, of the families "
            f"{listing(families())} (terrainkit rule --all lists them)"
        )
    return found


def read_settings(folder: Path) -> Settings:
    """Return the settings in the nearest configuration file in `folder` or above it.

    Raises:
        ConfigError: if a file cannot be read, or has an unknown key or an invalid value.
    """
    # Not resolve(): it follows links, and files are searched along the path as it is given.
    start = Path(os.path.normpath(folder.absolute()))
    for path in (parent / name for parent in (start, *start.parents) for name in _FILES):
        if not path.is_file():
            continue
        if path.name == "pyproject.toml" and b"terrainkit" not in path.read_bytes():
            continue  # of another tool, and not parsed
        text = read_text(path)
        try:
            table: Any = parse_toml(text)
            *outer, last = _FILES[path.name]
            for key in outer:
                table = _nested_table(table, key)
            if unknown := [key for key in table if key != last]:
                raise ConfigError(f"no key {unknown[0]!r}; expected {last}")
            if last in table:
                return _settings(_nested_table(table, last), path.parent)
        except ConfigError as error:
            raise ConfigError(f"{path}: {error}") from error
    return Settings()


def _nested_table(table: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    value = table.get(key, {})
    if not isinstance(value, Mapping):
        raise ConfigError(f"{key}: got {show(value)}; expected a table")
    return value


def _settings(table: Mapping[str, Any], folder: Path) -> Settings:
    settings = Settings.from_table(table)
    for word in (*settings.select, *settings.ignore):
        matching(word)
    folders = {
        name: package_folder(name, folder / path) for name, path in settings.packages.items()
    }
    return dataclasses.replace(settings, packages=folders)


def _to_path(value: object) -> object:
    return Path(value) if isinstance(value, str) else value


def _to_text(value: object) -> object:
    """Return a xacro argument as xacro expects it: numbers and booleans as text."""
    return str(value).lower() if isinstance(value, bool | int | float) else value


def package_folder(name: str, folder: Path) -> Path:
    """Return the folder of a package.

    Raises:
        ConfigError: if there is no such folder.
    """
    if not folder.is_dir():
        raise ConfigError(f"package {name}: got {folder}; expected an existing folder")
    return folder

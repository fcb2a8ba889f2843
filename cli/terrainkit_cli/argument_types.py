"""Types of arguments that several commands share."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from msgspec import Meta

from terrainkit.errors import ConfigError
from terrainkit_cli.parse import option, positional, value_of

if TYPE_CHECKING:
    from terrainkit_robots.lint.settings import Settings

MapFile = Annotated[Path, positional("MAP.npz")]
InputPath = Annotated[Path, option("PATH")]
OutputPath = Annotated[Path, option("PATH", "-o")]
Jobs = Annotated[int, Meta(ge=1, le=61), option("N")]
"""Number of processes, at most as many as a `ProcessPoolExecutor` may have on Windows."""

RobotName = Annotated[str, option("ROBOT")]
Limits = Annotated[tuple[str, ...], option("[NAME=VALUE ...]")]
"""Limits of a robot for feasibility."""

IgnoredRules = Annotated[tuple[str, ...], option("CODES=REASON", is_repeated=True)]
Packages = Annotated[tuple[str, ...], option("NAME=DIR", is_repeated=True)]
XacroArguments = Annotated[tuple[str, ...], option("NAME:=VALUE", is_repeated=True)]
Feet = Annotated[tuple[str, ...], option("LINKS", is_repeated=True)]

TerrainName = Annotated[str, option("TERRAIN")]
Device = Annotated[str, option("DEVICE")]
Checkpoint = Annotated[int, option("ITERATION")]
"""Iteration of a checkpoint."""

TaskFile = Annotated[Path, option("FILE.py")]
"""A Python file that registers a task."""

OptionalFlag = Annotated[bool, option("")]
"""A flag whose default is None: a settings file may state the value."""


def is_map(path: str | Path) -> bool:
    """Return whether a path names a map: its suffix is .npz in any case."""
    return Path(path).suffix.lower() == ".npz"


def split_commas(text: str) -> list[str]:
    """Return the comma-separated words of a text."""
    return [word.strip() for word in text.split(",") if word.strip()]


def parse_settings(
    ignore: Sequence[str],
    package: Sequence[str],
    xacro_arg: Sequence[str],
    feet: Sequence[str] = (),
) -> "Settings":
    """Return the settings of the options --ignore, --package, --xacro-arg and --feet.

    Raises:
        ConfigError: if a text has another format, or names no rule or folder.
    """
    from terrainkit_robots.lint.settings import Settings, package_folder

    ignored = parse_pairs("--ignore", ignore, "=", "CODES=REASON")
    folders = parse_pairs("--package", package, "=", "NAME=DIR")
    return Settings(
        ignore={code: reason for codes, reason in ignored.items() for code in split_commas(codes)},
        packages={name: package_folder(name, Path(folder)) for name, folder in folders.items()},
        xacro_arguments=parse_pairs("--xacro-arg", xacro_arg, ":=", "NAME:=VALUE"),
        feet=tuple(name for names in feet for name in split_commas(names)),
    )


def parse_pairs(option: str, texts: Sequence[str], sep: str, expected: str) -> dict[str, str]:
    """Return the values of an option that assigns values to names.

    Args:
        option: Name of the option.
        texts: Its values.
        sep: Text between a name and a value.
        expected: The expected format, for error messages.

    Raises:
        ConfigError: if a text has another format, or a name is repeated.
    """
    pairs: dict[str, str] = {}
    for text in texts:
        name, found, value = (part.strip() for part in text.partition(sep))
        if not name or not found or not (value or sep == ":="):
            raise ConfigError(f"{option}: got {text!r}; expected {expected}")
        if name in pairs:
            raise ConfigError(f"{option}: got {name} twice; expected each name once")
        pairs[name] = value
    return pairs


def parse_range(option: str, text: str, example: str) -> tuple[float, float]:
    """Return the numbers of an option LOW:HIGH.

    Args:
        option: Name of the option.
        text: Its value.
        example: A valid value, for error messages.

    Raises:
        ConfigError: if the text has another format.
    """
    ends: Any = tuple(value_of(end) for end in text.split(":"))
    if len(ends) != 2 or not all(type(end) in (int, float) for end in ends):
        raise ConfigError(f"{option}: got {text!r}; expected LOW:HIGH, such as {example}")
    return ends[0], ends[1]

"""Options that several commands share."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from terrainkit.errors import ConfigError
from terrainkit.settings.text import expected_names

if TYPE_CHECKING:
    from terrainkit_robots.lint.settings import Settings

    StringList = list[str]
else:
    # For list[str], or a tuple, tyro imports typeguard, which takes a quarter of the time of
    # check-robot.
    StringList = list


def repeated_option(metavar: str) -> tuple[object, ...]:
    """Return the annotations of an option that can be repeated."""
    hint = "(may be repeated)"
    return tyro.conf.UseAppendAction, tyro.conf.arg(metavar=metavar, help_behavior_hint=hint)


def text_option(metavar: str, *aliases: str) -> object:
    """Return the annotation of a text option whose default is an empty text."""
    return tyro.conf.arg(metavar=metavar, aliases=list(aliases), help_behavior_hint="")


IgnoredRules = Annotated[StringList, *repeated_option("CODES=REASON")]
Packages = Annotated[StringList, *repeated_option("NAME=DIR")]
XacroArguments = Annotated[StringList, *repeated_option("NAME:=VALUE")]
InputPath = Annotated[str, text_option("PATH")]
Output = Annotated[str, text_option("PATH", "-o")]

Flag = Annotated[bool, tyro.conf.arg(help_behavior_hint=lambda text: f"(default: {text.lower()})")]
"""An option --x or --no-x."""

RobotName = Annotated[str, text_option("ROBOT")]
LimitWords = Annotated[StringList, tyro.conf.arg(metavar="NAME=VALUE", help_behavior_hint="")]
"""Limits of a robot for feasibility."""

UNSET = -1
"""Default of optional numbers; with None, tyro would print the types of a union in errors."""

Checkpoint = Annotated[
    int, tyro.conf.arg(metavar="ITERATION", help_behavior_hint="(default: the last)")
]
"""Iteration of a checkpoint; the default is UNSET."""


def optional_number(number: int) -> int | None:
    """Return the value of a numeric option, or None if it is UNSET."""
    return None if number == UNSET else number


def find_robot(name: str) -> Path:
    """Return the path of a robot file, or of a bundled robot.

    Raises:
        ConfigError: if neither exists, or the file cannot be accessed.
    """
    from terrainkit_robots.description import bundled

    path = Path(name)
    try:
        if path.is_file():
            return path
        bundled_path = bundled.urdf_path(name)
        if bundled_path is None and not path.exists():
            expected = expected_names(name, bundled.robot_names(), "bundled robots are")
            raise ConfigError(f"robot file: got {name}, which does not exist; {expected}")
    except OSError as error:
        raise ConfigError(f"cannot read {name}: {error.strerror or error}") from error
    return bundled_path or path


def split_commas(text: str) -> list[str]:
    """Return the comma-separated words of a text."""
    return [word.strip() for word in text.split(",") if word.strip()]


def parse_settings(
    ignore: Sequence[str], package: Sequence[str], xacro_arg: Sequence[str]
) -> "Settings":
    """Return the settings of the options --ignore, --package and --xacro-arg.

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

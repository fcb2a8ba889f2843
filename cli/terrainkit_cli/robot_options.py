"""Options that the commands for robots share."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from terrainkit.errors import ConfigError

if TYPE_CHECKING:
    Words = list[str]
else:
    # tyro would look at list[str] through typeguard, whose import takes a quarter of the time of a
    # whole `terrainkit check-robot`.
    Words = list


def repeated(metavar: str) -> tuple[object, ...]:
    """Return the markers of an option that may be given several times."""
    hint = "(may be repeated)"
    return tyro.conf.UseAppendAction, tyro.conf.arg(metavar=metavar, help_behavior_hint=hint)


def plain(metavar: str, *aliases: str) -> object:
    """Return the marker of an option that is a text, and empty unless given."""
    return tyro.conf.arg(metavar=metavar, aliases=list(aliases), help_behavior_hint="")


Packages = Annotated[Words, *repeated("NAME=DIR")]
XacroArguments = Annotated[Words, *repeated("NAME:=VALUE")]
Text = Annotated[str, plain("PATH")]
Output = Annotated[str, plain("PATH", "-o")]

NO_NUMBER = -1
"""No number was given; not None, since tyro's errors about a union name its members."""

Checkpoint = Annotated[
    int, tyro.conf.arg(metavar="ITERATION", help_behavior_hint="(default: the last)")
]
"""A checkpoint of a run, `NO_NUMBER` unless given."""


def number_given(number: int) -> int | None:
    """Return what an option was given; None for nothing."""
    return None if number == NO_NUMBER else number


def find_robot(name: str) -> Path:
    """Return the file of that name, or else the bundled robot."""
    from terrainkit.text import expected_names
    from terrainkit_robots.description import bundled

    path = Path(name)
    try:
        if path.is_file():
            return path
        found = bundled.find(name)
        if found is None and not path.exists():
            raise ConfigError(
                f"no file or bundled robot {name!r}; "
                f"{expected_names(name, bundled.names(), 'bundled robots are')}"
            )
    except OSError as error:
        raise ConfigError(f"cannot read {name}: {error.strerror or error}") from error
    return found or path


def split_names(text: str) -> list[str]:
    """Return the names between commas."""
    return [word.strip() for word in text.split(",") if word.strip()]


def ignored_rules(args: Sequence[str]) -> dict[str, str]:
    """Return the reason for each ignored rule of --ignore CODES=REASON."""
    found = pairs("--ignore", args, "=", "CODES=REASON")
    return {code: reason for codes, reason in found.items() for code in split_names(codes)}


def pairs(option: str, args: Sequence[str], separator: str, expected: str) -> dict[str, str]:
    """Return the values of NAME=VALUE arguments by name.

    Raises:
        ConfigError: if an argument has another form, or a name occurs twice.
    """
    found_pairs: dict[str, str] = {}
    for arg in args:
        name, found, value = (part.strip() for part in arg.partition(separator))
        if not name or not found or not (value or separator == ":="):
            raise ConfigError(f"{option}: got {arg!r}; expected {expected}")
        if name in found_pairs:
            raise ConfigError(f"{option}: got {name} twice; expected it once")
        found_pairs[name] = value
    return found_pairs


def packages(args: Sequence[str]) -> dict[str, Path]:
    """Return the folder of each package of --package NAME=DIR."""
    from terrainkit_robots.lint.settings import package_folder

    found = pairs("--package", args, "=", "NAME=DIR")
    return {name: package_folder(name, Path(folder)) for name, folder in found.items()}


def xacro_arguments(args: Sequence[str]) -> dict[str, str]:
    """Return the value of each argument of --xacro-arg NAME:=VALUE."""
    return pairs("--xacro-arg", args, ":=", "NAME:=VALUE")

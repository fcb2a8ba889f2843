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
    from terrainkit_robots.description import bundled

    path = Path(name)
    try:
        if path.is_file():
            return path
        found = bundled.find(name)
        if found is None and not path.exists():
            raise ConfigError(
                f"there is no file {name}, nor is a bundled robot called so; "
                f"there are: {', '.join(bundled.names())}"
            )
    except OSError as error:
        raise ConfigError(f"cannot read {name}: {error.strerror or error}") from error
    return found or path


def listed(words: str) -> list[str]:
    """Return the words between commas."""
    return [word.strip() for word in words.split(",") if word.strip()]


def reasons(words: Sequence[str]) -> dict[str, str]:
    """Return the reason for each rule that is not asked."""
    found = pairs("--ignore", words, "=", "CODES=REASON")
    return {code: reason for codes, reason in found.items() for code in listed(codes)}


def pairs(option: str, words: Sequence[str], sign: str, wanted: str) -> dict[str, str]:
    """Return names and their values, as NAME=VALUE writes them.

    Raises:
        ConfigError: if one is written otherwise, or twice.
    """
    found_pairs: dict[str, str] = {}
    for word in words:
        name, found, value = (part.strip() for part in word.partition(sign))
        if not name or not found or not (value or sign == ":="):
            raise ConfigError(f"{option} {word!r}; wanted {wanted}")
        if name in found_pairs:
            raise ConfigError(f"{option} has {name} twice; wanted it once")
        found_pairs[name] = value
    return found_pairs


def packages(words: Sequence[str]) -> dict[str, Path]:
    """Return the folder of each package, as NAME=DIR writes them."""
    from terrainkit_robots.lint.settings import package_folder

    found = pairs("--package", words, "=", "NAME=DIR")
    return {name: package_folder(name, Path(folder)) for name, folder in found.items()}


def xacro_arguments(words: Sequence[str]) -> dict[str, str]:
    """Return the value of each xacro argument, as NAME:=VALUE writes them."""
    return pairs("--xacro-arg", words, ":=", "NAME:=VALUE")

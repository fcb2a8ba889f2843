"""Command-line arguments to a command: a frozen dataclass whose docstrings are its help."""

import contextlib
import dataclasses
import io
import re
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar, get_type_hints

from terrainkit.errors import TerrainkitError
from terrainkit.text import closest, expected_names, truncate

if TYPE_CHECKING:
    from typing import Self


@dataclass(frozen=True, kw_only=True)
class Command(ABC):
    """A command of `terrainkit`: its fields are the options."""

    arguments: ClassVar[tuple[str, ...]] = ()
    """The words on the command line."""

    @classmethod
    def options(cls, arguments: Sequence[str]) -> "type[Self]":
        """Return the command with all its options, which may depend on the arguments.

        Raises:
            UsageError: if an option is unknown.
        """
        check_options(cls, arguments)
        return type(cls.__name__, (cls,), {"arguments": tuple(arguments), "__doc__": cls.__doc__})

    def flag(self, name: str) -> bool | None:
        """Return the value of a flag; None if it is not on the command line."""
        option = name.replace("_", "-")
        given = {word.replace("_", "-") for word in self.arguments}
        is_given = given & {f"--{option}", f"--no-{option}"}
        return bool(getattr(self, name)) if is_given else None

    @abstractmethod
    def run(self) -> int:
        """Run the command, and return the exit code."""


class UsageError(TerrainkitError):
    """An invalid command line."""


_Command = TypeVar("_Command", bound=Command)


def parse(command: type[_Command], prog: str, arguments: list[str]) -> _Command:
    """Return the `command` that `arguments` describe; `--help` prints its help and exits.

    Raises:
        UsageError: if an option is unknown, missing, or has an invalid value.
    """
    import tyro

    stderr = io.StringIO()
    try:
        with contextlib.redirect_stderr(stderr):
            return tyro.cli(command, prog=prog, args=arguments)
    except SystemExit as end:
        if end.code in (0, None):
            raise
        raise UsageError(f"{_one_line(stderr.getvalue())}; see {prog} --help") from None


def value_of(word: str) -> str | float | bool | None:
    """Return the value of a word: a number, true, false, none, or the word itself."""
    constants = {"true": True, "false": False, "none": None}
    if word.lower() in constants:
        return constants[word.lower()]
    for kind in (int, float):
        with contextlib.suppress(ValueError):
            return kind(word)
    return word


def word_after(option: str, arguments: Sequence[str]) -> str:
    """Return the word after an option, also in `--option=word`; empty if it is not given."""
    for word, following in pairwise([*arguments, ""]):
        name, equals, value = word.partition("=")
        if name == option:
            return value if equals else following
    return ""


def option_names(command: type[Any], prefix: str = "", *, flags_only: bool = False) -> list[str]:
    """Return the options of a dataclass that tyro parses, those of nested dataclasses included."""
    options = []
    for name, hint in get_type_hints(command, include_extras=True).items():
        markers = [each for each in getattr(hint, "__metadata__", ()) if hasattr(each, "aliases")]
        kind = getattr(hint, "__origin__", hint)
        named = next((each.name for each in markers if each.name is not None), name)
        if dataclasses.is_dataclass(kind):
            inner = f"{prefix}{named}." if named else prefix
            options += option_names(kind, inner, flags_only=flags_only)  # type: ignore[arg-type]
        elif kind is bool or not flags_only:
            options.append(f"--{prefix}{named}")
            options += [f"--{prefix}no-{named}"] * (kind is bool)
            options += [alias for each in markers for alias in each.aliases or ()]
    return [option.replace("_", "-") for option in options]


def check_options(command: type[Command], arguments: Sequence[str]) -> None:
    """Raise UsageError if an option is unknown, on one line; tyro's message fills a page."""
    known = [*option_names(command), "--help"]
    for word in arguments:
        name = word.partition("=")[0]
        if name.startswith("--") and name.replace("_", "-") not in known:
            near = closest(name.replace("_", "-"), known)
            meant = f"; did you mean {near}?" if near else ""
            raise UsageError(f"no option {truncate(name)}{meant}; --help lists the options")


def _one_line(box: str) -> str:
    """Return the text in tyro's box as one line, without its title and its closing advice."""
    # A terminal that is not UTF-8 gets a box of other characters.
    rows = [row.strip("│| ") for row in box.splitlines()[1:]]
    parts = " ".join(row if row.strip("─╰╯+- ") else "\n" for row in rows).split("\n")
    texts = [part.strip() for part in parts]
    texts = [text for text in texts if text and not text.startswith(("For full", "Argument help"))]
    text = re.sub(r"^Error parsing (\S+): (?=\1: )", "", ". ".join(texts))
    choice = re.fullmatch(
        r"invalid choice '(.*)' for argument '(.*)'\. Expected one of \((.*)\)\.?", text
    )
    if choice is None:
        return text
    got, option, expected = choice.groups()
    names = [name for name in re.findall(r"'([^']*)'", expected) if name != "None"]
    return f"{option}: got {got!r}; {expected_names(got, names, 'expected one of')}"

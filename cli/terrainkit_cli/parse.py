"""Arguments: from words to a command, a frozen dataclass whose docstrings are its help."""

import contextlib
import io
import re
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

from terrainkit.errors import TerrainkitError

if TYPE_CHECKING:
    from typing import Self


@dataclass(frozen=True, kw_only=True)
class Command(ABC):
    """A command of `terrainkit`: its fields are the options."""

    @classmethod
    def options(cls, arguments: Sequence[str]) -> "type[Self]":  # noqa: ARG003
        """Return the command with all its options, which may depend on what is given."""
        return cls

    @abstractmethod
    def run(self) -> int:
        """Do the work, and return the exit code."""


class UsageError(TerrainkitError):
    """An invalid command line."""


_Command = TypeVar("_Command", bound=Command)


def parse(command: type[_Command], program: str, arguments: list[str]) -> _Command:
    """Return the `command` that `arguments` describe; `--help` prints its help and exits.

    Raises:
        UsageError: if an option is unknown, missing, or holds what it cannot.
    """
    import tyro

    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            # Flags without a negative: none of ours is on unless given.
            markers = (tyro.conf.FlagCreatePairsOff,)
            return tyro.cli(command, prog=program, args=arguments, config=markers)
    except SystemExit as end:
        if end.code in (0, None):
            raise
        raise UsageError(f"{_one_line(said.getvalue())}; see {program} --help") from None


def value_of(word: str) -> str | float | bool | None:
    """Return the value that `word` writes: a number, true, false, none, or the word itself."""
    constants = {"true": True, "false": False, "none": None}
    if word.lower() in constants:
        return constants[word.lower()]
    for kind in (int, float):
        with contextlib.suppress(ValueError):
            return kind(word)
    return word


def _one_line(box: str) -> str:
    """Return what tyro's box says as one line, without its title and its closing advice."""
    # A terminal that is not UTF-8 gets a box of other characters.
    rows = [row.strip("│| ") for row in box.splitlines()[1:]]
    parts = " ".join(row if row.strip("─╰╯+- ") else "\n" for row in rows).split("\n")
    told = [part.strip() for part in parts]
    told = [part for part in told if part and not part.startswith(("For full", "Argument help"))]
    return re.sub(r"^Error parsing (\S+): (?=\1: )", "", ". ".join(told))

"""Arguments: from words to a command, a frozen dataclass whose docstrings are its help."""

import contextlib
import io
import re
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Self, TypeVar

from terrainkit.errors import TerrainkitError


@dataclass(frozen=True, kw_only=True)
class Command(ABC):
    """A command of `terrainkit`: its fields are the options."""

    @classmethod
    def defaults(cls, arguments: list[str]) -> Self | None:  # noqa: ARG003
        """Return the command to take defaults from; a command that reads a file may look there."""
        return None

    @abstractmethod
    def run(self) -> int:
        """Do the work, and return the exit code."""


class UsageError(TerrainkitError):
    """Words that are no command."""


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
            default = command.defaults(arguments) or tyro.MISSING_NONPROP
            return tyro.cli(command, prog=program, args=arguments, default=default)
    except SystemExit as end:
        if end.code in (0, None):
            raise
        raise UsageError(f"{_one_line(said.getvalue())}; see {program} --help") from None


def _one_line(box: str) -> str:
    """Return what tyro's box says as one line, without its title and its closing advice."""
    rows = [row.strip("│ ") for row in box.splitlines() if row.startswith("│")]
    parts = " ".join(rows).split(" ─")
    told = [part.strip("─ ") for part in parts]
    told = [part for part in told if part and not part.startswith(("For full", "Argument help"))]
    return re.sub(r"^Error parsing map: ", "", ". ".join(told))

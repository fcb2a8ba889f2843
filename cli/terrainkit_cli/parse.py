"""Parse command-line arguments into a command, a dataclass whose docstrings are its help."""

import contextlib
import dataclasses
import inspect
import io
import re
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar, get_type_hints

from terrainkit.errors import TerrainkitError
from terrainkit.settings.field_docs import field_docs
from terrainkit.settings.text import closest, expected_names, truncate
from terrainkit_cli import render

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

    # tyro would keep some line breaks of docstrings.
    paragraphs = (inspect.getdoc(command) or "").split("\n\n")
    description = "\n\n".join(" ".join(paragraph.split()) for paragraph in paragraphs)
    if {"-h", "--help"} & set(arguments):
        docs = field_docs(command)
        for field in dataclasses.fields(command):
            field.metadata = MappingProxyType({"help": docs.get(field.name, "")})
    stdout, stderr = io.TextIOWrapper(io.BytesIO(), sys.stdout.encoding), io.StringIO()
    stdout.isatty = sys.stdout.isatty  # type: ignore[method-assign]  # for colors
    try:
        with contextlib.redirect_stdout(stdout), contextlib.redirect_stderr(stderr):
            return tyro.cli(command, prog=prog, description=description, args=arguments)
    except SystemExit as end:
        if end.code in (0, None):
            stdout.seek(0)
            render.help_page(stdout.read())
            sys.stdout.flush()
            raise
        raise UsageError(f"{_error_message(stderr.getvalue())}; see {prog} --help") from None


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
    """Raise UsageError if an option is unknown; tyro's message fills a page."""
    known = [*option_names(command), "--help"]
    for word in arguments:
        name = word.partition("=")[0]
        if name.startswith("--") and name.replace("_", "-") not in known:
            near = closest(name.replace("_", "-"), known)
            hint = f"did you mean {near}?" if near else "--help lists the options"
            raise UsageError(f"no option {truncate(name)}; {hint}")


def _error_message(box: str) -> str:
    """Return the message in a box of tyro on one line, worded like the other errors."""
    # A terminal that is not UTF-8 gets a box of other characters.
    rows = [row.strip("│| ") for row in box.splitlines()[1:]]
    parts = " ".join(row if row.strip("─╰╯+- ") else "\n" for row in rows).split("\n")
    texts = [part.strip() for part in parts]
    texts = [text for text in texts if text and not text.startswith(("For full", "Argument help"))]
    text = re.sub(r"^Error parsing (\S+): (?=\1: )", "", ". ".join(texts))
    for pattern, message in _MESSAGES.items():
        if match := re.match(pattern, text):
            return message(*match.groups())
    return text


def _choice_message(value: str, option: str, choices: str) -> str:
    names = [name for name in re.findall(r"'([^']*)'", choices) if name != "None"]
    return f"{option}: got {value!r}; {expected_names(value, names, 'expected one of')}"


_MESSAGES: dict[str, Callable[..., str]] = {
    r"invalid choice '(.*)' for argument '(.*)'\. Expected one of \((.*)\)": _choice_message,
    r"Missing value for argument '(.*)'\. Expected (\d+)": "{}: too few values; expected {}".format,
    r"Missing from [\w -]+: (?:-\w \S+, )?(\S+)": "{}: missing".format,
    r"Error parsing (\S+): Could not parse arguments \[(.*?)\] .*\[(.*)\]": (
        "{}: got {}; expected {}".format
    ),
    r"Error parsing (\S+): invalid literal for int\(\) .*: (.*)": (
        "{}: got {}; expected an integer".format
    ),
    r"Error parsing (\S+): could not convert string to float: (.*)": (
        "{}: got {}; expected a number".format
    ),
    r"Unrecognized options: (-.*)": "no option {}".format,
    r"Unrecognized options: (.*)": "got {}; expected no more arguments".format,
}
"""Patterns of tyro's errors, and functions that return the message for their groups."""

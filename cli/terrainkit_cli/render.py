"""Print results on stdout, and everything else on stderr."""

import io
import os
import re
import shlex
import shutil
import sys
import textwrap
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, TextIO, TypeVar

if TYPE_CHECKING:
    from rich.status import Status

    from terrainkit_robots.lint.report.text_report import Span

_T = TypeVar("_T")

_CONTROL = re.compile("[\\0-\\x08\\x0b-\\x1f\\x7f-\\x9f\\u202a-\\u202e\\u2066-\\u2069]")
"""Control characters besides tab and newline, and marks of the writing direction."""

_ARGUMENT = re.compile(r"`(\w+)=([^`]+)`")
"""A Python argument in a message, such as `scale=0.01` or `origin=(0, 0, 0)`."""

BAR_DELAY = 0.5
"""Time after which a progress bar appears [s]."""

LINE_INTERVAL = 10.0
"""Least time between two steps of a command that are printed as lines [s]."""


def result(text: str) -> None:
    """Print a result."""
    _print(_relative_paths(text))


def table(rows: Sequence[Sequence[str]]) -> None:
    """Print rows of text as columns, each as wide as its widest cell."""
    widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        _print("  ".join(cells).rstrip())


def help_page(text: str) -> None:
    """Print a help page; argparse does not wrap long names of options."""
    for line in text.splitlines():
        _print(textwrap.fill(line, width(), subsequent_indent="    ") if line else "")


def report(text: str) -> None:
    """Print a text that ends with a newline; characters unknown to the terminal are escaped."""
    _escape_unknown()
    _print(text, end="")


def _print(text: str, end: str = "\n") -> None:
    """Print on stdout; once the reader is gone, as in `| head -1`, the command still does the rest.

    What is left may be writing its files.
    """
    try:
        print(_escape_control(text), end=end)
    except BrokenPipeError:
        drop_stdout()


def print_lines(lines: "Iterator[tuple[Span, ...]]") -> None:
    """Print lines whose spans have styles, in color."""
    from rich.console import Console
    from rich.text import Text

    _escape_unknown()
    console = Console(highlight=False, soft_wrap=True)
    for line in lines:
        console.print(Text.assemble(*((span.text, span.style) for span in line)))


def has_colors() -> bool:
    """Return whether stdout is a terminal with colors."""
    return sys.stdout.isatty() and os.environ.get("TERM") != "dumb" and "NO_COLOR" not in os.environ


def width() -> int:
    """Return the width of a report: the width of the terminal, from 60 to 120 columns."""
    return min(max(shutil.get_terminal_size().columns, 60), 120)


def note(message: str) -> None:
    """Print a remark on stderr."""
    _print_message(message)


def error(message: str) -> None:
    """Print an error on stderr, as one line."""
    _print_message(f"error: {' '.join(message.split())}")


def _print_message(message: str) -> None:
    with suppress(OSError):  # such as from a closed terminal
        text = _ARGUMENT.sub(_option, _escape_control(_relative_paths(message)))
        print(f"terrainkit: {text}", file=sys.stderr, flush=True)


def _option(argument: re.Match[str]) -> str:
    """Return the option of the command line for a Python argument: --scale 0.01."""
    name, value = argument[1].replace("_", "-"), argument[2]
    if value.startswith("("):
        value = value.strip("()").replace(",", "")
    elif value.startswith("'"):
        value = value.strip("'")
    else:
        value = shlex.quote(value)
    return {"True": f"--{name}", "False": f"--no-{name}"}.get(value, f"--{name} {value}")


def _relative_paths(text: str) -> str:
    """Return a text in which paths below the working directory are relative to it."""
    try:
        folder = re.escape(str(Path.cwd()))
    except OSError:  # it has been removed
        return text
    return re.sub(rf"(?<![\w./~-]){folder}/(?=[\w.])", "", text)


def _escape_control(text: str) -> str:
    """Return a text without what a terminal interprets; names in files of strangers may have it."""
    return _CONTROL.sub(lambda match: ascii(match[0])[1:-1], text)


def _escape_unknown() -> None:
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")


def show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,  # noqa: ARG001 - an argument of `warnings.showwarning`
    line: str | None = None,  # noqa: ARG001
) -> None:
    """Print a warning as one line; replaces `warnings.showwarning`."""
    from terrainkit.errors import TerrainkitWarning

    text = " ".join(str(message).split())
    if not issubclass(category, TerrainkitWarning):
        text = f"{filename}:{lineno}: {category.__name__}: {text}"
    _print_message(f"warning: {text}")


def progress(items: Iterable[_T], total: int, *, of: str = "patches") -> Iterator[_T]:
    """Return `items`, with a progress bar on stderr if that is a terminal and they take long."""
    items = iter(items)
    has_bar = sys.stderr.isatty() and find_spec("rich") is not None
    return _with_delayed_bar(items, total, of) if has_bar else items


def _with_delayed_bar(items: Iterator[_T], total: int, of: str) -> Iterator[_T]:
    start = time.monotonic()
    completed = 0
    for item in items:
        yield item
        completed += 1
        if time.monotonic() - start > BAR_DELAY:
            break
    else:
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(of, total=total, completed=completed)
        for item in items:
            yield item
            bar.advance(task)


class Steps:
    """Shows the current step of a command on stderr; in a file, as a line from time to time."""

    def __init__(self, status: "Status | None") -> None:
        self._status = status
        self._print_time = time.monotonic()

    def update(self, step: str) -> None:
        """Show a step."""
        if self._status is not None:
            self._status.update(step)
        elif time.monotonic() - self._print_time >= LINE_INTERVAL:
            note(step)
            self._print_time = time.monotonic()

    def stop(self) -> None:
        """Show no step any more."""
        if self._status is not None:
            self._status.stop()

    def bar(self, items: Iterable[_T], total: int, *, of: str) -> Iterator[_T]:
        """Yield `items`, with a progress bar in place of the step."""
        if self._status is None:
            yield from items
            return
        self._status.stop()  # a terminal shows either a status or a bar
        yield from progress(items, total, of=of)
        self._status.start()


@contextmanager
def steps() -> Iterator[Steps]:
    """Yield an object that shows the steps of a command."""
    if not sys.stderr.isatty() or find_spec("rich") is None:
        yield Steps(None)
        return
    from rich.console import Console

    with Console(stderr=True).status("reading") as status:
        yield Steps(status)


def drop_stdout() -> None:
    """Discard further output, so that no error is printed at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())

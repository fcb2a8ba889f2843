"""Printing: results on stdout, everything else on stderr."""

import os
import sys
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TextIO

_PATIENCE = 0.5
"""How long a walk may take before it shows a progress bar [s]."""


def result(text: str) -> None:
    """Print a result."""
    print(text)


def table(rows: Sequence[Sequence[str]]) -> None:
    """Print rows of text as columns, each as wide as its widest cell."""
    widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        print("  ".join(cells).rstrip())


def overview(commands: Mapping[str, str]) -> None:
    """Print what commands there are, with the first line of the help of each."""
    print("usage: terrainkit COMMAND ...\n")
    print("Terrain for legged robots: curriculum heightfields, trimeshes and spawn origins.\n")
    table([(f"  {name}", text.partition("\n")[0]) for name, text in commands.items()])
    print("\nterrainkit COMMAND --help says more; terrainkit --version says which this is.")


def error(message: str) -> None:
    """Print an error, as one line."""
    print(f"terrainkit: error: {' '.join(message.split())}", file=sys.stderr)


def show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Print a warning, as one line; stands in for `warnings.showwarning`."""
    from terrainkit.errors import TerrainkitWarning

    if issubclass(category, TerrainkitWarning):
        print(f"terrainkit: warning: {message}", file=sys.stderr)
    else:
        text = warnings.formatwarning(message, category, filename, lineno, line)
        print(text, end="", file=file or sys.stderr)


def progress(walk: Iterator[Any], total: int) -> Iterator[Any]:
    """Return `walk` with a bar on stderr, if that is a terminal and the walk takes long."""
    return _with_bar_when_slow(walk, total) if sys.stderr.isatty() else walk


def _with_bar_when_slow(walk: Iterator[Any], total: int) -> Iterator[Any]:
    start = time.monotonic()
    done = 0
    for item in walk:
        yield item
        done += 1
        if time.monotonic() - start > _PATIENCE:
            break
    else:
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("patches", total=total, completed=done)
        for item in walk:
            yield item
            bar.advance(task)


def drop_stdout() -> None:
    """Let the interpreter close stdout in peace once its reader has gone."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())

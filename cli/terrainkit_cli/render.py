"""Printing: results on stdout, everything else on stderr."""

import io
import os
import shutil
import sys
import time
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, TextIO, TypeVar

if TYPE_CHECKING:
    from rich.status import Status
    from rich.table import Table

    from terrainkit_robots.lint.report.text import Span
    from terrainkit_robots.rl.runner import ProgressCallback, TrainingProgress

_T = TypeVar("_T")

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
    print("For legged robots: terrain to train on, and checks of the robot before it is trained.\n")
    table([(f"  {name}", text.partition("\n")[0]) for name, text in commands.items()])
    print("\nterrainkit COMMAND --help says more; terrainkit --version says which this is.")


def report(text: str) -> None:
    """Print a text that ends its lines itself; what the terminal cannot write is escaped."""
    _escape_unknown()
    print(text, end="")


def styled(lines: "Iterator[tuple[Span, ...]]") -> None:
    """Print lines whose spans have styles, in color."""
    from rich.console import Console
    from rich.text import Text

    _escape_unknown()
    console = Console(highlight=False, soft_wrap=True)
    for line in lines:
        console.print(Text.assemble(*((span.text, span.style) for span in line)))


def has_colors() -> bool:
    """Whether the results are read on a terminal that has colors."""
    return sys.stdout.isatty() and os.environ.get("TERM") != "dumb" and "NO_COLOR" not in os.environ


def width() -> int:
    """Return how wide the text of a report is to be: as the terminal, and neither tiny nor huge."""
    return min(max(shutil.get_terminal_size().columns, 60), 120)


def note(message: str) -> None:
    """Print a remark beside the result."""
    print(f"terrainkit: {message}", file=sys.stderr)


def _escape_unknown() -> None:
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")


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


def progress(walk: Iterable[_T], total: int, *, of: str = "patches") -> Iterator[_T]:
    """Return `walk` with a bar on stderr, if that is a terminal and the walk takes long."""
    steps = iter(walk)
    return _with_bar_when_slow(steps, total, of) if sys.stderr.isatty() else steps


def _with_bar_when_slow(walk: Iterator[_T], total: int, of: str) -> Iterator[_T]:
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
        task = bar.add_task(of, total=total, completed=done)
        for item in walk:
            yield item
            bar.advance(task)


class Steps:
    """What is done next, shown on stderr while it is done, if that is a terminal."""

    def __init__(self, status: "Status | None") -> None:
        self._status = status

    def say(self, step: str) -> None:
        """Show a step."""
        if self._status is not None:
            self._status.update(step)

    def bar(self, walk: Iterable[_T], total: int, *, of: str) -> Iterator[_T]:
        """Yield what `walk` does, with a bar in the place of the step."""
        if self._status is None:
            yield from walk
            return
        self._status.stop()  # only one thing at a time can move on a terminal
        yield from progress(walk, total, of=of)
        self._status.start()


@contextmanager
def steps() -> Iterator[Steps]:
    """Yield what shows the steps of a work."""
    if not sys.stderr.isatty():
        yield Steps(None)
        return
    from rich.console import Console

    with Console(stderr=True).status("reading") as status:
        yield Steps(status)


def drop_stdout() -> None:
    """Let the interpreter close stdout in peace once its reader has gone."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


_LINE_EVERY, _TERMS_EVERY = 10, 50
"""Iterations of training between lines, where there is no terminal to show each on: of how it goes,
and of what robots succeed in and are rewarded for."""


@contextmanager
def training() -> "Iterator[ProgressCallback]":
    """Yield what shows the progress of training on stderr: live, or as a line now and then."""
    if not sys.stderr.isatty():
        yield _training_line
        return
    from rich.console import Console
    from rich.live import Live

    with Live(console=Console(stderr=True), auto_refresh=False) as live:
        yield lambda progress: live.update(_training_table(progress), refresh=True)


def _training_line(progress: "TrainingProgress") -> None:
    done = progress.iteration
    if done % _LINE_EVERY and done != progress.max_iterations:
        return
    facts = ", ".join(f"{name} {value}" for name, value in _training_facts(progress))
    print(f"iteration {done}/{progress.max_iterations}: {facts}", file=sys.stderr, flush=True)
    if done % _TERMS_EVERY and done != progress.max_iterations:
        return
    terms = [f"success {name} {rate:.0%}" for name, rate in progress.success.items()]
    terms += [f"{name} {reward:+.3f} /s" for name, reward in progress.rewards.items()]
    if terms:
        told = ", ".join(terms)
        print(f"iteration {done}/{progress.max_iterations}: {told}", file=sys.stderr, flush=True)


def _training_facts(progress: "TrainingProgress") -> list[tuple[str, str]]:
    """Return what is said of training in both ways."""
    facts = [
        ("env steps/s", f"{progress.steps_per_second:.0f}"),
        ("to go", _clock(progress.eta)),
        ("noise std", f"{progress.noise_std:.2f}"),
    ]
    if progress.reward is not None and progress.episode_length is not None:
        facts.insert(2, ("reward", f"{progress.reward:.2f}"))
        facts.insert(3, ("episode", f"{progress.episode_length:.1f} s"))
    return facts + [(f"level {name}", f"{level:.1f}") for name, level in progress.levels.items()]


def _training_table(progress: "TrainingProgress") -> "Table":
    from rich.table import Table

    title = f"iteration {progress.iteration}/{progress.max_iterations}"
    where = None if progress.folder is None else str(progress.folder)
    table = Table(title=title, caption=where, show_header=False, title_justify="left")
    table.add_column()
    table.add_column(justify="right")
    for name, value in _training_facts(progress):
        rate = progress.success.get(name.removeprefix("level "))
        reached = "" if rate is None or not name.startswith("level ") else f"  {rate:.0%} succeed"
        table.add_row(name, value + reached)
    table.add_row("time learning", f"{progress.learning_fraction:.0%}")
    table.add_section()
    for name, reward in progress.rewards.items():
        table.add_row(name, f"{reward:+.3f} /s")
    return table


def _clock(seconds: float) -> str:
    """Return a time such as 1:02:03."""
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{rest:02}"

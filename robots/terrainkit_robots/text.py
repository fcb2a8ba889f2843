"""Text of messages: names from files, counts and paths."""

from collections.abc import Container, Iterable
from pathlib import Path

from terrainkit.text import closest
from terrainkit.text import truncate as short

__all__ = ["closest", "count", "display_path", "free_name", "names", "one_line", "short"]


def names(words: Iterable[str], most: int = 6, separator: str = ", ") -> str:
    """Return words as `a, b, c`, and of more than `most` the first: `a, b, c, ...`."""
    listed = list(words)
    shown = [short(word) for word in listed[:most]]
    return separator.join(shown + ["..."] * (len(listed) > most))


def count(number: int, word: str) -> str:
    """Return such as `1 leg` or `4 legs`."""
    return f"{number:,} {word}{'' if number == 1 else 's'}"


def one_line(text: str) -> str:
    """Return `text` on one line, without what cannot be printed."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def free_name(name: str, taken: Container[str]) -> str:
    """Return `name`, or the first of name_2, name_3, ... if it is taken."""
    free, number = name, 2
    while free in taken:
        free, number = f"{name}_{number}", number + 1
    return free


def display_path(path: Path | str) -> str:
    """Return a path as reports show it: relative to the working directory if it is below it."""
    try:
        return str(Path(path).absolute().relative_to(Path.cwd()))
    except (OSError, ValueError):
        return str(path)

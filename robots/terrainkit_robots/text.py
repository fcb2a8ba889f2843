"""Group values for messages, and format names, counts and paths."""

import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TypeVar

from terrainkit.settings.text import truncate

_Key = TypeVar("_Key")
_Value = TypeVar("_Value")


def group(pairs: Iterable[tuple[_Key, _Value]]) -> dict[_Key, list[_Value]]:
    """Return the values by key, both in the order in which they come."""
    groups: dict[_Key, list[_Value]] = {}
    for key, value in pairs:
        groups.setdefault(key, []).append(value)
    return groups


def names(items: Iterable[str], max_count: int = 6, sep: str = ", ") -> str:
    """Return words as `a, b, c`, with `...` in place of all after the first `max_count`."""
    items = list(items)
    more = ["..."] if len(items) > max_count else []
    return sep.join([truncate(word) for word in items[:max_count]] + more)


def conjunction(items: Sequence[str]) -> str:
    """Return words as `a, b and c`."""
    *first, last = items
    return f"{', '.join(first)} and {last}" if first else last


def numbers(values: Iterable[float], spec: str = "g", sep: str = " ") -> str:
    """Return numbers in the format `spec`, without the sign of a negative zero."""
    return sep.join(f"{value + 0.0:{spec}}" for value in values)


def count(number: int, word: str) -> str:
    """Return a number and a noun, such as `1 leg` or `4 legs`."""
    return f"{number:,} {word}{'' if number == 1 else 's'}"


def contrast(value: float, limit: float, spec: str) -> tuple[str, str]:
    """Return a value and the limit that it exceeds, with enough digits to tell them apart.

    Args:
        value: The value.
        limit: The limit.
        spec: Format of the value, such as `.1f` or `.0%`; more digits are added where necessary.
    """
    digits, kind = int(spec[1:-1]), spec[-1]
    while True:
        texts = f"{value:.{digits}{kind}}", f"{limit:.{digits}{kind}}"
        if texts[0] != texts[1] or digits > 15:
            break
        digits += 1
    return texts[0], re.sub(r"\.0+(?=%?$)", "", texts[1])


def free_name(name: str, used_names: Iterable[str]) -> str:
    """Return `name`, or the first of name_2, name_3, ... that is not taken."""
    return UniqueNames(used_names).add(name)


class UniqueNames:
    """Give names of which no two are equal.

    Args:
        used_names: Names that are taken.
    """

    def __init__(self, used_names: Iterable[str] = ()) -> None:
        self._used_names = set(used_names)
        self._counts: dict[str, int] = {}

    def add(self, name: str) -> str:
        """Return `name`, or the first of name_2, name_3, ... that is not taken, and take it."""
        free = name
        while free in self._used_names:
            self._counts[name] = self._counts.get(name, 1) + 1
            free = f"{name}_{self._counts[name]}"
        self._used_names.add(free)
        return free


def display_path(path: Path | str) -> str:
    """Return a path relative to the working directory if it is inside, otherwise unchanged."""
    try:
        return str(Path(path).absolute().relative_to(Path.cwd()))
    except (OSError, ValueError):
        return str(path)


def short_path(path: Path | str) -> str:
    """Return the shorter of the absolute path and the path relative to the working directory."""
    full = os.path.normpath(Path(path).absolute())
    try:
        return min(os.path.relpath(full), full, key=len)
    except (OSError, ValueError):  # another drive on Windows
        return full

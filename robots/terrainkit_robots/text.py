"""Wording: names and words from a file, as messages give them back."""

import math
from collections.abc import Container, Iterable, Sequence
from pathlib import Path

_MOST_LETTERS = 100
"""Longer names are cut, and compared with no other: they come from a program, or are no names."""


def short(text: str, most: int = _MOST_LETTERS) -> str:
    """Return `text`, cut if it has more than `most` characters."""
    return text if len(text) <= most else f"{text[: most - 3]}..."


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


def closest(word: str, known: Iterable[str], near: float) -> str:
    """Return the known word that `word` is likely to be meant for; nothing if none is close.

    A word that differs in capitals only comes first, then one with letters exchanged.

    Args:
        word: What is written.
        known: What could have been meant.
        near: Share of common letters from which on a word is close.
    """
    if len(word) > _MOST_LETTERS:
        return ""
    others = sorted((other for other in known if len(other) <= _MOST_LETTERS), reverse=True)
    lower = word.lower()
    same = [other for other in others if len(other) == len(lower)]
    for other in same:
        if other.lower() == lower:
            return other
    if not any(letter.isdigit() for letter in lower):  # 12 is not 21
        for other in same:
            if sorted(other.lower()) == sorted(lower):
                return other
    return _most_alike(lower, others, near)


def _most_alike(lower: str, others: Sequence[str], near: float) -> str:
    from difflib import SequenceMatcher

    matcher, best = SequenceMatcher(b=lower, autojunk=False), ""
    score = math.nextafter(near, 0.0)
    for other in others:
        matcher.set_seq1(other.lower())
        if matcher.real_quick_ratio() <= score or matcher.quick_ratio() <= score:
            continue
        if matcher.ratio() > score:
            best, score = other, matcher.ratio()
    return best


def display_path(path: Path | str) -> str:
    """Return a path as reports show it: relative to the working directory if it is below it."""
    try:
        return str(Path(path).absolute().relative_to(Path.cwd()))
    except (OSError, ValueError):
        return str(path)

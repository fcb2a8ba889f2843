"""Text of numbers in XML, and of names in messages, such as the nearest to a misspelled one."""

from collections.abc import Iterable
from dataclasses import fields
from typing import Any

from terrainkit.errors import listing

MAX_LENGTH = 100
"""Longer names are cut, and not compared: a program generated them, or they are not names."""

MIN_RATIO = 0.7
"""Lowest ratio of a name and its misspelling, 0 to 1."""


def truncate(text: str, max_length: int = MAX_LENGTH) -> str:
    """Return `text`, cut if it is longer than `max_length` characters."""
    return text if len(text) <= max_length else f"{text[: max_length - 3]}..."


def format_numbers(*values: float) -> str:
    """Return numbers with up to six decimals, separated by spaces."""
    return " ".join(f"{value:.6f}".rstrip("0").rstrip(".") for value in values)


def short_repr(instance: Any) -> str:
    """Return a dataclass's `repr` with the shapes of arrays, and without values by default."""
    parts = []
    for field in fields(instance):
        value = getattr(instance, field.name)
        if hasattr(value, "shape"):
            parts.append(f"{field.name}: {value.shape}")
        elif value != field.default:
            parts.append(f"{field.name}={truncate(repr(value))}")
    return f"{type(instance).__name__}({', '.join(parts)})"


def closest(word: str, names: Iterable[str], min_ratio: float = MIN_RATIO) -> str:
    """Return the name that `word` is likely a misspelling of; empty if there is none.

    A name that differs only in case comes first, then one with the same letters.

    Args:
        word: The name.
        names: Correct names.
        min_ratio: Lowest `difflib.SequenceMatcher.ratio` of two similar names.
    """
    if len(word) > MAX_LENGTH:
        return ""
    names = sorted((name for name in names if len(name) <= MAX_LENGTH), reverse=True)
    lower = word.lower()
    same_length = [name for name in names if len(name) == len(lower)]
    for name in same_length:
        if name.lower() == lower:
            return name
    if not any(letter.isdigit() for letter in lower):  # 12 is not a misspelling of 21
        for name in same_length:
            if sorted(name.lower()) == sorted(lower):
                return name
    from difflib import get_close_matches

    by_lower = {name.lower(): name for name in reversed(names)}
    similar = get_close_matches(lower, by_lower, 1, min_ratio)
    return by_lower[similar[0]] if similar else ""


def closest_names(word: str, names: Iterable[str], number: int = 3) -> list[str]:
    """Return up to `number` names similar to `word`, the most similar first."""
    from difflib import get_close_matches

    if len(word) > MAX_LENGTH:
        return []
    names = list(names)
    first = closest(word, names)
    similar = get_close_matches(word.lower(), names, number)
    return list(dict.fromkeys([first, *similar] if first else similar))[:number]


def expected_names(
    name: str, names: Iterable[str], prefix: str = "there are", closest_name: str = ""
) -> str:
    """Return the end of an error message about an unknown name.

    Args:
        name: The unknown name.
        names: The names that exist.
        prefix: Words before the list of names.
        closest_name: The name that was meant; the closest of `names` unless given.

    Returns:
        Such as `did you mean 'gap'? There are: flat, gap, pit`.
    """
    names = list(names)
    closest_name = closest_name or closest(name, names)
    text = f"{prefix}: {listing(names)}"
    if not closest_name:
        return text
    return f"did you mean {closest_name!r}? {text[0].upper()}{text[1:]}"

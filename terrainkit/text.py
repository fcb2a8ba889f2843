"""Names in messages: shortened, listed, and the nearest to a misspelled one."""

import math
from collections.abc import Iterable, Sequence

from terrainkit.errors import listing

MAX_LENGTH = 100
"""Longer names are cut, and not compared: a program generated them, or they are not names."""

MIN_SIMILARITY = 0.7
"""Similarity above which a name may be a misspelling of another one, 0 to 1."""


def shorten(text: str, max_length: int = MAX_LENGTH) -> str:
    """Return `text`, cut if it is longer than `max_length` characters."""
    return text if len(text) <= max_length else f"{text[: max_length - 3]}..."


def nearest(word: str, known: Iterable[str], min_similarity: float = MIN_SIMILARITY) -> str:
    """Return the known name that `word` is likely a misspelling of; empty if there is none.

    A name that differs only in case comes first, then one with the same letters.

    Args:
        word: The name.
        known: Correct names.
        min_similarity: Similarity of the names, as of :class:`difflib.SequenceMatcher`.
    """
    if len(word) > MAX_LENGTH:
        return ""
    names = sorted((name for name in known if len(name) <= MAX_LENGTH), reverse=True)
    lower = word.lower()
    same_length = [name for name in names if len(name) == len(lower)]
    for name in same_length:
        if name.lower() == lower:
            return name
    if not any(letter.isdigit() for letter in lower):  # 12 is not a misspelling of 21
        for name in same_length:
            if sorted(name.lower()) == sorted(lower):
                return name
    return _most_similar(lower, names, min_similarity)


def _most_similar(lower: str, names: Sequence[str], min_similarity: float) -> str:
    from difflib import SequenceMatcher

    matcher, best = SequenceMatcher(b=lower, autojunk=False), ""
    similarity = math.nextafter(min_similarity, 0.0)
    for name in names:
        matcher.set_seq1(name.lower())
        if matcher.real_quick_ratio() <= similarity or matcher.quick_ratio() <= similarity:
            continue
        if matcher.ratio() > similarity:
            best, similarity = name, matcher.ratio()
    return best


def known_names(word: str, known: Iterable[str], lead: str = "there are", meant: str = "") -> str:
    """Return the end of an error message about an unknown name.

    Args:
        word: The unknown name.
        known: The names that exist.
        lead: Words before the list of names.
        meant: The name that was meant; the nearest of `known` unless given.

    Returns:
        Such as `did you mean 'gap'? There are: flat, gap, pit`.
    """
    names = list(known)
    meant = meant or nearest(word, names)
    text = f"{lead}: {listing(names)}"
    return f"did you mean {meant!r}? {text[0].upper()}{text[1:]}" if meant else text

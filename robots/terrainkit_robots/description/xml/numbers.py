"""Numbers in attributes: what counts as one, and what was meant where commas are in the way."""

import re

import numpy as np

from terrainkit_robots.transforms import Matrix

_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)

_SPACES = re.compile(r"[ \t\r\n]+")
"""What XML counts as white space; Python's `split` takes more."""

_LARGEST = 1e30
"""A larger number is told as one that cannot be meant, and would overflow in the first square."""


def parse_numbers(text: str, count: int) -> Matrix | None:
    """Return the numbers in `text`, shape (count,); None if there are others, or not that many."""
    words = [word for word in re.split(_SPACES, text) if word]
    if len(words) != count or not all(_NUMBER.fullmatch(word) for word in words):
        return None
    values = [float(word) for word in words]
    return np.array(values) if all(abs(value) < _LARGEST for value in values) else None


def replace_commas(text: str, count: int) -> str:
    """Return the text as it was meant, where commas are all that is wrong; else nothing."""
    between = re.search(r",\s|\s,", text) is not None
    for other in (" ", ".") if between else (".", " "):
        meant = " ".join(text.replace(",", other).split())
        if "," in text and parse_numbers(meant, count) is not None:
            return meant
    return ""

"""Parse numbers in attributes."""

import math
import re
from collections.abc import Sequence

import numpy as np

from terrainkit_robots.transforms import Matrix

_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)

_SPACES = re.compile(r"[ \t\r\n]+")
"""White space in XML; `str.split` accepts more characters."""

_LARGEST = 1e30
"""Larger numbers are rejected; their squares may overflow."""


def parse_numbers(text: str, count: int) -> Matrix | None:
    """Return the numbers in a text.

    Args:
        text: Numbers separated by white space.
        count: Expected number of numbers.

    Returns:
        Numbers, shape (count,); None if the text has anything else, or a number is too large.
    """
    words = [word for word in re.split(_SPACES, text) if word]
    if len(words) != count or not all(_NUMBER.fullmatch(word) for word in words):
        return None
    values = [float(word) for word in words]
    return np.array(values) if all(abs(value) < _LARGEST for value in values) else None


def replace_commas(text: str, count: int) -> str:
    """Return the text with commas replaced by points or spaces, if that yields `count` numbers.

    Returns an empty string otherwise.
    """
    between = re.search(r",\s|\s,", text) is not None
    for other in (" ", ".") if between else (".", " "):
        meant = " ".join(text.replace(",", other).split())
        if "," in text and parse_numbers(meant, count) is not None:
            return meant
    return ""


_MAX_ANGLE = 6.35
"""Largest plausible Euler angle [rad]: one turn, with a margin for rounding."""


def is_in_degrees(angles: Sequence[float]) -> bool:
    """Return whether an angle [rad] is probably in degrees: over a turn, and no common part of one.

    Exporters sometimes write 9.4248 or 7.854, and programs that place parts on a circle 7.0686.
    """
    part = math.radians(7.5)  # of which 15, 22.5, 30 and 45 degrees are multiples
    return any(
        _MAX_ANGLE < abs(angle) < 1e4 and abs(angle - part * round(angle / part)) > 1e-3
        for angle in angles
    )

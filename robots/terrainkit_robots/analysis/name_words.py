"""Split names into words."""

import re

MAX_NAME_LENGTH = 100
"""Maximum length of a name that is analyzed."""

_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+|[^A-Za-z\d]+")


def split_name(name: str) -> list[str]:
    """Return the words, numbers and separators of a name, such as `FL`, `_`, `hip`, `_`, `2`."""
    return _WORD.findall(name)

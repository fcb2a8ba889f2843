"""TOML with comments, which tomli-w does not write: keys, values and comments as text."""

import json
import re
from collections.abc import Mapping, Sequence

from terrainkit_robots.text import one_line

_BARE = re.compile(r"[A-Za-z0-9_-]+")

LINE = 100
"""Characters on a line; a list that would be longer is written one item a line."""


def key_text(key: str) -> str:
    """Return a key, in quotes if it needs them."""
    return key if _BARE.fullmatch(key) else quoted(key)


def quoted(text: str) -> str:
    """Return a text as a TOML string on one line."""
    # A JSON string is one of TOML, but for the one control character that only TOML escapes.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def value_text(value: object, room: int = LINE) -> str:
    """Return a value: a text, a truth, a number, a list or a table of those.

    Args:
        value: The value.
        room: Characters on one line; a longer list has one item a line.
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return quoted(value)
    if isinstance(value, Mapping):
        items = [f"{key_text(key)} = {value_text(item)}" for key, item in value.items()]
        return f"{{ {', '.join(items)} }}" if items else "{}"
    if isinstance(value, Sequence):
        items = [value_text(item) for item in value]
        line = f"[{', '.join(items)}]"
        if len(line) <= room:
            return line
        return "".join(["[\n", *(f"    {item},\n" for item in items), "]"])
    return repr(value)


def comment_text(*parts: str) -> str:
    """Return the parts that are not empty as one comment, with two spaces before it."""
    told = "; ".join(plain for part in parts if (plain := one_line(part)))
    return f"  # {told}" if told else ""

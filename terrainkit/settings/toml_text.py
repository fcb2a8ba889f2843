"""Reading TOML text from any source, and writing keys, values and comments as TOML text."""

import json
import os
import re
import stat
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from terrainkit.errors import ConfigError, one_line

if TYPE_CHECKING:
    from pathlib import Path

MAX_FILE_SIZE = 1 << 20
"""Largest TOML file that is read [bytes]."""

LINE_LENGTH = 100
"""Longest line that is written; a longer list gets one line per item."""

_MAX_SQUARED_DOTS = 10_000_000
"""Limit on the sum of (dots in a line)^2: `tomllib` takes quadratic time for dotted keys."""


def parse_toml(text: str) -> dict[str, Any]:
    """Return the table that TOML text describes.

    Raises:
        ConfigError: if it is not TOML, or reading it would take very long or exhaust the stack.
    """
    import tomllib

    dots = [line.count(".") for line in text.split("\n")]  # splitlines() also splits at U+2028
    if sum(count**2 for count in dots) > _MAX_SQUARED_DOTS:
        most = max(dots)
        raise ConfigError(f"not a TOML file: line {dots.index(most) + 1} has {most} dots")
    try:
        return tomllib.loads(text)
    except ValueError as error:  # TOMLDecodeError is one; so is a number of 5000 digits
        raise ConfigError(f"not a TOML file: {error}") from error
    except RecursionError:
        raise ConfigError("not a TOML file: nested too deeply") from None


def read_text(path: "str | Path", kind: str = "TOML") -> str:
    """Return the text of a file.

    Args:
        path: The file.
        kind: What it is, in error messages.

    Raises:
        ConfigError: if it cannot be read, is not a regular file, or is larger than a megabyte.
    """
    try:
        if not stat.S_ISREG(os.stat(path).st_mode):  # noqa: PTH116 (pathlib is slow to import)
            raise OSError("not a regular file")
        with open(path, "rb") as file:  # noqa: PTH123
            data = file.read(MAX_FILE_SIZE + 1)
    except (OSError, ValueError) as error:  # ValueError for a path with NUL
        reason = error.strerror if isinstance(error, OSError) else None
        raise ConfigError(
            f"cannot read {path}: {reason or error}; expected a {kind} file"
        ) from error
    if len(data) > MAX_FILE_SIZE:
        raise ConfigError(
            f"{path}: more than {MAX_FILE_SIZE} bytes; expected a smaller {kind} file"
        )
    try:
        return data.decode()
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: {error}") from error


def key_text(key: str) -> str:
    """Return a key as TOML, in quotes if it needs them."""
    return key if re.fullmatch("[A-Za-z0-9_-]+", key) else value_text(key)


def value_text(value: Any, width: int = LINE_LENGTH) -> str:
    """Return a string, number, boolean, list or table as TOML; a table is written inline.

    Args:
        value: The value.
        width: Characters left on the line; a longer list gets one line per item.
    """
    if isinstance(value, Mapping):
        items = [f"{key_text(key)} = {value_text(item)}" for key, item in value.items()]
        return f"{{ {', '.join(items)} }}" if items else "{}"
    if isinstance(value, list | tuple):
        texts = [value_text(item) for item in value]
        line = f"[{', '.join(texts)}]"
        return (
            line if len(line) <= width else "".join(["[\n", *(f"    {t},\n" for t in texts), "]"])
        )
    if isinstance(value, str):  # TOML has the strings of JSON, but DEL must be escaped
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return str(value).lower()


def line_text(key: str, value: Any, *comments: str) -> str:
    """Return the line `key = value  # comment`; comments that are empty are left out."""
    start = f"{key_text(key)} = "
    return f"{start}{value_text(value, LINE_LENGTH - len(start))}{comment_text(*comments)}"


def comment_text(*comments: str) -> str:
    """Return `  # a; b` of the comments that are not empty, without what cannot be printed."""
    text = "; ".join(filter(None, map(one_line, comments)))
    return f"  # {text}" if text else ""

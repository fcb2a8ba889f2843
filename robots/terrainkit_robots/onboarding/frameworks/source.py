"""Python source: values, statements and comments as `ruff format` lays them out.

Everything that comes from a robot's file goes through `literal`, `comment` or `docstring`, so that
no name of a link or a joint can end a string and begin a program.
"""

import math
import textwrap
from collections.abc import Iterable, Mapping, Sequence

from terrainkit.errors import ConfigError
from terrainkit_robots.text import one_line

WIDTH = 88
"""Columns of a line; what ruff and black take where nothing is set."""

HERE = "Path(__file__).resolve().parent"
"""The folder of a configuration, where the robot lies too."""

WRITTEN = (
    "Written by terrainkit from robot.toml; a comment before a value tells its unit and where it "
    "came from. SI units and radians."
)
"""What is said of every configuration."""

_DIGITS = 6
"""Digits of a number that are written: no motor or ruler is more exact."""


def literal(text: str) -> str:
    """Return `text` as a string literal, in double quotes unless these need more escapes."""
    quoted = repr(text)
    inside = quoted[1:-1]
    if '"' not in text:
        return f'"{inside}"'
    if "'" in text and text.count('"') <= text.count("'"):
        return '"' + inside.replace("\\'", "'").replace('"', '\\"') + '"'
    return quoted


def number(value: float) -> str:
    """Return `value` as a float literal.

    Raises:
        ConfigError: if it is infinite or not a number.
    """
    if not math.isfinite(value):
        raise ConfigError(f"no configuration can hold the number {value}")
    short = f"{value + 0.0:.{_DIGITS}g}"
    return short if any(letter in short for letter in ".e") else f"{short}.0"


def numbers(values: Iterable[float]) -> list[str]:
    """Return each value as a float literal."""
    return [number(value) for value in values]


def strings(texts: Iterable[str]) -> list[str]:
    """Return each text as a string literal."""
    return [literal(text) for text in texts]


def table(values: Mapping[str, float]) -> list[str]:
    """Return the entries of a dict: names, and numbers."""
    return [f"{literal(name)}: {number(value)}" for name, value in values.items()]


def spread(
    head: str, items: Sequence[str], ends: str = "[]", *, depth: int = 0, tail: str = ""
) -> list[str]:
    """Return a statement that holds a collection: on one line if it fits, else one item a line.

    Args:
        head: What comes before the opening bracket, such as `feet = `.
        items: Source of each item.
        ends: The brackets; the items of a dict, in `{}`, always stand one a line.
        depth: How far the statement will be indented, in steps of four.
        tail: What comes after the closing bracket.
    """
    comma = "," if ends == "()" and len(items) == 1 else ""
    line = f"{head}{ends[0]}{', '.join(items)}{comma}{ends[1]}{tail}"
    if not items or (ends != "{}" and len(line) + 4 * depth <= WIDTH):
        return [line]
    return [head + ends[0], *(f"    {item}," for item in items), ends[1] + tail]


def assign(name: str, value: str, *, depth: int = 0) -> list[str]:
    """Return `name = value` for a value that cannot be broken, in brackets if that makes it fit."""
    line = f"{name} = {value}"
    room = WIDTH - 4 * depth
    if len(line) > room >= len(value) + 4:
        return [f"{name} = (", f"    {value}", ")"]
    return [line]


def assign_sum(name: str, left: str, operator: str, right: str, *, depth: int = 0) -> list[str]:
    """Return `name = left operator right`, in brackets and on two lines as that is needed."""
    line, room = f"{left} {operator} {right}", WIDTH - 4 * depth
    if len(f"{name} = {line}") <= room:
        return [f"{name} = {line}"]
    parts = [line] if len(line) + 4 <= room else [left, f"{operator} {right}"]
    return [f"{name} = (", *(f"    {each}" for each in parts), ")"]


def comment(text: str, *, depth: int = 0) -> list[str]:
    """Return `text` as comment lines, of printable characters only."""
    lines = textwrap.wrap(
        one_line(text), WIDTH - 4 * depth - 2, break_long_words=False, break_on_hyphens=False
    )
    return [f"# {line}" for line in lines]


def docstring(paragraphs: Iterable[str]) -> list[str]:
    """Return the docstring of a module: a title, then paragraphs; those with newlines stay."""
    blocks = [
        paragraph if "\n" in paragraph else textwrap.fill(paragraph, WIDTH, break_long_words=False)
        for paragraph in paragraphs
    ]
    text = "\n\n".join(blocks).replace("\\", "\\\\").replace('"""', "'''")
    return ['"""' + text.split("\n", maxsplit=1)[0], *text.split("\n")[1:], '"""']


def indented(lines: Iterable[str], depth: int = 1) -> list[str]:
    """Return the lines, each `depth` steps of four further in; empty ones stay empty."""
    return [" " * 4 * depth + line if line else line for line in lines]


def module(parts: Iterable[Sequence[str]]) -> str:
    """Return a module of parts that already end in the blank lines they want."""
    return "\n".join(line for part in parts for line in part).rstrip("\n") + "\n"

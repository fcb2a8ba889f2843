"""Format Python source: literals, statements and comments in the style of `ruff format`.

All text from a robot file passes through `string_literal`, `comment` or `docstring`, so that names
of links and joints cannot inject code.
"""

import math
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from string import Template

from terrainkit.errors import ConfigError, one_line

WIDTH = 88
"""Maximum line length, the default of ruff and black."""

GENERATED_NOTE = (
    "Written by terrainkit from robot.toml. Comments before values state units and provenance. SI "
    "units and radians."
)
"""Sentence in the docstring of every configuration."""

_DIGITS = 6
"""Number of significant digits of numbers."""


def string_literal(text: str) -> str:
    """Return a string literal, in double quotes unless single quotes need fewer escapes."""
    quoted = repr(text)
    inside = quoted[1:-1]
    if '"' not in text:
        return f'"{inside}"'
    if "'" in text and text.count('"') <= text.count("'"):
        return '"' + inside.replace("\\'", "'").replace('"', '\\"') + '"'
    return quoted


def float_literal(value: float) -> str:
    """Return a float literal.

    Raises:
        ConfigError: if the value is infinite or NaN.
    """
    if not math.isfinite(value):
        raise ConfigError(f"number in a configuration: got {value}; expected a finite number")
    short = f"{value + 0.0:.{_DIGITS}g}"
    return short if any(letter in short for letter in ".e") else f"{short}.0"


def format_floats(values: Iterable[float]) -> list[str]:
    """Return a float literal for each value."""
    return [float_literal(value) for value in values]


def format_strings(texts: Iterable[str]) -> list[str]:
    """Return a string literal for each text."""
    return [string_literal(text) for text in texts]


def dict_entries(values: Mapping[str, float]) -> list[str]:
    """Return the source of the entries of a dict."""
    return [f"{string_literal(name)}: {float_literal(value)}" for name, value in values.items()]


def format_collection(
    prefix: str, items: Sequence[str], brackets: str = "[]", *, depth: int = 0, suffix: str = ""
) -> list[str]:
    """Return a statement with a collection, on one line if it fits, else with one item per line.

    Args:
        prefix: Text before the opening bracket, such as `feet = `.
        items: Source of each item.
        brackets: The brackets; items of a dict are always on separate lines.
        depth: Indentation of the statement, in steps of four spaces.
        suffix: Text after the closing bracket.
    """
    comma = "," if brackets == "()" and len(items) == 1 else ""
    line = f"{prefix}{brackets[0]}{', '.join(items)}{comma}{brackets[1]}{suffix}"
    if not items or (brackets != "{}" and len(line) + 4 * depth <= WIDTH):
        return [line]
    return [prefix + brackets[0], *(f"    {item}," for item in items), brackets[1] + suffix]


def assignment(name: str, *parts: str, depth: int = 0) -> list[str]:
    """Return `name = value`, with parentheses if the value does not fit, unless they do not help.

    Args:
        name: The name.
        *parts: Parts of the value, such as `a` and `+ b`, which may be on lines of their own.
        depth: Indentation of the statement, in steps of four spaces.
    """
    value, max_length = " ".join(parts), WIDTH - 4 * depth
    fits_alone = len(value) + 4 <= max_length
    if len(f"{name} = {value}") <= max_length or not (fits_alone or parts[1:]):
        return [f"{name} = {value}"]
    lines = [value] if fits_alone else parts
    return [f"{name} = (", *(f"    {line}" for line in lines), ")"]


def path_assignment(name: str, file: str) -> list[str]:
    """Return a statement with the path of a file in the folder of the configuration."""
    return assignment(name, "Path(__file__).resolve().parent", f"/ {string_literal(file)}")


def comment(text: str, *, depth: int = 0) -> list[str]:
    """Return a text as comment lines of printable characters."""
    lines = textwrap.wrap(
        one_line(text), WIDTH - 4 * depth - 2, break_long_words=False, break_on_hyphens=False
    )
    return [f"# {line}" for line in lines]


def docstring(paragraphs: Iterable[str]) -> list[str]:
    """Return the docstring of a module; paragraphs with newlines are not wrapped."""
    blocks = [
        paragraph if "\n" in paragraph else textwrap.fill(paragraph, WIDTH, break_long_words=False)
        for paragraph in paragraphs
    ]
    text = "\n\n".join(blocks).replace("\\", "\\\\").replace('"""', "'''")
    return ['"""' + text.split("\n", maxsplit=1)[0], *text.split("\n")[1:], '"""']


def indent(lines: Iterable[str], depth: int = 1) -> list[str]:
    """Return the lines with an indentation of `depth` steps of four spaces."""
    return [" " * 4 * depth + line if line else line for line in lines]


def fill(template: str, **values: str | Sequence[str]) -> list[str]:
    """Return the lines of a template with the values of its names, such as `$name`.

    A name with a list of lines stands on a line of its own, whose indentation the lines get. Values
    are not searched for names.

    Args:
        template: Name of a text file of this package, without its suffix.
        **values: Values by name; a list that is missing has no lines.
    """
    text = Path(__file__).with_name(f"{template}.txt").read_text(encoding="utf-8")
    lines: list[str] = []
    for line in text.removesuffix("\n").split("\n"):
        before, _, name = line.partition("$")
        value = values.get(name, "")
        if isinstance(value, str):
            lines.append(Template(line).substitute(values))
        else:
            lines += [before + text if text else "" for text in value]
    return lines


def join_lines(parts: Iterable[Sequence[str]]) -> str:
    """Return the text of a module from lists of lines."""
    return "\n".join(line for part in parts for line in part).rstrip("\n") + "\n"

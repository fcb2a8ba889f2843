"""Reports: format the findings on one or more robots as text.

Each format is a module with a function `to_text`. The formats for people, text and
markdown, merge findings that repeat over joints or links into one entry with a list. The formats
for programs, json, sarif and github, keep one entry per finding, because their consumers need the
line and the numbers of each.
"""

import importlib
from collections.abc import Callable, Sequence

from terrainkit_robots.lint.runner import Report

FORMATS = ("text", "json", "sarif", "github", "markdown")
"""Names of the formats."""


def to_text(reports: Sequence[Report], format: str) -> str:  # noqa: A002 (as the option is called)
    """Return `reports` in one of FORMATS. The text ends with a newline unless it is empty."""
    name = f"{format}_report" if format in ("json", "text") else format
    module = importlib.import_module(f"{__name__}.{name}")
    format_module: Callable[[Sequence[Report]], str] = module.to_text
    return format_module(reports)

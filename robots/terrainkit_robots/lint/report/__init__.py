"""Reports: everything that was found on one or more robots, as one text.

Each format is a module with one function, from reports to text; nothing is printed or written here.
"""

import importlib
from collections.abc import Callable, Sequence

from terrainkit_robots.lint.runner import Report

_MODULES = {
    "text": "text",
    "json": "json_report",
    "sarif": "sarif",
    "github": "github",
    "markdown": "markdown",
}

FORMATS = tuple(_MODULES)
"""Names of the formats."""


def as_text(reports: Sequence[Report], format: str) -> str:  # noqa: A002 (as the option is called)
    """Return `reports` in one of FORMATS, with a line end at its end unless it is empty."""
    module = importlib.import_module(f"{__name__}.{_MODULES[format]}")
    write: Callable[[Sequence[Report]], str] = module.write
    return write(reports)

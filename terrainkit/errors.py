"""Errors and warnings of terrainkit.

Each message is one line: what was received, what was expected, what exists.
"""

from collections.abc import Iterable


class TerrainkitError(Exception):
    """Parent class of all errors. The command line prints it on stderr and exits with 2."""


class ConfigError(TerrainkitError, ValueError):
    """A value, name or combination of values is invalid."""


class MapFileError(TerrainkitError):
    """A file is not a map, or is truncated."""


class HeightFileError(TerrainkitError):
    """A file of heights or a mesh cannot be read."""


class ExportError(TerrainkitError):
    """A format cannot represent the map, or the target cannot be written."""


class MemoryLimitError(TerrainkitError, MemoryError):
    """Work would not fit in memory. It is raised before anything is allocated."""


class TerrainkitWarning(UserWarning):
    """Something was omitted or changed; the result is still valid."""


MAX_LISTED = 80
"""Names that an error message lists at most."""


def listing(names: Iterable[str]) -> str:
    """Return `names` separated by commas, at most `MAX_LISTED` of them."""
    listed = list(names)
    more = len(listed) - MAX_LISTED
    shown = listed if more <= 0 else [*listed[:MAX_LISTED], f"and {more} more"]
    return ", ".join(shown) or "nothing"

"""Every error that terrainkit raises on purpose.

A message is one line: what was given, what was wanted, what exists.
"""

from collections.abc import Iterable


class TerrainkitError(Exception):
    """The one class to catch; the command line turns it into a line on stderr and exit code 2."""


class ConfigError(TerrainkitError, ValueError):
    """A number, name or combination that no map can be made from."""


class MapFileError(TerrainkitError):
    """A file that is not a map, or not a whole one."""


class ExportError(TerrainkitError):
    """A map that the wanted format cannot hold, or a target that cannot be written."""


class MemoryLimitError(TerrainkitError, MemoryError):
    """Work that would not fit in this machine's memory; raised before anything is allocated."""


class TerrainkitWarning(UserWarning):
    """Something was left out or changed, and the result is still sound."""


MAX_LISTED = 40
"""Names that an error message lists at most."""


def listing(names: Iterable[str]) -> str:
    """Return `names` separated by commas, the first 40 of them."""
    listed = list(names)
    more = len(listed) - MAX_LISTED
    shown = listed if more <= 0 else [*listed[:MAX_LISTED], f"and {more} more"]
    return ", ".join(shown) or "nothing"

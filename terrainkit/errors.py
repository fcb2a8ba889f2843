"""Errors and warnings of terrainkit.

Each message is one line: what was received, what was expected, what exists.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any


class TerrainkitError(Exception):
    """Parent class of all errors. The command line prints it on stderr and exits with 2."""


class ConfigError(TerrainkitError, ValueError):
    """A value, name or combination of values is invalid."""


class PluginError(ConfigError):
    """A terrain, overlay, task or reward that is not built in failed.

    `__cause__` is the exception of its code, with the traceback.
    """


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


def one_line(text: str) -> str:
    """Return `text` on one line, without unprintable characters."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def is_built_in(item: Any) -> bool:
    """Return whether a class or function belongs to terrainkit."""
    packages = "terrainkit", "terrainkit_robots", "terrainkit_cli"
    return item.__module__.partition(".")[0] in packages


@contextmanager
def plugin_errors(plugin: str | None, *excluded: type[BaseException]) -> Iterator[None]:
    """Replace the exceptions of a plugin by a PluginError in one line.

    `SystemExit` is replaced, too. Signals, such as Ctrl-C, are not.

    Args:
        plugin: What the error names; None if the code is built in: its exceptions are not replaced.
        excluded: Classes of exceptions that are not replaced.
    """
    try:
        yield
    except BaseException as error:
        is_signal = not isinstance(error, Exception) and is_built_in(type(error))
        if plugin is None or is_signal or isinstance(error, (KeyboardInterrupt, *excluded)):
            raise
        import traceback

        is_own = isinstance(error, TerrainkitError)
        cause = str(error) if is_own else "".join(traceback.format_exception_only(error))
        raise PluginError(f"{plugin}: {' '.join(cause.split())}") from error


@contextmanager
def prefixed_errors(prefix: str) -> Iterator[None]:
    """Put `prefix` in front of the message of a TerrainkitError."""
    try:
        yield
    except TerrainkitError as error:
        raise type(error)(f"{prefix}{error}") from error.__cause__ or error


def install_command(extra: str) -> str:
    """Return the command that installs an extra, such as `view`.

    The name `terrainkit` is not registered on a package index, and anyone may register it. Until
    it is registered, no message or page says `pip install terrainkit[view]`.
    """
    return f"pip install '.[{extra}]' (in a clone of terrainkit)"


MAX_LISTED = 80
"""Names that an error message lists at most."""


def listing(names: Iterable[str]) -> str:
    """Return `names` separated by commas, at most `MAX_LISTED` of them."""
    listed = list(names)
    more = len(listed) - MAX_LISTED
    shown = listed if more <= 0 else [*listed[:MAX_LISTED], f"and {more} more"]
    return ", ".join(shown) or "nothing"

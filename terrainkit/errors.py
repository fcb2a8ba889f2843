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


def shorten(text: str, max_length: int = 100) -> str:
    """Return `text`, cut if it is longer than `max_length` characters."""
    return text if len(text) <= max_length else f"{text[: max_length - 3]}..."


def nearest(word: str, known: Iterable[str]) -> str:
    """Return the known name that `word` is likely a misspelling of; empty if there is none."""
    from difflib import get_close_matches

    names = {name.lower(): name for name in known}
    if len(word) > 100:  # the comparison takes quadratic time
        return ""
    return next((names[match] for match in get_close_matches(word.lower(), names, 1, 0.7)), "")


def known_names(word: str, known: Iterable[str], lead: str = "there are", meant: str = "") -> str:
    """Return the end of an error message about an unknown name.

    Args:
        word: The unknown name.
        known: The names that exist.
        lead: What to write before the list of names.
        meant: The name that was meant; the nearest of `known` unless given.

    Returns:
        Such as `did you mean 'gap'? There are: flat, gap, pit`.
    """
    names = list(known)
    meant = meant or nearest(word, names)
    text = f"{lead}: {listing(names)}"
    return f"did you mean {meant!r}? {text[0].upper()}{text[1:]}" if meant else text

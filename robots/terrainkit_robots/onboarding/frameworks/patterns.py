"""Patterns: regular expressions that match one joint or body each, as Isaac Lab and mjlab want."""

import re
from collections.abc import Mapping, Sequence

from terrainkit.errors import ConfigError

_RUN = "|_+)"
"""Ends the part of a pattern that stands for letters beyond ASCII: how many underscores come in
their place depends on the importer."""


def usd_patterns(names: Sequence[str]) -> dict[str, str]:
    """Return a pattern for each name that also matches what USD makes of it.

    USD allows letters, digits and underscores. Importing a robot puts an underscore for anything
    else and for a digit in front, and an `a` before a name that then starts with an underscore.

    Raises:
        ConfigError: if two of the names are one in USD.
    """
    return _only_own({name: _usd_pattern(name) for name in names}, "USD")


def mjlab_patterns(names: Sequence[str]) -> dict[str, str]:
    """Return a pattern for each name, as mjlab sees it: what follows the last slash.

    mjlab matches some patterns with the beginning of a name only, so that those of names that
    others start with end in `$`.

    Raises:
        ConfigError: if two of the names are one in mjlab.
    """
    seen = {name: name.rsplit("/", maxsplit=1)[-1] for name in names}
    patterns = {}
    for name, short in seen.items():
        starts = any(other != short and other.startswith(short) for other in seen.values())
        patterns[name] = re.escape(short) + ("$" if starts else "")
    return _only_own(patterns, "mjlab", seen)


def _usd_pattern(name: str) -> str:
    if not name:
        raise ConfigError("a joint or body without a name cannot be configured")
    pattern = re.sub(r"[^\x00-\x7f]+", rf"(?:\g<0>{_RUN}", re.sub(r"[\x00-\x7f]", _letter, name))
    if re.match(r"[A-Za-z]", pattern):
        return pattern
    first = "[" + pattern[0] + "_]" if pattern[0].isdigit() else pattern[0]
    return "a?" + first + pattern[1:]


def _letter(match: re.Match[str]) -> str:
    letter = match[0]
    return letter if letter.isalnum() or letter == "_" else "."


def _only_own(
    patterns: Mapping[str, str], where: str, seen: Mapping[str, str] | None = None
) -> dict[str, str]:
    """Return the patterns, if each of them matches its own name only."""
    for name, pattern in patterns.items():
        for other in patterns:
            if other != name and _matches(name, pattern, (seen or {}).get(other, other)):
                raise ConfigError(f"{name!r} and {other!r} are one name in {where}; rename one")
    return dict(patterns)


def _matches(name: str, pattern: str, other: str) -> bool:
    """Return whether the pattern of a name matches another."""
    if _RUN not in pattern:
        return re.fullmatch(pattern, other) is not None
    # Trying how many underscores are whose may take for ever; so their number does not count.
    return _flat(name) == _flat(other)


def _flat(name: str) -> str:
    """Return what USD makes of a name, with one underscore for several."""
    flat = re.sub(r"[^A-Za-z0-9]+", "_", name)
    flat = "_" + flat[1:] if flat[0].isdigit() else flat
    return "a" * flat.startswith("_") + flat

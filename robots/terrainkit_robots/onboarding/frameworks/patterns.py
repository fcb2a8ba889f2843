"""Make regular expressions that match one joint or body each, for Isaac Lab and mjlab."""

import re
from collections.abc import Hashable, Iterable, Mapping, Sequence
from typing import TypeVar

from terrainkit.errors import ConfigError
from terrainkit_robots.spec.name_patterns import by_pattern

_Value = TypeVar("_Value", bound=Hashable)

_NON_ASCII_END = "|_+)"
"""End of the pattern of non-ASCII letters. The importer replaces them by one or more underscores.
"""


def usd_patterns(names: Sequence[str]) -> dict[str, str]:
    """Return a pattern for each name that also matches its name in USD.

    USD allows letters, digits and underscores. The importer replaces other characters and a leading
    digit by underscores, and then puts an `a` before a leading underscore.

    Args:
        names: Names of joints or bodies in the robot file.

    Raises:
        ConfigError: if two names are the same in USD.
    """
    return _check_unique({name: _usd_pattern(name) for name in names}, "USD")


def mjlab_patterns(names: Sequence[str]) -> dict[str, str]:
    """Return a pattern for each name in mjlab, which is the part after the last slash.

    mjlab matches some patterns at the start of a name only, so the patterns of names that are
    prefixes of other names end in `$`.

    Args:
        names: Names of joints or bodies in the robot file.

    Raises:
        ConfigError: if two names are the same in mjlab.
    """
    base_names = {name: name.rsplit("/", maxsplit=1)[-1] for name in names}
    patterns = {}
    for name, short in base_names.items():
        is_prefix = any(other != short and other.startswith(short) for other in base_names.values())
        patterns[name] = re.escape(short) + ("$" if is_prefix else "")
    return _check_unique(patterns, "mjlab", base_names)


def merge_patterns(values: Mapping[str, _Value], patterns: Mapping[str, str]) -> dict[str, _Value]:
    """Return values by pattern, in which joints with the same value share patterns.

    Names that differ in the framework keep a pattern each.

    Args:
        values: Values of some joints by name.
        patterns: A pattern for each joint.
    """
    if all(pattern == name for name, pattern in patterns.items()):
        merged = by_pattern(values, list(patterns))
        # mjlab matches some patterns at the start of a name only.
        if not any(_is_start(pattern, name) for pattern in merged for name in patterns):
            return merged
    return {patterns[name]: value for name, value in values.items()}


def merge_names(names: Iterable[str], patterns: Mapping[str, str]) -> list[str]:
    """Return few patterns that match some names and no others."""
    return list(merge_patterns(dict.fromkeys(names, 0), patterns))


def _is_start(pattern: str, name: str) -> bool:
    match = re.match(pattern, name)
    return match is not None and re.fullmatch(pattern, name) is None


def _usd_pattern(name: str) -> str:
    if not name:
        raise ConfigError("name of a joint or body: got an empty text; expected one letter or more")
    ascii_pattern = re.sub(r"(?![A-Za-z0-9_])[\x00-\x7f]", ".", name)
    pattern = re.sub(r"[^\x00-\x7f]+", rf"(?:\g<0>{_NON_ASCII_END}", ascii_pattern)
    if re.match(r"[A-Za-z]", pattern):
        return pattern
    first = "[" + pattern[0] + "_]" if pattern[0].isdigit() else pattern[0]
    return "a?" + first + pattern[1:]


def _check_unique(
    patterns: Mapping[str, str], format_name: str, base_names: Mapping[str, str] | None = None
) -> dict[str, str]:
    """Return the patterns; raise a ConfigError if one of them matches another name."""
    for name, pattern in patterns.items():
        for other in patterns:
            if other != name and _matches(name, pattern, (base_names or {}).get(other, other)):
                raise ConfigError(
                    f"{name!r} and {other!r} have the same name in {format_name}; rename one"
                )
    return dict(patterns)


def _matches(name: str, pattern: str, other: str) -> bool:
    """Return whether the pattern of a name matches another name."""
    if _NON_ASCII_END not in pattern:
        return re.fullmatch(pattern, other) is not None
    # Matching the number of underscores may take exponential time: ignore it.
    return _normalize(name) == _normalize(other)


def _normalize(name: str) -> str:
    """Return the name in USD with repeated underscores merged."""
    flat = re.sub(r"[^A-Za-z0-9]+", "_", name)
    flat = "_" + flat[1:] if flat[0].isdigit() else flat
    return f"a{flat}" if flat.startswith("_") else flat

"""Find few readable patterns, such as `.*_hip_joint`, that match some names and no others."""

import re
from collections.abc import Hashable, Iterator, Mapping, Sequence
from typing import TypeVar

from terrainkit_robots.spec.per_joint import match_joints
from terrainkit_robots.text import group

T = TypeVar("T", bound=Hashable)

_Parts = tuple[str, ...]
"""The texts between the wildcards of a pattern."""

MAX_NAMES = 200
"""Names of larger robots are listed, since the search takes cubic time."""

_BOUNDARY = re.compile(r"(?<=[\W_])|(?=[\W_])|(?<=[a-z])(?=[A-Z])|(?<=\d)(?=\D)|(?<=\D)(?=\d)")
"""Where a name may be cut: beside separators and digits, and between words in camel case."""

_LEG_CODE = re.compile(r"(?<![A-Za-z])[A-Za-z](?=[A-Za-z](?![A-Za-z]))")
"""The first letter of a word of two letters, such as FL or RH, which may also be cut."""

_SPECIAL = re.compile(r"[\\.^$*+?{}\[\]|()]")


def by_pattern(table: Mapping[str, T], joints: Sequence[str]) -> dict[str, T]:
    """Return a table in which joints with the same value share patterns.

    Args:
        table: Value of each joint; joints may be missing.
        joints: Names of all joints.
    """
    groups = group((value, joint) for joint, value in table.items())
    result = {
        pattern: value
        for value, names in groups.items()
        for pattern in find_patterns(names, joints)
    }
    is_same = dict(match_joints(result, joints).values) == dict(table)
    return result if is_same else dict(table)


def find_patterns(names: Sequence[str], all_names: Sequence[str]) -> list[str]:
    """Return patterns that match each of some names once, and no other name.

    A name that shares no pattern with another one is returned unchanged.

    Args:
        names: The names to match.
        all_names: These and all other names.
    """
    if len(all_names) > MAX_NAMES:
        return list(names)
    others = [name for name in all_names if name not in set(names)]
    if len(names) > 1 and not others:
        return [".*"]
    remaining = list(dict.fromkeys(names))
    patterns: dict[str, str] = {}  # by the first name that each one matches
    while remaining:
        parts, matched = _best_parts(remaining, others)
        escaped = (_SPECIAL.sub(r"\\\g<0>", part) for part in parts)
        patterns[matched[0]] = ".*".join(escaped) if len(matched) > 1 else matched[0]
        others += matched
        remaining = [name for name in remaining if name not in matched]
    return [patterns[name] for name in names if name in patterns]


def _best_parts(names: Sequence[str], others: Sequence[str]) -> tuple[_Parts, list[str]]:
    """Return the parts that most names share and no other name has, and these names.

    Among equals, an end is preferred to a start, a start to both, and a longer text to a shorter.
    """
    best: tuple[_Parts, list[str]] = (), list(names[:1])
    rank = 1, 0, 0
    for parts in dict.fromkeys(parts for name in names for parts in _shared_parts(name)):
        matched = [name for name in names if _has_parts(name, parts)]
        sides = 3 if not parts[0] and len(parts) == 2 else 2 if not parts[-1] else 1
        candidate = len(matched), sides, sum(map(len, parts))
        is_better = len(matched) > 1 and candidate > rank
        if is_better and not any(_has_parts(other, parts) for other in others):
            best, rank = (parts, matched), candidate
    return best


def _shared_parts(name: str) -> Iterator[_Parts]:
    """Yield the parts that remain if one part of a name is left out, or all but one word."""
    places = {match.start() for match in _BOUNDARY.finditer(name)}
    places |= {match.end() for match in _LEG_CODE.finditer(name)}
    ordered = sorted(places - {0, len(name)})
    for place in ordered:
        yield "", name[place:]
        yield name[:place], ""
    for index, start in enumerate(ordered):
        for end in ordered[index + 1 :]:
            yield name[:start], name[end:]
    for match in re.finditer(r"(?=(_[^\W_]+_))", name):
        yield "", match[1], ""


def _has_parts(name: str, parts: _Parts) -> bool:
    first, *middle, last = parts
    inner = name[len(first) : len(name) - len(last)]
    is_long = len(name) >= len(first) + len(last)
    return (
        is_long
        and name.startswith(first)
        and name.endswith(last)
        and all(part in inner for part in middle)
    )

"""Match the names of joints or links between two files.

Equal names match. Other names match if they differ only in case or in a suffix such as `_joint`,
and the match is unique: `FL_hip_joint` matches `FL_hip`.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

_SUFFIXES = ("_joint", "_link")
"""Suffixes that a name may have in one file only."""


@dataclass(frozen=True, kw_only=True)
class NamePairs:
    """The matches of two lists of names."""

    pairs: tuple[tuple[str, str], ...]
    """Names of the first and the second list, in the order of the first."""

    only_first: tuple[str, ...]
    only_second: tuple[str, ...]

    @property
    def renamed(self) -> tuple[tuple[str, str], ...]:
        """The pairs of different names."""
        return tuple((a, b) for a, b in self.pairs if a != b)


def pair_names(first: Sequence[str], second: Sequence[str]) -> NamePairs:
    """Return the matches of two lists of names. Repetitions of a name are ignored."""
    first, second = tuple(dict.fromkeys(first)), tuple(dict.fromkeys(second))
    matches = {name: name for name in set(first) & set(second)}
    left = _by_root([name for name in first if name not in matches])
    right = _by_root([name for name in second if name not in matches])
    matches |= {left[root]: right[root] for root in left.keys() & right.keys()}
    matched = set(matches.values())
    return NamePairs(
        pairs=tuple((name, matches[name]) for name in first if name in matches),
        only_first=tuple(name for name in first if name not in matches),
        only_second=tuple(name for name in second if name not in matched),
    )


def _by_root(names: Sequence[str]) -> dict[str, str]:
    """Return the names by their lower-case root without suffix, if it is unique."""
    roots = {name: _root(name) for name in names}
    counts = Counter(roots.values())
    return {root: name for name, root in roots.items() if root and counts[root] == 1}


def _root(name: str) -> str:
    lower = name.lower()
    for suffix in _SUFFIXES:
        lower = lower.removesuffix(suffix)
    return lower

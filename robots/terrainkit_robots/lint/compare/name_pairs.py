"""Pairs of names: which joint or link of one file is which of another.

Equal names belong together. Of the rest those do that differ only in capitals or in a suffix that
says what they are, as `FL_hip_joint` and `FL_hip`, where no third name would fit as well.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

_SUFFIXES = ("_joint", "_link")
"""What a name may end with in one file and not in the other."""


@dataclass(frozen=True, kw_only=True)
class NamePairs:
    """Two lists of names, side by side."""

    pairs: tuple[tuple[str, str], ...]
    """Ours and theirs, in our order."""

    only_ours: tuple[str, ...]
    only_theirs: tuple[str, ...]

    @property
    def renamed(self) -> tuple[tuple[str, str], ...]:
        """The pairs whose names are not equal."""
        return tuple((ours, theirs) for ours, theirs in self.pairs if ours != theirs)


def pair_names(ours: Sequence[str], theirs: Sequence[str]) -> NamePairs:
    """Return which names belong together; of a name that repeats only the first counts."""
    ours, theirs = tuple(dict.fromkeys(ours)), tuple(dict.fromkeys(theirs))
    partner = {name: name for name in set(ours) & set(theirs)}
    left = _by_stem([name for name in ours if name not in partner])
    right = _by_stem([name for name in theirs if name not in partner])
    partner |= {left[stem]: right[stem] for stem in left.keys() & right.keys()}
    taken = set(partner.values())
    return NamePairs(
        pairs=tuple((name, partner[name]) for name in ours if name in partner),
        only_ours=tuple(name for name in ours if name not in partner),
        only_theirs=tuple(name for name in theirs if name not in taken),
    )


def _by_stem(names: Sequence[str]) -> dict[str, str]:
    """Return the names by what is left of them, but for those of which the same is left."""
    stems = {name: _stem(name) for name in names}
    counts = Counter(stems.values())
    return {stem: name for name, stem in stems.items() if stem and counts[stem] == 1}


def _stem(name: str) -> str:
    lower = name.lower()
    for suffix in _SUFFIXES:
        lower = lower.removesuffix(suffix)
    return lower

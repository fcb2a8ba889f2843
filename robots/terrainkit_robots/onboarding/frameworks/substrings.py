"""Substrings: how legged_gym and its successors name bodies and joints, and what that hits.

There a name means every body or joint that contains it, so that "hip" is eight joints of some
robots, and "base" also "base_imu".
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

_MOST_LETTERS = 64
"""Of longer names only whole words are tried: their substrings are too many."""


@dataclass(frozen=True, kw_only=True)
class Keys:
    """What to write, and where it says more than was wanted."""

    keys: tuple[str, ...]

    clashes: tuple[tuple[str, str], ...] = ()
    """Pairs of a key and a name that contains it and should not be hit, or is hit already."""


def common_key(wanted: Sequence[str], others: Iterable[str]) -> str | None:
    """Return a substring of every name that is wanted and of no other; None if there is none.

    The shortest that is made of whole words, as `foot` of `FL_foot` is, else the longest.
    """
    unwanted = [other for other in others if other not in wanted]
    shortest = min(wanted, key=len)
    for candidate in [*_whole_words(shortest), *_pieces(shortest)]:
        if _hits_all(candidate, wanted) and not any(candidate in other for other in unwanted):
            return candidate
    return None


def keys_for(wanted: Sequence[str], bodies: Iterable[str]) -> Keys:
    """Return few substrings that hit each wanted name once and, if that can be, no other."""
    unwanted = [body for body in bodies if body not in wanted]
    left = list(dict.fromkeys(wanted))
    keys: list[str] = []
    while left:
        covered = [name for name in dict.fromkeys(wanted) if name not in left]
        key = _best(left, [*unwanted, *covered])
        keys.append(key)
        left = [name for name in left if key not in name]
    return Keys(keys=tuple(keys), clashes=_clashes(keys, wanted, unwanted))


def gain_keys(joints: Sequence[str], gains: Mapping[str, object]) -> Keys:
    """Return names of joints in an order in which the last one that a joint contains is right.

    A joint whose name contains others, all with its own gains, is left out: it has them already.
    """
    inside = {
        joint: [other for other in joints if other != joint and other in joint] for joint in joints
    }
    keys = [
        joint
        for joint in joints
        if not inside[joint] or any(gains[other] != gains[joint] for other in inside[joint])
    ]
    clashes = tuple(
        (key, joint) for joint in joints for key in keys if key != joint and key in joint
    )
    several = {joint for joint in joints if sum(key in joint for key in keys) > 1}
    if several:
        keys.sort(key=len)
    return Keys(keys=tuple(keys), clashes=tuple(pair for pair in clashes if pair[1] in several))


def _best(left: Sequence[str], others: Sequence[str]) -> str:
    """Return the key that hits most of what is left, and nothing else; else a whole name."""
    candidates = dict.fromkeys(
        candidate for name in left for candidate in [*_whole_words(name), name]
    )
    best, most = left[0], 0
    for candidate in candidates:
        hit = sum(candidate in name for name in left)
        if hit > most and not any(candidate in other for other in others):
            best, most = candidate, hit
    return best


def _clashes(
    keys: Sequence[str], wanted: Sequence[str], unwanted: Sequence[str]
) -> tuple[tuple[str, str], ...]:
    too_many = [(key, name) for key in keys for name in unwanted if key in name]
    for name in dict.fromkeys(wanted):
        hits = [key for key in keys if key in name]
        too_many.extend((key, name) for key in hits[1:])
    return tuple(too_many)


def _whole_words(name: str) -> list[str]:
    """Return the runs of words in a name, shortest first; a word is what separators part."""
    spans = [match.span() for match in re.finditer(r"[^\W_]+", name)][:12]
    runs = {
        name[start:end]
        for position, (start, _) in enumerate(spans)
        for _, end in spans[position:]
        if end - start > 1
    }
    return sorted(runs, key=lambda run: (len(run), name.index(run)))


def _pieces(name: str) -> list[str]:
    """Return the substrings of a name of two letters or more, longest first."""
    if len(name) > _MOST_LETTERS:
        return [name]
    return [
        name[start : start + size]
        for size in range(len(name), 1, -1)
        for start in range(len(name) - size + 1)
    ]


def _hits_all(candidate: str, names: Iterable[str]) -> bool:
    return all(candidate in name for name in names)

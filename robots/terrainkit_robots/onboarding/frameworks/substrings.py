"""Find substrings that identify bodies and joints, as legged_gym and LeggedGym-Ex need them.

In these frameworks a key matches every name that contains it: "hip" may match eight joints, and
"base" also matches "base_imu".
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

_MAX_LENGTH = 64
"""Only whole words of longer names are tried, since they have too many substrings."""


@dataclass(frozen=True, kw_only=True)
class Keys:
    """Substrings, and the names that they match unintentionally."""

    keys: tuple[str, ...]

    clashes: tuple[tuple[str, str], ...] = ()
    """Pairs of a key and a name that it should not match, or that another key matches."""


def common_key(targets: Sequence[str], names: Iterable[str]) -> str | None:
    """Return a substring of all targets and of no other name, or None if there is none.

    The shortest substring of whole words is preferred, such as `foot` in `FL_foot`. Otherwise, the
    longest substring is returned.

    Args:
        targets: The names to match.
        names: All names.
    """
    others = [name for name in names if name not in targets]
    shortest = min(targets, key=len)
    for candidate in [*_word_keys(shortest), *_substrings(shortest)]:
        if all(candidate in name for name in targets) and not any(
            candidate in other for other in others
        ):
            return candidate
    return None


def keys_for(targets: Sequence[str], names: Iterable[str]) -> Keys:
    """Return few substrings that match each target once and, if possible, no other name.

    Args:
        targets: The names to match.
        names: All names.
    """
    others = [name for name in names if name not in targets]
    remaining = list(dict.fromkeys(targets))
    keys: list[str] = []
    while remaining:
        # A name with a key of its own should not match another one: the frameworks take the last.
        matched = [name for name in dict.fromkeys(targets) if name not in remaining]
        key = _best_key(remaining, [*others, *matched])
        keys.append(key)
        remaining = [name for name in remaining if key not in name]
    clashes = [(key, name) for key in keys for name in others if key in name]
    for name in dict.fromkeys(targets):
        matches = [key for key in keys if key in name]
        clashes.extend((key, name) for key in matches[1:])
    return Keys(keys=tuple(keys), clashes=tuple(clashes))


def gain_keys(joints: Sequence[str], gains: Mapping[str, object]) -> Keys:
    """Return joint names in an order in which the last match of each joint has its gains.

    A joint is omitted if its name contains names of other joints with the same gains.

    Args:
        joints: Names of all joints.
        gains: Gains of each joint.
    """
    contained = {
        joint: [other for other in joints if other != joint and other in joint] for joint in joints
    }
    keys = [
        joint
        for joint in joints
        if not contained[joint] or any(gains[other] != gains[joint] for other in contained[joint])
    ]
    clashes = tuple(
        (key, joint) for joint in joints for key in keys if key != joint and key in joint
    )
    ambiguous = {joint for joint in joints if sum(key in joint for key in keys) > 1}
    if ambiguous:
        keys.sort(key=len)  # the longest match is the most specific one, and comes last
    return Keys(keys=tuple(keys), clashes=tuple(pair for pair in clashes if pair[1] in ambiguous))


def _best_key(targets: Sequence[str], others: Sequence[str]) -> str:
    """Return the key that matches most targets and no other name, or else a target."""
    candidates = dict.fromkeys(
        candidate for name in targets for candidate in [*_word_keys(name), name]
    )
    best, max_count = targets[0], 0
    for candidate in candidates:
        count = sum(candidate in name for name in targets)
        if count > max_count and not any(candidate in other for other in others):
            best, max_count = candidate, count
    return best


def _word_keys(name: str) -> list[str]:
    """Return sequences of words in a name, shortest first; words are separated by _ and others."""
    spans = [match.span() for match in re.finditer(r"[^\W_]+", name)][:12]
    sequences = {
        name[start:end]
        for position, (start, _) in enumerate(spans)
        for _, end in spans[position:]
        if end - start > 1
    }
    return sorted(sequences, key=lambda words: (len(words), name.index(words)))


def _substrings(name: str) -> list[str]:
    """Return the substrings of two or more letters of a name, longest first."""
    if len(name) > _MAX_LENGTH:
        return [name]
    return [
        name[start : start + size]
        for size in range(len(name), 1, -1)
        for start in range(len(name) - size + 1)
    ]

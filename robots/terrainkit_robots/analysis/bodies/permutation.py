"""Compare the orders of two lists of joints."""

from collections.abc import Sequence


def permutation(ours: Sequence[str], theirs: Sequence[str]) -> list[int] | None:
    """Return the indices p for which `theirs[i] == ours[p[i]]`, so that arrays map as `ours[p]`.

    None unless both lists have the same names without duplicates.
    """
    index_of = {name: index for index, name in enumerate(ours)}
    if len(index_of) != len(ours) or len(ours) != len(theirs) or set(theirs) != set(index_of):
        return None
    return [index_of[name] for name in theirs]


def is_reordered(indices: Sequence[int]) -> bool:
    """Return whether a permutation is not the identity."""
    return list(indices) != sorted(indices)

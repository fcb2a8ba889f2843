"""Cover a set of cells with few rectangles, which may overlap."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]
Span = tuple[int, int, int, int]
"""Cells i0 to i1 and j0 to j1, ends excluded."""


def rectangle_cover(required: Mask, allowed: Mask) -> list[Span]:
    """Return few rectangles that cover all of `required` and nothing outside of `allowed`.

    The minimum cover is NP-hard. This is the greedy cover, which is at most ln(n) + 1 times as
    large: repeatedly take the maximal rectangle that covers most of the missing cells. Rectangles
    that became redundant are dropped at the end.

    Args:
        required: Cells to cover, shape (nx, ny).
        allowed: Cells that may be covered, a superset of `required`.
    """
    import cv2

    count, labels, stats, _ = cv2.connectedComponentsWithStats(
        allowed.astype(np.uint8), connectivity=4
    )
    spans: list[Span] = []
    present = np.bincount(labels[required], minlength=count) > 0
    for k in np.flatnonzero(present):
        # OpenCV's x is the second index.
        j0, i0, width, height, area = (int(n) for n in stats[k])
        i1, j1 = i0 + height, j0 + width
        if area == width * height:
            spans.append((i0, i1, j0, j1))
            continue
        inside = labels[i0:i1, j0:j1] == k
        part = _cover_component(required[i0:i1, j0:j1] & inside, inside)
        spans += [(i0 + a, i0 + b, j0 + c, j0 + d) for a, b, c, d in part]
    return spans


def _cover_component(required: Mask, allowed: Mask) -> list[Span]:
    # Merge rows and columns that equal the previous one.
    x, y = _changes(required, allowed, axis=0), _changes(required, allowed, axis=1)
    corner = np.ix_(x[:-1], y[:-1])
    candidates = np.array(list(_maximal_rectangles(allowed[corner])))
    area = np.outer(np.diff(x), np.diff(y))
    missing = np.where(required[corner], area, 0)
    chosen: list[NDArray[np.int64]] = []
    while missing.any():
        i0, i1, j0, j1 = best = candidates[np.argmax(_span_sums(missing, candidates))]
        missing[i0:i1, j0:j1] = 0
        chosen.append(best)
    kept = _drop_redundant(np.array(chosen), required[corner])
    return [(int(x[a]), int(x[b]), int(y[c]), int(y[d])) for a, b, c, d in kept]


def _changes(required: Mask, allowed: Mask, axis: int) -> NDArray[np.int64]:
    """Return where rows (or columns) differ from the previous one, including both ends."""
    differ = (np.diff(required, axis=axis) | np.diff(allowed, axis=axis)).any(axis=1 - axis)
    return np.concatenate([[0], np.flatnonzero(differ) + 1, [required.shape[axis]]])


def _maximal_rectangles(allowed: Mask) -> Iterator[Span]:
    """Yield the maximal rectangles within `allowed`."""
    rows = len(allowed)
    empty = np.zeros(allowed.shape[1], dtype=bool)
    for i0 in range(rows):
        above = allowed[i0 - 1] if i0 > 0 else empty
        common = np.ones_like(empty)
        for i1 in range(i0 + 1, rows + 1):
            common = common & allowed[i1 - 1]
            if not common.any():
                break
            below = allowed[i1] if i1 < rows else empty
            edge = np.flatnonzero(np.diff(common, prepend=False, append=False))
            for j0, j1 in edge.reshape(-1, 2):
                if not above[j0:j1].all() and not below[j0:j1].all():
                    yield i0, i1, int(j0), int(j1)


def _span_sums(values: NDArray[np.int64], spans: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the sum of `values` within each span, from a summed-area table."""
    table = np.zeros((values.shape[0] + 1, values.shape[1] + 1), dtype=np.int64)
    table[1:, 1:] = values.cumsum(axis=0).cumsum(axis=1)
    i0, i1, j0, j1 = spans.T
    sums: NDArray[np.int64] = table[i1, j1] - table[i0, j1] - table[i1, j0] + table[i0, j0]
    return sums


def _drop_redundant(spans: NDArray[np.int64], required: Mask) -> NDArray[np.int64]:
    """Return the spans without those whose required cells others cover, last ones first."""
    depth = np.zeros(required.shape, dtype=np.int64)
    for i0, i1, j0, j1 in spans:
        depth[i0:i1, j0:j1] += 1
    kept = []
    for span in spans[::-1]:
        i0, i1, j0, j1 = span
        if (depth[i0:i1, j0:j1][required[i0:i1, j0:j1]] > 1).all():
            depth[i0:i1, j0:j1] -= 1
        else:
            kept.append(span)
    return np.array(kept[::-1])

"""Cover a set of cells with few rectangles, which may overlap.

Sets of cells are integers with one bit per cell. On the small grids here, Python's integers are
several times as fast as arrays.
"""

import heapq
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]
Span = tuple[int, int, int, int]
"""Cells i0 to i1 and j0 to j1, ends excluded."""


class _Rectangle(NamedTuple):
    span: Span
    shift: int
    """Number of the first cell of its first row."""
    required: int
    """The required cells within it."""

    @property
    def area(self) -> int:
        i0, i1, j0, j1 = self.span
        return (i1 - i0) * (j1 - j0)


def decompose_rectangles(required: Mask, allowed: Mask) -> list[Span]:
    """Return few rectangles that cover all of `required` and nothing outside of `allowed`.

    The minimum cover is NP-hard. This is the greedy cover, which is at most ln(n) + 1 times as
    large: repeatedly take the maximal rectangle that covers most of the missing cells, the largest
    of them in case of a tie. Rectangles that became redundant are dropped at the end.

    Args:
        required: Cells to cover, shape (nx, ny).
        allowed: Cells that may be covered, a superset of `required`.
    """
    import cv2

    count, labels, stats, _ = cv2.connectedComponentsWithStats(
        allowed.astype(np.uint8), connectivity=4
    )
    present = np.zeros(count, dtype=bool)
    present[labels[required]] = True
    rectangles: list[Span] = []
    for k in np.flatnonzero(present).tolist():
        # OpenCV's x is the second index.
        j, i, width, height, area = stats[k].tolist()
        if area == width * height:
            rectangles.append((i, i + height, j, j + width))
            continue
        part = slice(i, i + height), slice(j, j + width)
        inside = labels[part] == k
        found = _decompose_component(required[part] & inside, inside)
        rectangles += [(i + i0, i + i1, j + j0, j + j1) for i0, i1, j0, j1 in found]
    return rectangles


def _decompose_component(required: Mask, allowed: Mask) -> list[Span]:
    required_rows, allowed_rows = _row_bits(required), _row_bits(allowed)
    # Bit i * width + j is cell (i, j). A rectangle's cells are counted from its first row.
    width = required.shape[1]
    cells = sum(row << (i * width) for i, row in enumerate(required_rows))
    first_column = ((1 << len(required) * width) - 1) // ((1 << width) - 1)
    candidates = []
    for i0, i1, run in _maximal_rectangles(required_rows, allowed_rows):
        covered = run * (first_column & ((1 << (i1 - i0) * width) - 1))
        span = i0, i1, (run & -run).bit_length() - 1, run.bit_length()
        candidates.append(_Rectangle(span, i0 * width, covered & (cells >> (i0 * width))))
    return [rectangle.span for rectangle in _drop_redundant(_select(candidates, cells))]


def _row_bits(mask: Mask) -> list[int]:
    """Return each row as an integer whose bit j is cell j."""
    packed = np.packbits(mask, axis=1, bitorder="little")
    data = packed.tobytes()
    n = packed.shape[1]
    return [int.from_bytes(data[i : i + n], "little") for i in range(0, len(data), n)]


def _maximal_rectangles(required: list[int], allowed: list[int]) -> Iterator[tuple[int, int, int]]:
    """Yield rows i0 to i1 and columns of the maximal rectangles that have a required cell."""
    above = 0
    for i0, common in enumerate(allowed):
        wanted = 0
        for i1, below in enumerate([*allowed[i0 + 1 :], 0] if common & ~above else [], i0 + 1):
            wanted |= required[i1 - 1]
            rest = common if common & ~below and common & wanted else 0
            while rest:
                run = rest & ~(rest + (rest & -rest))
                rest ^= run
                if run & ~above and run & ~below and run & wanted:
                    yield i0, i1, run
            common &= below
            if not common & ~above:
                break  # all further rectangles extend upward
        above = allowed[i0]


def _select(candidates: list[_Rectangle], missing: int) -> list[tuple[_Rectangle, int]]:
    """Return rectangles in greedy order, each with the cells that it was the first to cover."""
    queue = [
        (-candidate.required.bit_count(), -candidate.area, k)
        for k, candidate in enumerate(candidates)
    ]
    heapq.heapify(queue)
    selected = []
    while missing:
        # The number of missing cells only falls, so an unchanged first entry is the largest.
        number, area, k = queue[0]
        rectangle = candidates[k]
        first = rectangle.required & (missing >> rectangle.shift)
        current = -first.bit_count()
        if current == number:
            heapq.heappop(queue)
            selected.append((rectangle, first))
            missing ^= first << rectangle.shift
        else:
            heapq.heapreplace(queue, (current, area, k))
    return selected


def _drop_redundant(selected: list[tuple[_Rectangle, int]]) -> list[_Rectangle]:
    """Return the chosen rectangles, last first, except those that others cover."""
    kept = []
    covered = 0
    for rectangle, first in reversed(selected):
        # Earlier rectangles do not cover the cells that this one was the first to cover.
        if first & ~(covered >> rectangle.shift):
            kept.append(rectangle)
            covered |= rectangle.required << rectangle.shift
    return kept[::-1]

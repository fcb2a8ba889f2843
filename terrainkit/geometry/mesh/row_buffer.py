"""RowBuffer: an array to which rows are appended."""

from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

MAX_GROWTH = 1 << 18
"""Largest number of rows by which a buffer grows at once, which bounds its unused memory."""


class RowBuffer:
    """Rows of three values in an array that grows in place.

    Concatenating a list of parts would take twice the memory.
    """

    def __init__(self, dtype: DTypeLike, capacity: int = 0) -> None:
        # Growing fills the new rows with zeros; the pages of an empty array are not touched.
        self._rows: NDArray[Any] = np.empty((capacity, 3), dtype=dtype)
        self._length = 0

    def __len__(self) -> int:
        return self._length

    def append(self, rows: NDArray[Any], offset: int = 0) -> None:
        """Append rows.

        Args:
            rows: Rows, shape (n, 3).
            offset: Number to add to all values.
        """
        added = self.add(len(rows))
        added[:] = rows
        if offset:
            added += offset

    def add(self, number: int) -> NDArray[Any]:
        """Return a number of new rows to write, before any others are added, shape (n, 3)."""
        start, self._length = self._length, self._length + number
        if self._length > len(self._rows):
            size = len(self._rows) + min(len(self._rows), MAX_GROWTH)
            self._resize(max(self._length, size))
        return self._rows[start : self._length]

    def array(self) -> NDArray[Any]:
        """Return all rows, shape (n, 3); nothing may be appended afterward."""
        self._resize(self._length)
        return self._rows

    def _resize(self, length: int) -> None:
        # Before NumPy 2.5, the system moves the pages of a large array without copying them. No
        # other reference exists before `array` returns one.
        self._rows.resize((length, 3), refcheck=False)

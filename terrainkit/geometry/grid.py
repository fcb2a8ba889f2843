"""Grid: the positions of the samples of a heightfield.

`heights[i, j]` is the height at the center of cell (i, j). The first index is along x, the second
along y. A grid of shape (80, 40) and cell 0.1 m covers exactly 8 m x 4 m.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError

_CELL_TOLERANCE = 1e-5
"""Tolerance for a whole number of cells [cells], since floats such as 0.1 are not exact."""


@dataclass(frozen=True, kw_only=True)
class Grid:
    """Square cells with one sample at the center of each."""

    shape: tuple[int, int]
    """Cells along x and along y."""

    cell: float
    """Side of a cell [m]."""

    lower: tuple[float, float] = (0.0, 0.0)
    """Corner of cell (0, 0) with the smallest x and y [m]."""

    @property
    def size(self) -> tuple[float, float]:
        """Extent along x and y [m]."""
        return self.shape[0] * self.cell, self.shape[1] * self.cell

    @property
    def extent(self) -> str:
        """Extent along x and y as text, such as `8 m x 6 m`."""
        return f"{self.size[0]:g} m x {self.size[1]:g} m"

    @property
    def upper(self) -> tuple[float, float]:
        """Corner of the last cell with the largest x and y [m]."""
        return self.lower[0] + self.size[0], self.lower[1] + self.size[1]

    @property
    def center(self) -> tuple[float, float]:
        """Center of the grid, x and y [m]."""
        return self.lower[0] + self.size[0] / 2, self.lower[1] + self.size[1] / 2

    def axis(self, k: int) -> NDArray[np.float64]:
        """Return the coordinate of each sample along axis `k` (0 is x, 1 is y) [m], shape (n,)."""
        centers = np.arange(self.shape[k], dtype=np.float64) + 0.5
        return self.lower[k] + centers * self.cell

    def block(self, start: tuple[int, int], shape: tuple[int, int]) -> "Grid":
        """Return the grid of the `shape` cells that begin at cell `start`."""
        lower = (self.lower[0] + start[0] * self.cell, self.lower[1] + start[1] * self.cell)
        return Grid(shape=shape, cell=self.cell, lower=lower)

    def cells(self, length: float, *, minimum: int = 1) -> int:
        """Return `length` [m] rounded to whole cells, at least `minimum`. Halves round up.

        Truncation would turn a gap of 0.3 m into one of 0.2 m, because 0.3 / 0.1 is 2.999...
        """
        return max(minimum, math.floor(length / self.cell + 0.5 + _CELL_TOLERANCE))

    def length(self, count: float) -> float:
        """Return the length of `count` cells [m], rounded to a nanometer."""
        return round(count * self.cell, 9)

    def centered(self, size: float, *, margin: int = 0) -> tuple[int, int]:
        """Return the cells along x and y of a centered square of `size` [m].

        A block can only be centered if its count is even where the grid's is even, and odd where it
        is odd. The count is the nearest of that parity, so it may differ from `size` by one cell.

        Args:
            size: Side of the square [m].
            margin: Cells to leave free on each side; the square is shortened where it is longer.
        """
        x, y = (min(_centered(size / self.cell, n % 2), max(0, n - 2 * margin)) for n in self.shape)
        return x, y

    def rings(self, inner: tuple[int, int]) -> NDArray[np.int32]:
        """Return the ring around the centered block `inner` of each cell, shape `shape`, read-only.

        Ring 0 is the block itself, ring 1 the cells that touch its sides or corners, and so on.

        Args:
            inner: Number of cells of the block along x and y.
        """
        return _rings(self.shape, inner)

    def by_ring(
        self, inner: tuple[int, int], value: Callable[[NDArray[np.int64]], NDArray[np.floating]]
    ) -> NDArray[np.floating]:
        """Return the value of the ring of each cell, shape `shape`; see `rings`.

        Args:
            inner: Cells of the centered block along x and y.
            value: Returns the values of rings, given their numbers.
        """
        return value(np.arange(max(self.margin(inner)) + 1))[self.rings(inner)]

    def margin(self, inner: tuple[int, int]) -> tuple[int, int]:
        """Return the cells along x and y between the centered block `inner` and the edge."""
        return (self.shape[0] - inner[0]) // 2, (self.shape[1] - inner[1]) // 2

    def centered_slices(self, block: tuple[int, int]) -> tuple[slice, slice]:
        """Return the index of the centered block of `block` cells along x and y."""
        x, y = ((n - b) // 2 for n, b in zip(self.shape, block, strict=True))
        return slice(x, x + block[0]), slice(y, y + block[1])

    def slice_along_x(self, center: float, count: int) -> slice:
        """Return the index of the `count` cells along x around x = `center` [m]."""
        first = math.floor((center - self.lower[0]) / self.cell - count / 2 + 0.5 + _CELL_TOLERANCE)
        return slice(max(0, first), max(0, first) + count)

    def fade(self, inner: tuple[int, int], distance: float) -> NDArray[np.float64]:
        """Return weights that rise from 0 on a centered block to 1 away from it.

        Args:
            inner: Number of cells of the block along x and y.
            distance: Distance from the block at which the weight is 1 [m].

        Returns:
            Weights, shape `shape`.
        """
        rise = self.rings(inner) * (self.cell / max(distance, self.cell))
        return np.asarray(np.minimum(rise, 1.0), dtype=np.float64)


def _centered(cells: float, odd: int) -> int:
    return max(0, 2 * math.floor((cells - odd) / 2 + 0.5 + _CELL_TOLERANCE) + odd)


@lru_cache(maxsize=8)
def _rings(shape: tuple[int, int], inner: tuple[int, int]) -> NDArray[np.int32]:
    # Few sizes of platforms occur in a map, so the result is cached.
    rings: NDArray[np.int32] = np.maximum.outer(*map(_distance_to_block, shape, inner))
    rings.flags.writeable = False
    return rings


def _distance_to_block(n: int, block: int) -> NDArray[np.int32]:
    first = (n - block) // 2
    index = np.arange(n, dtype=np.int32)
    outside = np.maximum(first - index, index - (first + block - 1))
    return np.maximum(outside, 0)


def whole_cells(name: str, length: float, cell: float, *, minimum: int = 1) -> int:
    """Return a length as a number of cells.

    Args:
        name: What the length is, for the errors.
        length: The length [m].
        cell: Size of a cell [m].
        minimum: Smallest number of cells.

    Raises:
        ConfigError: if it is not a whole number of cells; the message lists the nearest lengths.
    """
    count = length / cell
    if not math.isfinite(count):
        raise ConfigError(f"{name} {length:g} m is too many cells of {cell:g} m")
    nearest = round(count)
    if nearest < minimum or abs(count - nearest) > _CELL_TOLERANCE + 1e-9 * count:
        low = max(minimum, math.floor(count))
        raise ConfigError(
            f"{name}: got {length:g} m; expected a whole number of cells of {cell:g} m, "
            f"such as {low * cell:g} m or {(low + 1) * cell:g} m"
        )
    return nearest

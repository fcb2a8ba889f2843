"""The grid: where the samples of a heightfield stand. The axis convention lives here.

`heights[i, j]` is the height at the center of cell (i, j): the first index counts along x, the
second along y. A grid of shape (80, 40) and cell 0.1 m therefore covers exactly 8 m x 4 m.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError

_CELL_TOLERANCE = 1e-5
"""How far from a whole number of cells a size may be, for sizes that floats cannot hold (0.1)."""


@dataclass(frozen=True, kw_only=True)
class Grid:
    """Square cells side by side, with one sample at the center of each."""

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
    def upper(self) -> tuple[float, float]:
        """Corner of the last cell with the largest x and y [m]."""
        return self.lower[0] + self.size[0], self.lower[1] + self.size[1]

    @property
    def center(self) -> tuple[float, float]:
        """Middle of the grid, x and y [m]."""
        return self.lower[0] + self.size[0] / 2, self.lower[1] + self.size[1] / 2

    def axis(self, k: int) -> NDArray[np.float64]:
        """Return the coordinate of each sample along axis `k` (0 is x, 1 is y) [m], shape (n,)."""
        centers = np.arange(self.shape[k], dtype=np.float64) + 0.5
        return self.lower[k] + centers * self.cell

    def block(self, start: tuple[int, int], shape: tuple[int, int]) -> "Grid":
        """Return the grid of the `shape` cells from cell `start` on."""
        lower = (self.lower[0] + start[0] * self.cell, self.lower[1] + start[1] * self.cell)
        return Grid(shape=shape, cell=self.cell, lower=lower)

    def cells(self, length: float, *, least: int = 1) -> int:
        """Return the whole number of cells nearest to `length` [m], `least` or more.

        Halves round up.

        Truncating instead is how a gap of 0.3 m becomes one of 0.2 m: 0.3 / 0.1 is 2.999...
        """
        return max(least, math.floor(length / self.cell + 0.5 + _CELL_TOLERANCE))

    def length(self, count: int) -> float:
        """Return `count` cells in metres, to the nanometre: 3 cells of 0.1 m are 0.3 m."""
        return round(count * self.cell, 9)

    def centered(self, size: float) -> tuple[int, int]:
        """Return how many cells a square of `size` [m] takes along x and y to stand centered.

        A block is centered exactly only where its count is even as the grid's is, or odd as it is,
        so the count is the nearest of that parity: it may differ from `size` by up to one cell.
        """
        return self._centered(size, 0), self._centered(size, 1)

    def _centered(self, size: float, k: int) -> int:
        odd = self.shape[k] % 2
        return max(0, 2 * math.floor((size / self.cell - odd) / 2 + 0.5 + _CELL_TOLERANCE) + odd)

    def rings(self, inner: tuple[int, int]) -> NDArray[np.int64]:
        """Return in which ring neighborhood the centered block `inner` each cell lies, shape `shape`.

        0 is the block itself, 1 the cells that touch its sides or corners, and so on.
        """
        x, y = (_beyond(n, block) for n, block in zip(self.shape, inner, strict=True))
        return np.maximum(x[:, None], y[None, :])

    def middle(self, block: tuple[int, int]) -> tuple[slice, slice]:
        """Return the index of the centered block of that many cells."""
        x, y = ((n - b) // 2 for n, b in zip(self.shape, block, strict=True))
        return slice(x, x + block[0]), slice(y, y + block[1])

    def fade(self, inner: tuple[int, int], distance: float) -> NDArray[np.float64]:
        """Return a weight that is 0 on the centered block `inner` and 1 from `distance` [m] on."""
        return np.clip(self.rings(inner) * (self.cell / max(distance, self.cell)), None, 1.0)


def _beyond(n: int, block: int) -> NDArray[np.int64]:
    first = (n - block) // 2
    index = np.arange(n)
    outside = np.maximum(first - index, index - (first + block - 1))
    return np.clip(outside, 0, None)


def whole_cells(name: str, length: float, cell: float, *, least: int = 1) -> int:
    """Return `length` [m] in cells, or raise the error that says which lengths near it would do."""
    count = length / cell
    if not math.isfinite(count):
        raise ConfigError(f"{name} {length:g} m cannot be counted in cells of {cell:g} m")
    nearest = round(count)
    if nearest < least or abs(count - nearest) > _CELL_TOLERANCE + 1e-9 * count:
        low = max(least, math.floor(count))
        raise ConfigError(
            f"{name} {length:g} m is not a whole number of cells of {cell:g} m; "
            f"the nearest that are: {low * cell:g} m, {(low + 1) * cell:g} m"
        )
    return nearest

"""The layout of the preview: a long map is divided into blocks that fill a screen."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrainkit.geometry.grid import Grid

if TYPE_CHECKING:
    from terrainkit.map.terrain_map import TerrainMap

LEFT, BELOW, RIGHT, ABOVE = 250, 60, 130, 70
"""Margins [px]; each block has its own to the left and below."""

MAX_ASPECT = 1.25
"""Largest height of all blocks, relative to the width."""

_MAX_PARTS = 40
"""Largest number of blocks."""

_MIN_GAIN = 1.5
"""Factor by which several blocks have to enlarge the map."""


@dataclass(frozen=True, kw_only=True)
class Block:
    """A part of a map in the picture."""

    rows: range
    """Rows of the patches."""

    cols: range
    """Columns of the patches."""

    cells: tuple[slice, slice]
    """Index into the heights of the map, with up to 1 m of its border."""

    grid: Grid
    """The grid of these cells."""

    scale: float
    """Pixels of a meter."""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [px]."""
        x, y = (max(1, round(length * self.scale)) for length in self.grid.size)
        return x, y

    def pixels(self, xy: ArrayLike) -> NDArray[np.int32]:
        """Return the pixels (column, row) of positions x and y [m], shape (..., 2)."""
        offset = np.asarray(xy, dtype=float) - self.grid.lower
        return np.rint(offset * (self.scale, -self.scale) + (0, self.size[1])).astype(np.int32)


def make_blocks(terrain_map: "TerrainMap", width: int) -> tuple[list[Block], int]:
    """Return the blocks of a map, and the axis along which it is divided.

    Blocks of columns (axis 1) are side by side, and blocks of rows (axis 0) below each other. Their
    number is such that the scale is large.

    Args:
        terrain_map: The map.
        width: Width of all blocks without the first margin [px]; a tall map is narrower.
    """
    best: tuple[float, float, int, list[Block]] = (0.0, 0.0, 1, [])
    for axis in (1, 0):
        for number in range(1, min(terrain_map.difficulty.shape[axis], _MAX_PARTS) + 1):
            blocks = list(_parts(terrain_map, axis, number))
            size = np.max([block.grid.size for block in blocks], axis=0)
            size[1 - axis] *= len(blocks)
            free = np.array([width, MAX_ASPECT * width])
            free[1 - axis] -= (len(blocks) - 1) * (BELOW, LEFT)[axis]
            scale = float((free / size).min())
            gain = scale * (_MIN_GAIN if len(blocks) == 1 else 1.0)
            found = (gain, scale, axis, blocks)
            best = max(best, found, key=lambda layout: (*layout[:3], len(layout[3])))
    _, scale, axis, blocks = best
    return [replace(block, scale=scale) for block in blocks], axis


def _parts(terrain_map: "TerrainMap", axis: int, number: int) -> Iterator[Block]:
    """Yield the parts of a map, in a scale of 1.

    Args:
        terrain_map: The map.
        axis: The axis that is divided.
        number: Number of the parts; fewer if they are all full.
    """
    config = terrain_map.config
    total = terrain_map.difficulty.shape[axis]
    cut = max(0, config.border_cells - round(1.0 / config.cell))
    length = -(-total // number)
    for first in range(0, total, length):
        patches, cells = [], []
        for k in (0, 1):
            count, n = terrain_map.difficulty.shape[k], config.patch_shape[k]
            i, j = (first, min(first + length, count)) if k == axis else (0, count)
            start = config.border_cells + i * n if i else cut
            stop = config.border_cells + j * n if j < count else terrain_map.heights.shape[k] - cut
            patches.append(range(i, j))
            cells.append(slice(start, stop))
        x, y = cells
        grid = terrain_map.grid.block((x.start, y.start), (x.stop - x.start, y.stop - y.start))
        yield Block(rows=patches[0], cols=patches[1], cells=(x, y), grid=grid, scale=1.0)

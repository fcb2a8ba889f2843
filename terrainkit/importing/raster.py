"""Raster: heights at the centers of square cells."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError, HeightFileError
from terrainkit.files.memory import check_memory
from terrainkit.importing.options import Missing, ReadOptions
from terrainkit.importing.source import Array, fill_missing, open_source
from terrainkit.settings.type_hint import MAX_VALUE

BYTES_PER_VALUE = 24
"""Peak memory of a height of a file [bytes]."""

_BYTES_PER_SAMPLE = 100

_ALIGNED = 1e-4
"""Distance to a sample below which its height is taken without interpolation [cells]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Raster:
    """Heights at the centers of square cells."""

    values: NDArray[np.float32]
    """Heights [m], shape (nx, ny), NaN where they are missing."""

    cell: float
    """Side of a cell [m]."""

    lower: tuple[float, float] = (0.0, 0.0)
    """Corner of cell (0, 0) with the smallest x and y [m]."""

    @property
    def upper(self) -> tuple[float, float]:
        """Corner of the last cell [m]."""
        nx, ny = self.values.shape
        return self.lower[0] + nx * self.cell, self.lower[1] + ny * self.cell

    def heights(self, x: Array, y: Array) -> Array:
        """Return the heights at a grid of positions, interpolated linearly.

        Positions beyond the corners get the heights of the edge.

        Args:
            x: Positions along x [m], shape (nx,).
            y: Positions along y [m], shape (ny,).

        Returns:
            Heights [m], shape (nx, ny), NaN where they are missing.
        """
        from scipy.ndimage import map_coordinates

        index = [
            np.clip((position - low) / self.cell - 0.5, 0, n - 1)
            for position, low, n in zip((x, y), self.lower, self.values.shape, strict=True)
        ]
        nearest = [np.rint(each) for each in index]
        if all(np.abs(a - b).max() < _ALIGNED for a, b in zip(index, nearest, strict=True)):
            i, j = (each.astype(int) for each in nearest)
            return np.asarray(self.values[np.ix_(i, j)], dtype=float)
        grid = np.meshgrid(*index, indexing="ij")
        return np.asarray(map_coordinates(self.values.astype(float), grid, order=1, mode="nearest"))


def read_raster(path: Path, options: ReadOptions, missing: Missing, cell: float) -> Raster:
    """Return all heights of a file, without missing ones.

    Args:
        path: The file.
        options: How it is read.
        missing: What happens to missing heights.
        cell: Distance between two samples of a mesh [m].

    Raises:
        HeightFileError: if the file cannot be read, or heights are missing.
        ConfigError: if an option is missing or does not apply to the file.
        MemoryLimitError: if the heights of a mesh would not fit in memory.
    """
    source = open_source(path, options)
    cell = source.cell or cell
    counts = [
        max(1, math.floor((high - low) / cell + _ALIGNED))
        for low, high in zip(source.lower, source.upper, strict=True)
    ]
    check_memory(math.prod(counts) * _BYTES_PER_SAMPLE, f"{path} with cells of {cell:g} m")
    x, y = (
        low + (np.arange(count, dtype=np.float64) + 0.5) * cell
        for low, count in zip(source.lower, counts, strict=True)
    )
    heights = fill_missing(path, source.heights(x, y), missing, x, y)
    return Raster(values=heights.astype(np.float32), cell=cell, lower=source.lower)


def make_raster(
    path: Path,
    values: NDArray[np.generic],
    options: ReadOptions,
    *,
    cell: float | None = None,
    lower: tuple[float, float] = (0.0, 0.0),
    scale: float | None = None,
    offset: float = 0.0,
    nodata: float | None = None,
) -> Raster:
    """Return the raster of the values of a file.

    Args:
        path: The file, for errors.
        values: Values, shape (nx, ny).
        options: Options, which override what the file states.
        cell: Distance between two samples [m], if the file states it.
        lower: Lower corner [m].
        scale: Meters per unit, if the file states it.
        offset: Height of the value 0 [m].
        nodata: Value that marks missing heights.

    Raises:
        HeightFileError: if the values are no heights.
        ConfigError: if an option is missing or does not apply.
    """
    kind = values.dtype.kind
    if values.ndim != 2 or not values.size or kind not in "fiu":
        raise HeightFileError(
            f"{path}: got shape {values.shape} of {values.dtype}; expected a gray image or an "
            "array of numbers with two axes"
        )
    check_memory(values.size * BYTES_PER_VALUE, f"reading {values.size} heights from {path}")
    cell = options.file_cell or cell
    if cell is None:
        raise ConfigError(f"file_cell: missing; {path} does not state the distance of its samples")
    scale, offset = _scale_and_offset(path, values.dtype, options, scale, offset)
    heights = values.astype(np.float64) * scale + offset
    for missing in (nodata, options.nodata):
        if missing is not None:
            heights[values == np.float64(missing)] = np.nan
    invalid = np.abs(heights) > MAX_VALUE
    if invalid.any():
        raise HeightFileError(
            f"{path}: got {int(invalid.sum())} heights beyond {MAX_VALUE:,} m; expected another "
            "scale, or nodata for missing heights"
        )
    return Raster(values=heights.astype(np.float32), cell=cell, lower=lower)


def _scale_and_offset(
    path: Path, dtype: np.dtype[Any], options: ReadOptions, scale: float | None, offset: float
) -> tuple[float, float]:
    """Return the height of a unit and of the value 0 [m], from the options or the file."""
    if options.height_range:
        if dtype.kind != "u":
            raise ConfigError(
                f"height_range: got {dtype} values in {path}; expected unsigned integers, or scale "
                "for others"
            )
        low, high = options.height_range
        return (high - low) / np.iinfo(dtype).max, low
    if options.scale:
        return options.scale, offset
    if scale is None and dtype.kind != "f":
        raise ConfigError(
            f"height_range: missing; {path} has {dtype} values of unknown height; expected "
            "height_range, scale, or a .json beside it"
        )
    return scale or 1.0, offset

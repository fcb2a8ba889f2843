"""Raster: heights at the centers of cells."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError, HeightFileError
from terrainkit.files.memory import check_memory
from terrainkit.importing.nodata import find_nodata
from terrainkit.importing.options import Missing, ReadOptions
from terrainkit.importing.source import Array, fill_missing, open_source, warn
from terrainkit.settings.type_hint import MAX_VALUE

BYTES_PER_VALUE = 40
"""Peak memory of a height of a file [bytes]."""

_BYTES_PER_SAMPLE = 100

_HEIGHT_OPTIONS = {
    "u": "--height-range 0 2 (0 m to 2 m) or --scale 1 (meters)",
    "i": "--scale 0.01 (centimeters)",
}

_MIN_SIDE, _MAX_SIDE = 0.25, 10_000.0
"""Sides of a raster that are usual for the ground of a robot [m]."""

_FULL_RANGE = 0.75
"""Share of the largest value of an integer type from which on an image uses all of them."""

_PART = 50.0
"""Side of the part of a large raster that is proposed [m]."""

MAX_RELIEF = 10.0
"""Largest usual difference of two heights, as a share of the longer side."""

_MIN_SHARE = 0.5 - 1e-9
"""Share of known heights around a position below which its height is missing."""

_ALIGNED = 1e-4
"""Distance to a sample below which its height is taken without interpolation [cells]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Raster:
    """Heights at the centers of rectangular cells."""

    values: NDArray[np.float32]
    """Heights [m], shape (nx, ny), NaN where they are missing."""

    spacing: tuple[float, float]
    """Sides of a cell along x and y [m]."""

    lower: tuple[float, float] = (0.0, 0.0)
    """Corner of cell (0, 0) with the smallest x and y [m]."""

    @property
    def cell(self) -> float:
        """Shorter side of a cell [m]."""
        return min(self.spacing)

    @property
    def upper(self) -> tuple[float, float]:
        """Corner of the last cell [m]."""
        nx, ny = self.values.shape
        return self.lower[0] + nx * self.spacing[0], self.lower[1] + ny * self.spacing[1]

    def heights(self, x: Array, y: Array) -> Array:
        """Return the heights at a grid of positions.

        Between samples, heights are interpolated linearly. Along an axis where the distance of the
        positions is at least two cells, a height is the mean over about this distance: single
        samples would miss steps or show a pattern that is not there.
        Positions beyond the corners get the heights of the edge.

        Args:
            x: Positions along x [m], shape (nx,).
            y: Positions along y [m], shape (ny,).

        Returns:
            Heights [m], shape (nx, ny), NaN where most of them are missing.
        """
        from scipy.ndimage import map_coordinates, uniform_filter

        step = max(float(np.abs(np.diff(each)).max(initial=0.0)) for each in (x, y))
        widths = [
            2 * int(min(step / side / 2 + _ALIGNED, n)) + 1
            for side, n in zip(self.spacing, self.values.shape, strict=True)
        ]
        index = [
            np.clip((position - low) / side - 0.5, 0, n - 1)
            for position, low, side, n in zip(
                (x, y), self.lower, self.spacing, self.values.shape, strict=True
            )
        ]
        nearest = [np.rint(each) for each in index]
        is_aligned = all(
            np.abs(a - b).max() < _ALIGNED for a, b in zip(index, nearest, strict=True)
        )
        if is_aligned and widths == [1, 1]:
            i, j = (each.astype(int) for each in nearest)
            return np.asarray(self.values[np.ix_(i, j)], dtype=float)
        grid = np.meshgrid(*index, indexing="ij")

        def sample(values: NDArray[Any]) -> Array:
            means = uniform_filter(values.astype(float), widths, mode="nearest")
            return np.asarray(map_coordinates(means, grid, order=1, mode="nearest"))

        is_missing = np.isnan(self.values)
        if not is_missing.any():
            return sample(self.values)
        share = sample(~is_missing)
        known = sample(np.where(is_missing, 0.0, self.values))
        return np.where(share > _MIN_SHARE, known / np.maximum(share, _MIN_SHARE), np.nan)


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
    return Raster(values=heights.astype(np.float32), spacing=(cell, cell), lower=source.lower)


def make_raster(
    path: Path,
    values: NDArray[np.generic],
    options: ReadOptions,
    cell: tuple[float, float] | None = None,
    lower: tuple[float, float] = (0.0, 0.0),
    *,
    scale: float | None = None,
    offset: float = 0.0,
    nodata: float | None = None,
) -> Raster:
    """Return the raster of the values of a file.

    Args:
        path: The file, for errors.
        values: Values, shape (nx, ny); masked ones are missing.
        options: Options, which override what the file states.
        cell: Distance between two samples along x and y [m], if the file states it.
        lower: Lower corner [m].
        scale: Meters per unit, if the file states it.
        offset: Height of the value 0 [m].
        nodata: Value that marks missing heights.

    Warns:
        TerrainkitWarning: if values are taken as missing although no tag or option says so, or the
            size of the raster is not that of ground.

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
    spacing = options.file_spacing or cell
    scale, offset = _scale_and_offset(path, values.dtype, options, scale, offset)
    if spacing is None or scale is None:
        needed = ["--file-cell 0.1 (0.1 m between samples)"] * (spacing is None)
        needed += [_HEIGHT_OPTIONS.get(kind, "")] * (scale is None)
        raise ConfigError(
            f"{path}: got {values.dtype} values without their distance or height in meters; "
            f"expected for example {' '.join(needed)}, or a .json beside it"
        )
    heights = np.ma.filled(values.astype(np.float64), np.nan)
    for marker in (nodata, options.nodata):
        if marker is not None:
            with np.errstate(over="ignore"):  # a tag may state more digits than float32 has
                heights[heights == (values.dtype.type(marker) if kind == "f" else marker)] = np.nan
    found = find_nodata(heights, values.dtype, scale) if options.detect_nodata else {}
    for marker, count in found.items():
        heights[heights == marker] = np.nan
        warn(
            f"{path}: {count} of {values.size} values are {marker:g}, far from all others: they "
            "are taken as missing heights (--no-detect-nodata keeps them)"
        )
    if options.height_range:
        _warn_of_range(path, heights, np.iinfo(values.dtype.name).max, *options.height_range)
    heights *= scale
    heights += offset
    invalid = np.abs(heights) > MAX_VALUE
    if invalid.any():
        raise HeightFileError(
            f"{path}: got {int(invalid.sum())} heights beyond {MAX_VALUE:,} m; expected another "
            "scale, or nodata for missing heights"
        )
    raster = Raster(values=heights.astype(np.float32), spacing=spacing, lower=lower)
    _warn_of_size(path, raster)
    return raster


def _warn_of_range(path: Path, values: Array, most: int, low: float, high: float) -> None:
    """Warn if no value comes near the largest one of its type, which has the upper height."""
    known = values[~np.isnan(values)]
    top = float(known.max(initial=0.0))
    if 0 < top < _FULL_RANGE * most:
        warn(
            f"{path}: got values from {known.min():g} to {top:g}; --height-range is for 0 and "
            f"{most}. In MuJoCo and Gazebo, the largest value of the image has the upper height: "
            f"--height-range {low:g} {low + (high - low) * most / top:.6g}"
        )


def _warn_of_size(path: Path, raster: Raster) -> None:
    """Warn if lengths are likely in another unit, or far larger than a robot."""
    sides = [n * side for n, side in zip(raster.values.shape, raster.spacing, strict=True)]
    size, side = f"{path}: got {sides[0]:.6g} m x {sides[1]:.6g} m", max(sides)
    known = raster.values[~np.isnan(raster.values)]
    relief = float(np.ptp(known)) if known.size else 0.0
    factor = 111_000 if relief > MAX_RELIEF * side else 0.1 / raster.cell if side > 1 else 100
    file_cell = "--file-cell " + " ".join(f"{factor * each:.6g}" for each in raster.spacing)
    if relief > MAX_RELIEF * side:
        warn(
            f"{size} with heights over {relief:.4g} m; are they in centimeters (--scale 0.01), or "
            f"positions in degrees ({file_cell} is in meters)?"
        )
    elif side > _MAX_SIDE:
        warn(
            f"{size}, a height every {raster.cell:.4g} m; {_part(raster)} takes a part for a "
            f"robot, {file_cell} with heights times {factor:.3g} makes a small model"
        )
    elif side < _MIN_SIDE:
        warn(f"{size}; {file_cell} is 100 times larger")


def _part(raster: Raster) -> str:
    """Return the options that take the part nearest to the center whose heights are known."""
    from scipy.ndimage import uniform_filter

    spacing, lower = np.array(raster.spacing), np.array(raster.lower)
    size = np.clip(np.floor(spacing * raster.values.shape), 1, _PART)
    known = (~np.isnan(raster.values)).astype(np.float32)
    share = uniform_filter(known, np.ceil(size / spacing).astype(int) + 1, mode="constant")
    x, y = (np.abs(np.arange(n) + 0.5 - n / 2).astype(np.float32) for n in known.shape)
    away = np.maximum.outer(spacing[0] * x, spacing[1] * y)
    away[share < share.max() - 1e-3] = np.inf
    middle = lower + (np.add(np.unravel_index(np.argmin(away), away.shape), 0.5)) * spacing
    x, y = np.clip(middle - size / 2, lower, np.array(raster.upper) - size).round(1).tolist()
    part = f"--origin {x:.10g} {y:.10g} 0 --patch-size {size[0]:g} {size[1]:g}"
    return f"--cell 1 {part} --rows 1 --cols 1"


def _scale_and_offset(
    path: Path, dtype: np.dtype[Any], options: ReadOptions, scale: float | None, offset: float
) -> tuple[float | None, float]:
    """Return the height of a unit, None if unknown, and of the value 0 [m]."""
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
    return scale or (1.0 if dtype.kind == "f" else None), offset

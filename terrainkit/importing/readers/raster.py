"""Raster: heights at the centers of cells."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError, HeightFileError
from terrainkit.files.memory import check_memory
from terrainkit.importing.readers.extent import check_length, check_samples
from terrainkit.importing.readers.georeference import Georeference
from terrainkit.importing.readers.height_source import Array, fill_missing, open_source, warn
from terrainkit.importing.readers.holes import dig_holes
from terrainkit.importing.readers.import_options import Missing, ReadOptions
from terrainkit.importing.readers.nodata import find_nodata
from terrainkit.settings.type_hint import MAX_VALUE

_BYTES_PER_VALUE = 40
"""Peak memory of a height of a file [bytes]."""

_HEIGHT_OPTIONS = {
    "u": "`height_range=(0, 2)` (0 m to 2 m) or `scale=1` (meters)",
    "i": "`scale=0.01` (centimeters)",
}

_FULL_RANGE = 0.75
"""Share of the largest value of an integer type from which on an image uses all of them."""

_MAX_RELIEF = 10.0
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

    holes: NDArray[np.bool_] | None = None
    """Samples in a hole of a mesh, shape (nx, ny); None where there is none."""

    is_metric: ClassVar[bool] = True

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

        step = max(float(np.abs(np.diff(axis)).max(initial=0.0)) for axis in (x, y))
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
        nearest = [np.rint(position) for position in index]
        is_aligned = all(
            np.abs(a - b).max() < _ALIGNED for a, b in zip(index, nearest, strict=True)
        )
        if is_aligned and widths == [1, 1]:
            i, j = (position.astype(int) for position in nearest)
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
        HeightFileError: if the file cannot be read or has not the size of ground, or heights are
            missing.
        ConfigError: if an option is missing or does not apply to the file.
        MemoryLimitError: if the heights of a mesh would not fit in memory.
    """
    source = open_source(path, options)
    cell = source.cell or cell
    extent = np.subtract(source.upper, source.lower)
    counts = np.maximum(1, np.floor(extent / cell + _ALIGNED).astype(int))
    check_length(path, source, cell)
    check_samples(path, source, cell, int(counts.prod()))
    x, y = (
        low + (np.arange(count) + 0.5) * cell
        for low, count in zip(source.lower, counts, strict=True)
    )
    # Only a mesh, which has no cell, has holes.
    heights, holes = dig_holes(source.heights(x, y), 0.0 if source.cell else options.hole_depth)
    heights = fill_missing(path, heights, missing, x, y)
    return Raster(
        values=heights.astype(np.float32),
        spacing=(cell, cell),
        lower=source.lower,
        holes=holes if holes.any() else None,
    )


def make_raster(
    path: Path,
    values: NDArray[np.generic],
    options: ReadOptions,
    reference: Georeference = Georeference(),  # noqa: B008 - it is frozen
) -> Raster:
    """Return the raster of the values of a file.

    Args:
        path: The file, for messages.
        values: Values, shape (nx, ny); masked ones are missing.
        options: Options, which override what the file states.
        reference: What the file states.

    Warns:
        TerrainkitWarning: if values are taken as missing although no tag or option says so, have 8
            bits only, or the heights are far larger than the raster.

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
    check_memory(values.size * _BYTES_PER_VALUE, f"reading {values.size} heights from {path}")
    spacing, lower = options.file_spacing, (0.0, 0.0)
    if spacing is None:
        spacing, lower = reference.cells(path, values.T.shape)
    scale, offset = _scale_and_offset(path, values.dtype, options, reference)
    if spacing is None or scale is None:
        needed = []
        if spacing is None:
            needed.append("`file_cell=0.1` (0.1 m between samples)")
        if scale is None:
            needed.append(_HEIGHT_OPTIONS.get(kind, ""))
        raise ConfigError(
            f"{path}: got {values.dtype} values without their distance or height in meters; "
            f"expected for example {' '.join(needed)}, or a .json beside it"
        )
    heights = _known_values(path, values, options, reference.nodata, scale)
    if options.height_range:
        _warn_of_range(path, heights, np.iinfo(values.dtype.name).max, *options.height_range)
    heights = heights * scale + offset
    invalid = np.abs(heights) > MAX_VALUE
    if invalid.any():
        raise HeightFileError(
            f"{path}: got {int(invalid.sum())} heights beyond {MAX_VALUE:,} m; expected another "
            "scale, or nodata for missing heights"
        )
    sides = [n * length for n, length in zip(values.shape, spacing, strict=True)]
    known = heights[~np.isnan(heights)]
    if known.size and np.ptp(known) > _MAX_RELIEF * max(sides):
        file_cell = ", ".join(f"{111_000 * step:.6g}" for step in spacing)
        warn(
            f"{path}: got {sides[0]:.6g} m x {sides[1]:.6g} m with heights over "
            f"{np.ptp(known):.4g} m; are they in centimeters (`scale=0.01`), or positions in "
            f"degrees (`file_cell=({file_cell})` is in meters)?"
        )
    if values.dtype.itemsize == 1:
        warn(f"{path}: 8 bits have terraces: heights in steps of {abs(scale):.3g} m; use 16 bits")
    return Raster(values=heights.astype(np.float32), spacing=spacing, lower=lower)


def _warn_of_range(path: Path, values: Array, most: int, low: float, high: float) -> None:
    """Warn if the values do not use their type, so that simulators read other heights from them."""
    known = values[~np.isnan(values)]
    bottom, top = float(known.min(initial=most)), float(known.max(initial=0.0))
    if not bottom < top or (bottom == 0 and top >= _FULL_RANGE * most):
        return
    step, largest = (high - low) / (top - bottom), low + (high - low) * most / top
    text = f"`height_range=({low - step * bottom:.6g}, {low + step * (most - bottom):.6g})`"
    if bottom > 0 and top < most:
        text += f"; in Gazebo, only the largest one has: `height_range=({low:g}, {largest:.6g})`"
    simulators = "MuJoCo" if bottom > 0 else "MuJoCo and Gazebo"
    warn(
        f"{path}: got values from {bottom:g} to {top:g}; height_range is for 0 and {most}. In "
        f"{simulators}, the smallest and the largest value of the image have these heights: {text}"
    )


def _scale_and_offset(
    path: Path, dtype: np.dtype[Any], options: ReadOptions, reference: Georeference
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
    scale = options.scale or reference.scale
    if not scale and (dtype.kind == "f" or (dtype.kind == "i" and reference.transform)):
        scale = reference.height_unit
    return scale, reference.offset


def _known_values(
    path: Path, values: NDArray[Any], options: ReadOptions, nodata: float | None, scale: float
) -> Array:
    """Return values in double precision, NaN where they are missing."""
    known = np.ma.filled(values.astype(np.float64), np.nan)
    for marker in (nodata, options.nodata):
        if marker is not None:
            with np.errstate(over="ignore"):  # a tag may state more digits than float32 has
                is_float = values.dtype.kind == "f"
                known[known == (values.dtype.type(marker) if is_float else marker)] = np.nan
    found = find_nodata(known, values.dtype, scale) if options.detect_nodata else {}
    for marker, count in found.items():
        known[known == marker] = np.nan
        warn(
            f"{path}: {count} of {values.size} values are {marker:g}, far from all others: they "
            "are taken as missing heights (`detect_nodata=False` keeps them)"
        )
    return known

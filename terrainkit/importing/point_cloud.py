"""Read the ground from a point cloud."""

import math
import warnings
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import HeightFileError, TerrainkitWarning, install_command
from terrainkit.importing.mesh_extent import round_down
from terrainkit.importing.options import MAX_POSITION, ReadOptions
from terrainkit.importing.raster import Raster
from terrainkit.importing.source import Array, Source, cover_positions, decode

SUFFIXES = (".xyz", ".pcd", ".las", ".laz")

MIN_SHARE = 0.2
"""Share of the points of a cell: fewer of them far above the others are stray points."""

MIN_CELL = 0.1
"""Smallest default cell [m]."""

_POINTS_PER_CELL = 6
"""Points of a default cell, on average."""

_BEYOND = 0.5 + 1e-6
"""End of the last cell, so that it contains the points on its border [cells]."""

_FULL = 0.5
"""Share of the positions of a regular grid that has a point."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PointSource:
    """Points whose highest surface is the ground."""

    points: Array
    """Points [m], z up, shape (n, 3)."""

    cell: float
    """Side of a square with a few points [m]."""

    @cached_property
    def lower(self) -> tuple[float, float]:
        """Corner with the smallest x and y [m]."""
        x, y, _ = self.points.min(axis=0).tolist()
        return x, y

    @cached_property
    def upper(self) -> tuple[float, float]:
        """Corner with the largest x and y [m]."""
        x, y, _ = self.points.max(axis=0).tolist()
        return x, y

    def heights(self, x: Array, y: Array) -> Array:
        """Return the height of the highest surface in each cell of a grid.

        In a cell, points that are more than a cell below the next one belong to another surface.
        The highest surface counts, except for stray points above it. Its height is the median of
        the points that are at most a cell below its highest one, so that noise does not raise it,
        and the foot of a wall does not lower it.

        Args:
            x: Positions along x [m], increasing and evenly spaced, shape (nx,).
            y: Positions along y [m], increasing and evenly spaced, shape (ny,).

        Returns:
            Heights [m], shape (nx, ny), NaN in cells without points.
        """
        inner, number = cover_positions((x, y), self.lower, self.upper)
        step, shape = x[1] - x[0] if len(x) > 1 else self.cell, tuple(map(len, inner))
        edges = [np.append(each - step / 2, each[-1] + _BEYOND * step) for each in inner]
        i, j = (np.searchsorted(edges[k], self.points[:, k], "right") - 1 for k in (0, 1))
        is_inside = (i >= 0) & (i < shape[0]) & (j >= 0) & (j < shape[1])
        column, z = (i * shape[1] + j)[is_inside], self.points[is_inside, 2]
        heights = np.full(shape, np.nan)
        if len(z):
            found, values, num_stray = _highest_surfaces(column, z, step)
            heights.flat[found] = values
            if num_stray:
                warnings.warn(
                    f"{num_stray} of {len(z)} points are far above the others in their cell, and "
                    "were left out",
                    TerrainkitWarning,
                    stacklevel=2,
                )
        return heights[np.ix_(*number)]


def _highest_surfaces(
    column: NDArray[np.int64], z: Array, step: float
) -> tuple[NDArray[np.int64], Array, int]:
    """Return the columns with points, the height of each, and the number of points above."""
    order = np.lexsort((-z, column))
    column, z = column[order], z[order]
    is_first = np.diff(column, prepend=-1) > 0
    start = np.flatnonzero(is_first)
    count = np.diff(start, append=len(z))
    begin = np.flatnonzero(is_first | (np.diff(z, prepend=z[0]) < -step))
    end = np.append(begin[1:], len(z))
    owner = np.cumsum(is_first[begin]) - 1
    is_enough = np.flatnonzero(end - start[owner] >= MIN_SHARE * count[owner])
    chosen = is_enough[np.unique(owner[is_enough], return_index=True)[1]]
    is_near = np.repeat(z[begin], end - begin) - z <= step
    length, first = np.add.reduceat(is_near, begin, dtype=np.int64)[chosen], begin[chosen]
    median = (z[first + (length - 1) // 2] + z[first + length // 2]) / 2
    return column[start], median, int((first - start).sum())


def read(path: Path, options: ReadOptions) -> Source:
    """Return the points of a file, with z up and in meters.

    Raises:
        HeightFileError: if it cannot be read, or has no points.
    """
    return make_point_source(path, decode(_READERS[path.suffix.lower()], path)["points"], options)


def make_point_source(path: Path, points: NDArray[Any], options: ReadOptions) -> Source:
    """Return the source of decoded points; points on a regular grid are a raster.

    Args:
        path: The file, for errors.
        points: Points in the frame and unit of the file, shape (n, 3); invalid ones are dropped.
        options: How the file is read.

    Raises:
        HeightFileError: if there are no valid points.
    """
    points = np.asarray(points, float)
    if options.nodata is not None:
        points = points[points[:, 2] != options.nodata]
    points = points[np.isfinite(points).all(axis=1)] * (options.scale or 1.0)
    if not len(points) or not (np.abs(points) <= MAX_POSITION).all():
        raise HeightFileError(f"{path}: got {len(points)} points; expected points within 1e8 m")
    if options.up == "y":
        points = points[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    area = float(np.prod(np.ptp(points[:, :2], axis=0)))
    cell = max(MIN_CELL, round_down(math.sqrt(_POINTS_PER_CELL * area / len(points)) or MIN_CELL))
    return _make_raster(points) or PointSource(points=points, cell=cell)


def _make_raster(points: Array) -> Raster | None:
    """Return the raster of points on a regular grid of squares; None for others."""
    axes = [np.unique(points[:, k].round(6)) for k in (0, 1)]
    shape = len(axes[0]), len(axes[1])
    if min(shape) < 2 or not _FULL * math.prod(shape) <= len(points) <= math.prod(shape):
        return None
    steps = np.concatenate([np.diff(each) for each in axes])
    if np.ptp(steps) > 1e-3 * steps[0]:
        return None
    i, j = (np.searchsorted(each, points[:, k].round(6)) for k, each in enumerate(axes))
    if len(np.unique(i * shape[1] + j)) < len(points):
        return None  # coordinates that are rounded, but in no order
    values = np.full(shape, np.nan, np.float32)
    values[i, j] = points[:, 2]
    cell = round(float(steps.mean()), 9)
    x, y = (float(each[0]) - cell / 2 for each in axes)
    return Raster(values=values, spacing=(cell, cell), lower=(x, y))


def _read_xyz(path: Path) -> dict[str, Any]:
    with path.open(encoding="utf-8", errors="replace") as file:
        first = file.readline()
    delimiter = next((each for each in ",;" if each in first), None)
    skip = int(not first.lstrip().startswith(tuple("+-.0123456789")))
    columns: dict[str, Any] = {"usecols": (0, 1, 2), "ndmin": 2, "comments": ("#", "/")}
    return {"points": np.loadtxt(path, delimiter=delimiter, skiprows=skip, **columns)}


def _read_pcd(path: Path) -> dict[str, Any]:
    """Return the points of a file of PCL, whose header has lines such as FIELDS x y z."""
    head, _, rest = path.read_bytes().partition(b"\nDATA ")
    kind, _, body = rest.partition(b"\n")
    rows = [line.split() for line in head.decode("ascii", "replace").splitlines()]
    header = {key: values for key, *values in filter(None, rows)}
    names, number = header["FIELDS"], int(header["POINTS"][0])
    counts = [int(each) for each in header.get("COUNT", ["1"] * len(names))]
    types = [f"<{t.lower()}{size}" for t, size in zip(header["TYPE"], header["SIZE"], strict=True)]
    places = [names.index(name) for name in "xyz"]
    if kind.strip() == b"ascii":
        columns = np.cumsum([0, *counts])[places].tolist()
        return {"points": np.loadtxt(body.decode().splitlines(), usecols=columns, ndmin=2)}
    fields = [(str(k), *each) for k, each in enumerate(zip(types, counts, strict=True))]
    if kind.strip() == b"binary":
        table = np.frombuffer(body, fields, count=number)
        return {"points": np.column_stack([table[str(k)] for k in places])}
    packed, size = np.frombuffer(body, "<u4", count=2).tolist()
    body = _decompress(body[8 : 8 + packed], size)
    starts = np.cumsum([0, *(np.dtype([each]).itemsize * number for each in fields)])
    return {
        "points": np.column_stack(
            [np.frombuffer(body, types[k], count=number, offset=starts[k]) for k in places]
        )
    }


def _decompress(data: bytes, size: int) -> bytes:
    """Return data compressed by LZF, the format of PCL: literals, and copies of earlier bytes."""
    out, k = bytearray(), 0
    while k < len(data) and len(out) < size:
        code, k = data[k], k + 1
        if code < 32:
            out += data[k : k + code + 1]
            k += code + 1
            continue
        length = code >> 5
        if length == 7:
            length, k = 7 + data[k], k + 1
        begin = len(out) - ((code & 31) << 8 | data[k]) - 1
        k, length = k + 1, length + 2
        if begin < 0:
            raise ValueError("got damaged compressed points")
        block = out[begin : begin + length]
        out += (block * (length // len(block) + 1))[:length]  # a copy may overlap itself
    return bytes(out)


def _read_las(path: Path) -> dict[str, Any]:
    try:
        import laspy
    except ImportError:
        raise ValueError(
            f"requires laspy; install it with: {install_command('las')}; or convert it to .xyz"
        ) from None
    return {"points": np.asarray(laspy.read(path).xyz, float)}


_READERS = {".xyz": _read_xyz, ".pcd": _read_pcd, ".las": _read_las, ".laz": _read_las}

"""Read the ground from a point cloud."""

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError, HeightFileError
from terrainkit.importing.readers.height_source import (
    Array,
    Source,
    VertexSource,
    cover_positions,
    decode,
    require,
    warn,
    with_z_up,
)
from terrainkit.importing.readers.import_options import MAX_POSITION, ReadOptions
from terrainkit.importing.readers.raster import Raster

SUFFIXES = (".pcd", ".las", ".laz")

GROUND_CLASS = 2
"""Class of the ground in LAS files, by the ASPRS."""

_LENGTH_UNITS = (3076, 4099)
"""GeoTIFF keys of the units of lengths and of heights; a projected system often has one of them."""

_FEET = (9002, 9003)
"""Its values for feet and US survey feet."""

MIN_CELL = 0.1
"""Smallest default cell [m]."""

_STRAY = 0.2
"""Share of the points of a cell that may be above its highest surface: stray points."""

_POINTS_PER_CELL = 6
"""Points of a default cell, on average."""

_BEYOND = 0.5 + 1e-6
"""End of the last cell, so that it contains the points on its border [cells]."""

_FULL = 0.5
"""Share of the positions of a regular grid that has a point."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PointSource(VertexSource):
    """Points whose highest surface is the ground."""

    cell: float
    """Side of a square with a few points [m]."""

    def heights(self, x: Array, y: Array) -> Array:
        """Return the height of the highest surface in each cell of a grid.

        It is the median of the points that are at most a cell below the highest point, apart from
        `_STRAY` of the points. Noise therefore does not raise it, and the foot of a wall does not
        lower it.

        Args:
            x: Positions along x [m], increasing and evenly spaced, shape (nx,).
            y: Positions along y [m], increasing and evenly spaced, shape (ny,).

        Returns:
            Heights [m], shape (nx, ny), NaN in cells without points.
        """
        inner, number = cover_positions((x, y), self.lower, self.upper)
        step = x[1] - x[0] if len(x) > 1 else self.cell
        shape = tuple(map(len, inner))
        edges = [np.append(lines - step / 2, lines[-1] + _BEYOND * step) for lines in inner]
        i, j = (np.searchsorted(edges[k], self.vertices[:, k], "right") - 1 for k in (0, 1))
        is_inside = (i >= 0) & (i < shape[0]) & (j >= 0) & (j < shape[1])
        column, z = (i * shape[1] + j)[is_inside], self.vertices[is_inside, 2]
        order = np.lexsort((z, column))
        column, z = column[order], z[order]
        used, start, count = np.unique(column, return_index=True, return_counts=True)
        heights = np.full(shape, np.nan)
        if len(used):
            last = start + count - 1
            top = z[last - (_STRAY * count).astype(int)]
            below = np.add.reduceat(z < np.repeat(top - step, count), start, dtype=np.int64)
            middle = start + below + last
            heights.flat[used] = (z[middle // 2] + z[(middle + 1) // 2]) / 2
        return heights[np.ix_(*number)]


def read(path: Path, options: ReadOptions) -> Source:
    """Return the points of a file, with z up and in meters.

    Raises:
        HeightFileError: if it cannot be read, or has no points.
    """
    if (suffix := path.suffix.lower()) in (".las", ".laz"):
        require(path, "laspy", "las")
    arrays = decode(_READERS[suffix], path)
    points = arrays["points"]
    if "classes" in arrays:
        if arrays["is_feet"] and not options.scale:
            warn(f"{path}: states feet, which are taken as meters; `scale=0.3048` converts them")
        points = points[_is_ground(path, arrays["classes"], options)]
    return make_point_source(path, points, options)


def _is_ground(path: Path, classes: NDArray[Any], options: ReadOptions) -> NDArray[np.bool_]:
    """Return whether each point is in one of the classes that are the ground."""
    used = np.unique(classes)
    wanted = options.point_class or ((GROUND_CLASS,) if GROUND_CLASS in used else used.tolist())
    is_ground = np.isin(classes, wanted)
    known = ", ".join(map(str, used.tolist()))
    if not is_ground.any():
        raise ConfigError(f"class: got {wanted}; {path} has the classes {known}")
    if not options.point_class and not is_ground.all():
        warn(
            f"{path}: only the {int(is_ground.sum())} of {len(classes)} points of class "
            f"{GROUND_CLASS} (ground) are taken; `point_class=({known})` takes all"
        )
    return is_ground


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
    points = with_z_up(points, options.up)
    area = float(np.prod(np.ptp(points[:, :2], axis=0)))
    side = float(f"{math.sqrt(_POINTS_PER_CELL * area / len(points)):.1g}")
    return _make_raster(points) or PointSource(vertices=points, cell=max(MIN_CELL, side))


def _make_raster(points: Array) -> Raster | None:
    """Return the raster of points on a regular grid of squares; None for others."""
    axes, index = zip(
        *(np.unique(points[:, k].round(6), return_inverse=True) for k in (0, 1)), strict=True
    )
    values = np.full(tuple(map(len, axes)), np.nan, np.float32)
    if min(values.shape) < 2 or not _FULL * values.size <= len(points) <= values.size:
        return None
    steps = np.concatenate([np.diff(axis) for axis in axes])
    values[index] = points[:, 2]
    # Rounded coordinates in no order may be at the same position.
    if np.ptp(steps) > 1e-3 * steps[0] or np.count_nonzero(~np.isnan(values)) < len(points):
        return None
    cell = round(float(steps.mean()), 9)
    x, y = (float(axis[0]) - cell / 2 for axis in axes)
    return Raster(values=values, spacing=(cell, cell), lower=(x, y))


def _read_pcd(path: Path) -> dict[str, Any]:
    """Return the points of a file of PCL, whose header has lines such as FIELDS x y z."""
    head, _, rest = path.read_bytes().partition(b"\nDATA ")
    kind, _, body = rest.partition(b"\n")
    rows = [line.split() for line in head.decode("ascii", "replace").splitlines()]
    header = {key: values for key, *values in filter(None, rows)}
    names = header["FIELDS"]
    counts = [int(count) for count in header.get("COUNT", ["1"] * len(names))]
    places = [names.index(name) for name in "xyz"]
    if kind.strip() == b"ascii":
        columns = np.cumsum([0, *counts])[places].tolist()
        return {"points": np.loadtxt(body.decode().splitlines(), usecols=columns, ndmin=2)}
    if kind.strip() != b"binary":
        raise ValueError(f"got {kind.decode('ascii', 'replace')}; expected ascii or binary data")
    types = zip(header["TYPE"], header["SIZE"], counts, strict=True)
    fields = [(str(k), f"<{kind.lower()}{size}", n) for k, (kind, size, n) in enumerate(types)]
    table = np.frombuffer(body, fields, count=int(header["POINTS"][0]))
    return {"points": np.column_stack([table[str(k)] for k in places])}


def _read_las(path: Path) -> dict[str, Any]:
    import laspy

    cloud = laspy.read(path)
    records = cloud.header.vlrs
    keys = [key for record in records for key in getattr(record, "geo_keys", ())]
    is_feet = any(key.id in _LENGTH_UNITS and key.value_offset in _FEET for key in keys)
    texts = [getattr(record, "string", "") for record in records]
    is_feet |= any(re.search('UNIT\\["[^"]*(foot|feet|ft)', text, re.IGNORECASE) for text in texts)
    classes = np.asarray(cloud.classification)
    return {"points": np.asarray(cloud.xyz, float), "classes": classes, "is_feet": is_feet}


_READERS = {".pcd": _read_pcd, ".las": _read_las, ".laz": _read_las}

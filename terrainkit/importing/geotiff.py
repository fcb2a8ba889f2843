"""Read the tags of a GeoTIFF that state cells, position and missing heights."""

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from terrainkit.errors import HeightFileError

_FORMATS = {1: "B", 2: "s", 3: "H", 4: "I", 12: "d"}
"""Format of a value by its type in TIFF: byte, text, short, long and double."""

_HEIGHT, _PIXEL_SCALE, _TIE_POINT, _GEO_KEYS, _NODATA = 257, 33550, 33922, 34735, 42113
_MODEL_TYPE, _RASTER_TYPE, _LINEAR_UNITS = 1024, 1025, 3076
_PROJECTED, _PIXEL_IS_POINT, _METER = 1, 2, 9001

_MAX_VALUES = 1 << 16
"""Largest number of values of a tag that is read."""


@dataclass(frozen=True, kw_only=True)
class GeoTags:
    """What the tags of a GeoTIFF state."""

    cell: tuple[float, float] | None = None
    """Sides of a cell along x and y; None without tags."""

    is_in_meters: bool = True
    """Whether positions are in meters, not in degrees or feet."""

    lower: tuple[float, float] = (0.0, 0.0)
    """Corner with the smallest x and y."""

    nodata: float | None = None
    """Value that marks missing heights, as GDAL writes it."""


def read_geo_tags(path: Path) -> GeoTags:
    """Return the tags of a TIFF file; none for BigTIFF.

    Raises:
        HeightFileError: if the tags cannot be read.
    """
    try:
        with path.open("rb") as file:
            return _geo_tags(_read_tags(file))
    except (struct.error, ValueError, LookupError, OSError) as error:
        raise HeightFileError(f"{path}: got invalid TIFF tags: {error}") from error


def _geo_tags(tags: dict[int, Any]) -> GeoTags:
    text = tags.get(_NODATA, (b"",))[0].rstrip(b"\0 ").decode("ascii")
    nodata = float(text) if text else None
    if _PIXEL_SCALE not in tags:
        return GeoTags(nodata=nodata)
    dx, dy = tags[_PIXEL_SCALE][:2]
    i, j, _, x, y, _ = tags[_TIE_POINT][:6] if _TIE_POINT in tags else (0.0,) * 6
    directory = tags.get(_GEO_KEYS, ())
    keys = {directory[k]: directory[k + 3] for k in range(4, len(directory) - 3, 4)}
    is_projected = keys.get(_MODEL_TYPE, _PROJECTED) == _PROJECTED
    if keys.get(_RASTER_TYPE) == _PIXEL_IS_POINT:
        i, j = i + 0.5, j + 0.5
    return GeoTags(
        cell=(dx, dy),
        is_in_meters=is_projected and keys.get(_LINEAR_UNITS, _METER) == _METER,
        lower=(x - i * dx, y - (tags[_HEIGHT][0] - j) * dy),
        nodata=nodata,
    )


def _read_tags(file: BinaryIO) -> dict[int, Any]:
    """Return the values of the tags of the first image that this module uses."""
    order = {b"II": "<", b"MM": ">"}.get(file.read(2))
    if order is None:
        return {}
    version, start = struct.unpack(f"{order}HI", file.read(6))
    if version != 42:
        return {}
    file.seek(start)
    (number,) = struct.unpack(f"{order}H", file.read(2))
    entries = [struct.unpack(f"{order}HHI4s", file.read(12)) for _ in range(number)]
    tags = {}
    for tag, kind, count, inline in entries:
        if tag not in (_HEIGHT, _PIXEL_SCALE, _TIE_POINT, _GEO_KEYS, _NODATA):
            continue
        if kind not in _FORMATS or count > _MAX_VALUES:
            raise ValueError(f"tag {tag} has {count} values of type {kind}")
        layout = f"{order}{count}{_FORMATS[kind]}"
        size = struct.calcsize(layout)
        if size > 4:
            file.seek(struct.unpack(f"{order}I", inline)[0])
        tags[tag] = struct.unpack(layout, file.read(size) if size > 4 else inline[:size])
    return tags

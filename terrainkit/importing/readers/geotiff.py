"""Read the tags of a GeoTIFF that state cells, position and missing heights."""

import struct
from pathlib import Path
from typing import Any, BinaryIO

from terrainkit.errors import HeightFileError
from terrainkit.importing.readers.georeference import Georeference, Transform

_FORMATS = {1: "B", 2: "s", 3: "H", 4: "I", 12: "d"}
"""Format of a value by its type in TIFF: byte, text, short, long and double."""

_BANDS, _PIXEL_SCALE, _TIE_POINT, _MATRIX = 277, 33550, 33922, 34264
_GEO_KEYS, _NODATA = 34735, 42113
_MODEL_TYPE, _RASTER_TYPE, _PROJECTION, _LINEAR_UNITS, _HEIGHT_UNITS = 1024, 1025, 3072, 3076, 4099
_GEOGRAPHIC, _PIXEL_IS_POINT, _WEB_MERCATOR = 2, 2, 3857
_UNITS = {9001: 1.0, 9002: 0.3048, 9003: 1200 / 3937}
"""Meters per unit: meter, foot and US survey foot."""

MAX_VALUES = 1 << 16
"""Largest number of values of a tag that is read."""


def read_geo_tags(path: Path) -> Georeference:
    """Return what the tags of a TIFF file state; nothing for BigTIFF.

    Raises:
        HeightFileError: if the tags cannot be read.
    """
    try:
        with path.open("rb") as file:
            return _georeference(_read_tags(file))
    except (struct.error, ValueError, LookupError, OSError) as error:
        raise HeightFileError(f"{path}: got invalid TIFF tags: {error}") from error


def _georeference(tags: dict[int, Any]) -> Georeference:
    text = tags.get(_NODATA, (b"",))[0].rstrip(b"\0 ").decode("ascii")
    directory = tags.get(_GEO_KEYS, ())
    keys = {directory[k]: directory[k + 3] for k in range(4, len(directory) - 3, 4)}
    unit = _UNITS.get(keys.get(_LINEAR_UNITS, 9001))
    if keys.get(_MODEL_TYPE) == _GEOGRAPHIC:
        unit = None
    elif unit is None:
        raise ValueError(f"got the linear unit {keys[_LINEAR_UNITS]}; expected meters or feet")
    return Georeference(
        transform=_transform(tags, is_point=keys.get(_RASTER_TYPE) == _PIXEL_IS_POINT),
        unit=unit,
        is_web_mercator=keys.get(_PROJECTION) == _WEB_MERCATOR,
        height_unit=_UNITS.get(keys.get(_HEIGHT_UNITS, 9001), 1.0),
        nodata=float(text) if text else None,
        num_bands=tags.get(_BANDS, (1,))[0],
    )


def _transform(tags: dict[int, Any], *, is_point: bool) -> Transform | None:
    """Return the coefficients of the position (x, y) of the corner of column and row."""
    if _MATRIX in tags:
        xx, xy, _, x, yx, yy, _, y = tags[_MATRIX][:8]
    elif _PIXEL_SCALE in tags:
        (xx, yy), xy, yx = tags[_PIXEL_SCALE][:2], 0.0, 0.0
        i, j, _, x, y, _ = tags[_TIE_POINT][:6] if _TIE_POINT in tags else (0.0,) * 6
        x, y, yy = x - i * xx, y + j * yy, -yy
    else:
        return None
    if is_point:
        x, y = x - (xx + xy) / 2, y - (yx + yy) / 2
    return xx, xy, x, yx, yy, y


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
        if tag not in (_BANDS, _PIXEL_SCALE, _TIE_POINT, _MATRIX, _GEO_KEYS, _NODATA):
            continue
        if kind not in _FORMATS or count > MAX_VALUES:
            raise ValueError(f"tag {tag} has {count} values of type {kind}")
        layout = f"{order}{count}{_FORMATS[kind]}"
        size = struct.calcsize(layout)
        if size > 4:
            file.seek(struct.unpack(f"{order}I", inline)[0])
        tags[tag] = struct.unpack(layout, file.read(size) if size > 4 else inline[:size])
    return tags

"""Read heights from an ESRI ASCII grid."""

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from terrainkit.errors import listing
from terrainkit.importing.readers import point_table
from terrainkit.importing.readers.georeference import Georeference
from terrainkit.importing.readers.height_source import Source, decode
from terrainkit.importing.readers.import_options import ReadOptions
from terrainkit.importing.readers.pixels import pixels_raster
from terrainkit.settings.toml_text import read_text

SUFFIXES = (".asc",)

_CORNERS = {"xllcorner", "yllcorner", "xllcenter", "yllcenter", "nodata_value"}
_KEYS = {"ncols", "nrows", "cellsize"}, {"ncols", "nrows", "dx", "dy"}
"""Required keys; GDAL writes dx and dy if cells are not square."""

_MAX_WORD_BYTES = 64
"""Bytes of a height and the spaces around it, on average; numpy writes at most 25. The memory is
then known before the heights are parsed."""


def is_grid(path: Path) -> bool:
    """Return whether a file begins as an ASCII grid, whatever its suffix."""
    with path.open("rb") as file:
        return bool(re.match(rb"\s*(ncols|nrows)\s", file.read(100), re.IGNORECASE))


def read(path: Path, options: ReadOptions) -> Source:
    """Return the heights of a grid, whose first row has the highest y.

    CloudCompare writes points with the same suffix: rows of at least three numbers.

    Args:
        path: The .asc file.
        options: How to read the file.

    Warns:
        TerrainkitWarning: if cells are in degrees, as a .prj file beside it states, or not square.

    Raises:
        HeightFileError: if the header or the number of heights is wrong.
    """
    if not is_grid(path) and point_table.has_points(path, is_named=False):
        return point_table.read(path, options)
    found = decode(_read_grid, path)
    dx, dy, x, y, nodata = found["header"].tolist()
    projection = path.with_suffix(".prj")
    is_degrees = projection.is_file() and read_text(projection).lstrip()[:4].upper() == "GEOG"
    reference = Georeference(
        transform=(dx, 0.0, x, 0.0, -dy, y + len(found["heights"]) * dy),
        unit=None if is_degrees else 1.0,
        nodata=nodata,
    )
    return pixels_raster(path, found["heights"], reference, options)


def _read_grid(path: Path) -> dict[str, Any]:
    data = path.read_bytes()
    lines = re.match(rb"(?:\s*[A-Za-z]\w*[ \t]+[^\s]+[ \t]*\r?\n)*", data)
    assert lines is not None  # it matches any text
    words = lines[0].decode(errors="replace").lower().split()
    header = dict(zip(words[::2], map(float, words[1::2]), strict=True))
    if not any(keys <= header.keys() <= keys | _CORNERS for keys in _KEYS):
        raise ValueError(
            f"got an ASCII grid with {listing(header)} in its header; expected ncols, nrows, "
            "xllcorner, yllcorner, cellsize and NODATA_value"
        )
    text, rows, cols = data[lines.end() :], header["nrows"], header["ncols"]
    stated = f"its header states {rows:g} rows of {cols:g}"
    is_size = min(rows, cols) >= 1 and rows % 1 == cols % 1 == 0
    if not is_size or not 2 * rows * cols - 1 <= len(text) <= _MAX_WORD_BYTES * (rows * cols + 9):
        raise ValueError(f"got {len(text)} bytes of heights; {stated}")
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            heights = np.fromstring(text, sep=" ")
        except (DeprecationWarning, ValueError):
            raise ValueError("got text instead of heights") from None
    if len(heights) != rows * cols:
        raise ValueError(f"got {len(heights)} heights; {stated}")
    dx, dy = (header.get("cellsize", header.get(key, 0.0)) for key in ("dx", "dy"))
    x, y = (
        header.get(f"{axis}llcorner", header.get(f"{axis}llcenter", side / 2) - side / 2)
        for axis, side in (("x", dx), ("y", dy))
    )
    nodata = header.get("nodata_value", -9999.0)
    return {"header": [dx, dy, x, y, nodata], "heights": heights.reshape(int(rows), int(cols))}

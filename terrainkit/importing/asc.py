"""Read heights from an ESRI ASCII grid."""

import math
import re
import warnings
from pathlib import Path

import numpy as np

from terrainkit.errors import HeightFileError, listing
from terrainkit.importing.options import ReadOptions
from terrainkit.importing.raster import Raster, make_raster
from terrainkit.settings.text import truncate

SUFFIXES = (".asc",)

_KEYS = {"ncols", "nrows", "xllcorner", "yllcorner", "xllcenter", "yllcenter", "cellsize"}

_MAX_HEADER_BYTES = 1000


def read(path: Path, options: ReadOptions) -> Raster:
    """Return the heights of a grid, whose first row has the highest y.

    Raises:
        HeightFileError: if the header or the number of heights is wrong.
    """
    data = path.read_bytes()
    lines = re.match(rb"(?:\s*[A-Za-z]\w*[ \t]+[^\s]+[ \t]*\r?\n)*", data[:_MAX_HEADER_BYTES])
    start = lines.end() if lines else 0
    words = data[:start].decode(errors="replace").lower().split()
    header = {
        key: _number(path, key, text) for key, text in zip(words[::2], words[1::2], strict=True)
    }
    nodata = header.pop("nodata_value", -9999.0)
    if not {"ncols", "nrows", "cellsize"} <= header.keys() <= _KEYS:
        raise HeightFileError(
            f"{path}: got an ASCII grid with {listing(header)} in its header; expected ncols, "
            "nrows, xllcorner, yllcorner, cellsize and NODATA_value"
        )
    rows, cols, cell = header["nrows"], header["ncols"], header["cellsize"]
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            values = np.fromstring(data[start:], dtype=np.float64, sep=" ")
        except (DeprecationWarning, ValueError):
            raise HeightFileError(f"{path}: has text instead of heights") from None
    if not cell > 0 or min(rows, cols) < 1 or values.size != rows * cols:
        raise HeightFileError(
            f"{path}: got {values.size} heights with a cellsize of {cell:g}; its header states "
            f"{rows:g} rows of {cols:g}"
        )
    lower = [
        header.get(f"{axis}llcorner", header.get(f"{axis}llcenter", cell / 2) - cell / 2)
        for axis in "xy"
    ]
    return make_raster(
        path,
        values.reshape(int(rows), int(cols))[::-1].T,
        options,
        cell=cell,
        lower=(lower[0], lower[1]),
        nodata=nodata,
    )


def _number(path: Path, key: str, text: str) -> float:
    try:
        value = float(text)
        if math.isfinite(value) or key == "nodata_value":
            return value
    except ValueError:
        pass
    raise HeightFileError(f"{path}: {key}: got {truncate(text)}; expected a number")

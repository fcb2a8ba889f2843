"""Read heights from an ESRI ASCII grid."""

import math
import re
import warnings
from functools import partial
from itertools import chain
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import HeightFileError, listing
from terrainkit.files.memory import check_memory
from terrainkit.importing.georeference import Georeference
from terrainkit.importing.options import ReadOptions
from terrainkit.importing.pixels import pixels_raster
from terrainkit.importing.raster import BYTES_PER_VALUE, MAX_RELIEF, Raster
from terrainkit.settings.text import truncate
from terrainkit.settings.toml_text import read_text

SUFFIXES = (".asc",)

_CORNERS = {"xllcorner", "yllcorner", "xllcenter", "yllcenter"}
_KEYS = {"ncols", "nrows", "cellsize"}, {"ncols", "nrows", "dx", "dy"}
"""Required keys; GDAL writes dx and dy if cells are not square."""

_MAX_DEGREES_SIDE = 20.0
"""Longest side of a grid that is taken for degrees; the sizes of larger ones are warned of."""

_MAX_HEADER_BYTES = 1000

_BLOCK_BYTES = 1 << 20
"""Bytes that are parsed at once, so that memory and Ctrl-C do not depend on the file."""

_MAX_WORD_BYTES = 1000
"""Longest number; numpy writes at most about 330 digits."""

_SPACES = bytes.maketrans(b"\n\r\t\v\f", b"     ")


def is_grid(path: Path) -> bool:
    """Return whether a file begins as an ASCII grid, whatever its suffix."""
    with path.open("rb") as file:
        return bool(re.match(rb"\s*(ncols|nrows)\s", file.read(100), re.IGNORECASE))


def read(path: Path, options: ReadOptions) -> Raster:
    """Return the heights of a grid, whose first row has the highest y.

    Args:
        path: The .asc file.
        options: How to read the file.

    Warns:
        TerrainkitWarning: if cells are in degrees, as a .prj file beside it states, or not square.

    Raises:
        HeightFileError: if the header or the number of heights is wrong.
    """
    with path.open("rb") as file:
        start = file.read(_MAX_HEADER_BYTES)
        lines = re.match(rb"(?:\s*[A-Za-z]\w*[ \t]+[^\s]+[ \t]*\r?\n)*", start)
        length = lines.end() if lines else 0
        words = start[:length].decode(errors="replace").lower().split()
        header = {
            k: _number(path, k, text) for k, text in zip(words[::2], words[1::2], strict=True)
        }
        nodata = header.pop("nodata_value", -9999.0)
        rows, cols, dx, dy = _size(path, header, path.stat().st_size - length)
        file.seek(length)
        values = _read_values(path, file, rows * cols).reshape(rows, cols)
    x, y = (
        header.get(f"{axis}llcorner", header.get(f"{axis}llcenter", side / 2) - side / 2)
        for axis, side in (("x", dx), ("y", dy))
    )
    is_degrees = _is_in_degrees(path, values[values != nodata], (dx * cols, dy * rows), x, y)
    reference = Georeference(
        transform=(dx, 0.0, x, 0.0, -dy, y + rows * dy),
        unit=None if is_degrees else 1.0,
        nodata=nodata,
    )
    return pixels_raster(path, values, reference, options)


def _is_in_degrees(
    path: Path, known: NDArray[np.float64], sides: tuple[float, float], x: float, y: float
) -> bool:
    """Return whether positions are in degrees, by the .prj file or the values."""
    projection = path.with_suffix(".prj")
    if projection.is_file():
        return read_text(projection).lstrip().upper().startswith("GEOG")
    # The format has no units. In meters, such ground would be a tower.
    is_on_globe = 0 < abs(x) <= 180 and 0 < abs(y) <= 90 and max(sides) <= _MAX_DEGREES_SIDE
    return bool(is_on_globe and known.size and np.ptp(known) > MAX_RELIEF * max(sides))


def _size(path: Path, header: dict[str, float], num_bytes: int) -> tuple[int, int, float, float]:
    """Return rows, columns and the sides of a cell of a grid with so many bytes of heights."""
    if not any(keys <= header.keys() <= keys | _CORNERS for keys in _KEYS):
        raise HeightFileError(
            f"{path}: got an ASCII grid with {listing(header)} in its header; expected ncols, "
            "nrows, xllcorner, yllcorner, cellsize and NODATA_value"
        )
    rows, cols = header["nrows"], header["ncols"]
    dx, dy = (header.get("cellsize", header.get(key, 0.0)) for key in ("dx", "dy"))
    is_size = min(dx, dy) > 0 and min(rows, cols) >= 1 and rows % 1 == cols % 1 == 0
    # A height takes a digit and a space.
    if not is_size or 2 * rows * cols - 1 > num_bytes:
        raise HeightFileError(
            f"{path}: got {num_bytes} bytes of heights with a cellsize of {dx:g}; its header "
            f"states {rows:g} rows of {cols:g}"
        )
    return int(rows), int(cols), dx, dy


def _read_values(path: Path, file: BinaryIO, count: int) -> NDArray[np.float64]:
    """Return all values that follow; more or fewer than `count` are an error."""
    check_memory(count * BYTES_PER_VALUE, f"reading {count} heights from {path}")
    values, filled, rest = np.empty(count), 0, b""
    for block in chain(iter(partial(file.read, _BLOCK_BYTES), b""), [b" "]):
        # The last word may continue in the next block.
        text, _, rest = (rest + block.translate(_SPACES)).rpartition(b" ")
        found = _parse(path, text if len(rest) <= _MAX_WORD_BYTES else rest)
        if filled + len(found) > count:
            raise HeightFileError(f"{path}: got more than the {count} heights of its header")
        values[filled : filled + len(found)] = found
        filled += len(found)
    if filled < count:
        raise HeightFileError(f"{path}: got {filled} heights; its header states {count}")
    return values


def _parse(path: Path, text: bytes) -> NDArray[np.float64]:
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            return np.fromstring(text, dtype=np.float64, sep=" ")
        except (DeprecationWarning, ValueError):
            raise HeightFileError(f"{path}: has text instead of heights") from None


def _number(path: Path, key: str, text: str) -> float:
    try:
        value = float(text)
        if math.isfinite(value) or key == "nodata_value":
            return value
    except ValueError:
        pass
    raise HeightFileError(f"{path}: {key}: got {truncate(text)}; expected a number")

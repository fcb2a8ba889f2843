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
from terrainkit.importing.options import ReadOptions
from terrainkit.importing.raster import BYTES_PER_VALUE, Raster, make_raster
from terrainkit.settings.text import truncate

SUFFIXES = (".asc",)

_KEYS = {"ncols", "nrows", "xllcorner", "yllcorner", "xllcenter", "yllcenter", "cellsize"}

_MAX_HEADER_BYTES = 1000

_BLOCK_BYTES = 1 << 20
"""Bytes that are parsed at once, so that memory and Ctrl-C do not depend on the file."""

_MAX_WORD_BYTES = 1000
"""Longest number; numpy writes at most about 330 digits."""

_SPACES = bytes.maketrans(b"\n\r\t\v\f", b"     ")


def read(path: Path, options: ReadOptions) -> Raster:
    """Return the heights of a grid, whose first row has the highest y.

    Args:
        path: The .asc file.
        options: How to read the file.

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
        rows, cols, cell = _size(path, header, path.stat().st_size - length)
        file.seek(length)
        values = _read_values(path, file, rows * cols)
    lower = [
        header.get(f"{axis}llcorner", header.get(f"{axis}llcenter", cell / 2) - cell / 2)
        for axis in "xy"
    ]
    return make_raster(
        path,
        values.reshape(rows, cols)[::-1].T,
        options,
        cell=cell,
        lower=(lower[0], lower[1]),
        nodata=nodata,
    )


def _size(path: Path, header: dict[str, float], num_bytes: int) -> tuple[int, int, float]:
    """Return rows, columns and the cell [m] of a grid with so many bytes after its header."""
    if not {"ncols", "nrows", "cellsize"} <= header.keys() <= _KEYS:
        raise HeightFileError(
            f"{path}: got an ASCII grid with {listing(header)} in its header; expected ncols, "
            "nrows, xllcorner, yllcorner, cellsize and NODATA_value"
        )
    rows, cols, cell = header["nrows"], header["ncols"], header["cellsize"]
    is_size = cell > 0 and min(rows, cols) >= 1 and rows % 1 == cols % 1 == 0
    # A height takes a digit and a space.
    if not is_size or 2 * rows * cols - 1 > num_bytes:
        raise HeightFileError(
            f"{path}: got {num_bytes} bytes of heights with a cellsize of {cell:g}; its header "
            f"states {rows:g} rows of {cols:g}"
        )
    return int(rows), int(cols), cell


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

"""Read heights from a table of numbers in a text file."""

import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from terrainkit.importing.readers import asc, point_table
from terrainkit.importing.readers.height_source import Source, decode
from terrainkit.importing.readers.import_options import ReadOptions
from terrainkit.importing.readers.raster import make_raster
from terrainkit.settings.text import truncate

SUFFIXES = (".txt", ".csv")

_COMMENTS = ("#", "%", "//")
_DELIMITERS = (";", ",", "\t", " ")
_MAX_LINES = 20
"""Lines in which numbers have to begin."""

_MIN_POINTS = 50
"""Rows from which on few numbers in a row are taken for points (x, y, z)."""

_MIN_SHAPE = 10
"""Rows for each of more than three columns from which on they are."""


def read(path: Path, options: ReadOptions) -> Source:
    """Return the heights of a table: rows along x, columns along y, as numpy.savetxt writes arrays.

    Numbers are separated by commas, semicolons, tabs or spaces. Comments, lines of text and a line
    of sizes before the numbers, and pandas' numbers of rows and columns are skipped. Empty cells
    are missing heights. An ESRI ASCII grid is read as such, and points if a line names x, y and z.

    Args:
        path: The file.
        options: How to read the file.

    Raises:
        HeightFileError: if the file is no table of numbers.
        ConfigError: if an option is missing or does not apply.
    """
    if asc.is_grid(path):
        return asc.read(path, options)
    if point_table.has_points(path, is_named=True):
        return point_table.read(path, options)
    return make_raster(path, decode(_read_table, path)["heights"], options)


def _read_table(path: Path) -> dict[str, Any]:
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        stripped = (line.strip(" \r\n") for line in file)
        lines = [line for line in stripped if line and not line.startswith(_COMMENTS)]
    found = ((k, mark) for k, line in enumerate(lines[:_MAX_LINES]) for mark in _delimiters(line))
    start, delimiter = next((item for item in found if not _is_size(lines[item[0] :])), (0, ""))
    if not delimiter:
        raise ValueError("got text; expected a table of numbers")
    end = delimiter if lines[start].endswith(delimiter) else ""
    texts = [line.removesuffix(end) for line in lines[start:]]
    separator = None if delimiter == " " else delimiter
    try:
        table = np.loadtxt(
            texts, delimiter=separator, comments=None, ndmin=2, converters=_float_or_nan
        )
    except ValueError as error:
        reason = str(error).partition("; use")[0]
        hint = ""
        if re.search("columns changed .* at row 2$", reason):
            hint = f"; delete the line {truncate(lines[start])!r} if it is no row of heights"
        raise ValueError(reason + hint) from None
    # pandas numbers columns, in whole numbers above decimals, and rows below an empty cell.
    is_numbered = bool(np.isnan(table[0, 0]))
    if is_numbered or ("." not in lines[start] and (table[1:] % 1 != 0).any()):
        row = table[0, is_numbered:]
        if len(row) > 2 and np.array_equal(row, np.arange(len(row))):
            table = table[1:, is_numbered:]
    rows, cols = table.shape
    least = max(_MIN_POINTS, _MIN_SHAPE * cols if cols > 3 else 0)
    if min(rows, cols) < 2 or (cols > 2 and rows >= least):
        raise ValueError(
            f"got {rows} rows of {cols} numbers; expected a row of heights per line; rename points "
            "(x, y, z, others) to .xyz, or save a strip of heights as .npy"
        )
    return {"heights": table}


def _delimiters(line: str) -> Iterator[str]:
    """Yield the delimiters with which a line is a row of numbers."""
    for delimiter in _DELIMITERS:
        cells = line.split(None if delimiter == " " else delimiter)
        with suppress(ValueError):
            if not np.isnan([_float_or_nan(cell) for cell in cells]).all():
                yield delimiter


def _is_size(lines: list[str]) -> bool:
    """Return whether the first line states the numbers of the rows and columns that follow it."""
    numbers, cols = _cells(lines[0]), len(_cells(lines[1])) if len(lines) > 2 else 0
    return 0 < cols != len(numbers) and {len(lines) - 1, cols} <= set(numbers)


def _cells(line: str) -> list[float]:
    """Return the numbers of a row; none if it is text."""
    delimiter = next(_delimiters(line), None)
    text = line.strip().removesuffix(delimiter or "")
    cells = text.split(None if delimiter == " " else delimiter) if delimiter else ()
    return [_float_or_nan(cell) for cell in cells]


def _float_or_nan(text: str) -> float:
    return float(text.strip() or "nan")

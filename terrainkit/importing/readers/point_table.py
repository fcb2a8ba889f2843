"""Read points from a text file with a row of numbers for each point.

The first lines may name the columns, as CloudCompare (`//X Y Z R G B`), PDAL (`"X","Y","Z"`),
LAStools (`x y z classification`), ParaView and VeloView (`Points_m_XYZ:0`) and GDAL write them, or
state the number of points, as in .pts files of Leica.
"""

from collections.abc import Iterator
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from terrainkit.importing.readers.height_source import Source, decode
from terrainkit.importing.readers.import_options import ReadOptions
from terrainkit.importing.readers.point_cloud import make_point_source

SUFFIXES = (".xyz", ".pts", ".xyzn", ".xyzrgb")

_NAMES = tuple(
    {axis, f"{axis}(m)", f"{axis}[m]", f"{axis}_m", f"points:{k}", f"points_m_xyz:{k}", name, short}
    for k, (axis, name, short) in enumerate(
        [("x", "easting", "east"), ("y", "northing", "north"), ("z", "elevation", "height")]
    )
)
"""Names of the columns of x, y and z, in lower case and without spaces."""

_COMMENTS = ("#", "//")

_MAX_LINES = 20
"""Lines in which the points have to begin."""

_MAX_LINE = 10_000
"""Characters of a line that are looked at."""


class _Layout(NamedTuple):
    start: int
    """Number of lines before the points."""

    columns: list[int]
    """Columns of x, y and z."""

    delimiter: str | None
    """Delimiter; None for spaces."""

    num_columns: int
    """Number of columns without names; 0 if a line names them or none begins with a number."""


def read(path: Path, options: ReadOptions) -> Source:
    """Return the points of a table, with z up and in meters.

    Columns that no line names are x, y, z and others. Lines with one whole number are skipped.

    Raises:
        HeightFileError: if the file cannot be read, or has no points.
    """
    return make_point_source(path, decode(_read_points, path)["points"], options)


def has_points(path: Path, *, is_named: bool) -> bool:
    """Return whether the first lines name the columns, or have at least three numbers.

    Args:
        path: The file.
        is_named: Whether only names count.
    """
    layout = _find_layout(path)
    if layout.num_columns:
        return layout.num_columns >= 3 and not is_named
    return layout.start > 0


def _find_layout(path: Path) -> _Layout:
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        lines = [file.readline(_MAX_LINE).lower() for _ in range(_MAX_LINES)]
    for k, line in enumerate(lines):
        delimiter = _delimiter(line)
        words = line.lstrip("#/;%*$: ").split(delimiter)
        cells = [word.strip("\"' \t\r\n").replace(" ", "") for word in words]
        places = [[n for n, cell in enumerate(cells) if cell in names] for names in _NAMES]
        if all(places):
            delimiter = _delimiter("".join(lines[k + 1 : k + 3]))
            return _Layout(k + 1, [place[0] for place in places], delimiter, 0)
        if len(cells) > 1 and not line.lstrip().startswith(_COMMENTS):
            with suppress(ValueError):
                float(cells[0])
                return _Layout(k, [0, 1, 2], delimiter, len(cells))
    return _Layout(0, [0, 1, 2], None, 0)


def _delimiter(text: str) -> str | None:
    return next((mark for mark in ",;\t" if mark in text), None)


def _read_points(path: Path) -> dict[str, Any]:
    layout = _find_layout(path)

    def rows() -> Iterator[str]:
        with path.open(encoding="utf-8-sig", errors="replace") as file:
            for line in islice(file, layout.start, None):
                if not line.strip().isdigit():
                    yield line

    table: dict[str, Any] = {"usecols": layout.columns, "delimiter": layout.delimiter, "ndmin": 2}
    return {"points": np.loadtxt(rows(), comments=_COMMENTS, **table)}

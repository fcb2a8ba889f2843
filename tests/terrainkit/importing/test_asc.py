from contextlib import nullcontext

import numpy as np
import pytest

from terrainkit.errors import HeightFileError, TerrainkitWarning
from terrainkit.importing.asc import read
from terrainkit.importing.import_options import ReadOptions

GRID = """ncols 3
nrows 2
xllcorner 500000.0
yllcorner 5400000.5
cellsize 2.0
NODATA_value -9999
1.5 2 3
4 -9999 6.25
"""


@pytest.fixture
def read_text(tmp_path):
    def run(text, projection="", **options):
        (tmp_path / "a.asc").write_text(text)
        if projection:
            (tmp_path / "a.prj").write_text(projection)
        return read(tmp_path / "a.asc", ReadOptions(**options))

    return run


@pytest.mark.parametrize(
    ("old", "new", "lower"),
    [
        ("", "", (500000.0, 5400000.5)),
        ("2 3\n4", "\r\n2 3 4\n", (500000.0, 5400000.5)),  # rows may wrap
        ("xllcorner", "xllcenter", (499999.0, 5400000.5)),
        ("yllcorner", "YLLCENTER", (500000.0, 5399999.5)),
        ("xllcorner 500000.0\nyllcorner 5400000.5\n", "", (0.0, 0.0)),
        ("NODATA_value -9999\n", "", (500000.0, 5400000.5)),
    ],
    ids=["plain", "wrapped", "x center", "y center", "no corner", "no nodata"],
)
def test_asc_first_row_has_highest_y(read_text, old, new, lower):
    raster = read_text(GRID.replace(old, new), scale=0.5)
    np.testing.assert_array_equal(raster.values, [[2, 0.75], [np.nan, 1], [3.125, 1.5]])
    assert (raster.cell, raster.lower) == (2.0, lower)
    assert raster.upper == (lower[0] + 6, lower[1] + 4)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("6.25\n", "\n", r"got 5 heights; its header states 2 rows of 3"),
        ("6.25\n", "6.25 7\n", r"got 7 heights; its header states 2 rows of 3"),
        ("ncols 3", "ncols 300000000000", r"its header states 2 rows of 3e\+11"),
        ("nrows 2\n", "nrows 0.5\n", r"its header states 0\.5 rows of 3"),
        ("ncols 3\nnrows 2\n", "ncols -3\nnrows -2\n", r"its header states -2 rows of -3"),
        ("nrows 2", "nrows inf", r"its header states inf rows of 3"),
        ("nrows 2", "nrows two", "could not convert string to float: 'two'"),
        ("nrows 2\n", "", r"expected ncols, nrows"),
        ("nrows 2\n", "nrows 2\nnrovs 2\n", r"nrovs.* in its header; expected ncols, nrows"),
        ("cellsize 2.0", "cellsize 0", r"got cells of 0 x 0 m; expected"),
        ("6.25", "high", r"got text instead of heights"),
        pytest.param("6.25\n", "1 " * 3_000_000, "got 60000.. bytes of heights; its", id="more"),
        ("1.5 2 3\n4 -9999 6.25\n", "1 2  3 4 5 ", "got 5 heights; its header states 2 rows"),
        ("1.5 2 3\n4 -9999 6.25\n", "1 2 3 4 5", "got 9 bytes of heights; its header states"),
        pytest.param(GRID, "1 2\n", "ASCII grid with nothing in its header", id="no header"),
    ],
)
def test_asc_invalid_is_rejected(read_text, old, new, message):
    with pytest.raises(HeightFileError, match=message):
        read_text(GRID.replace(old, new))


# At latitude 60, a degree is 55.8 km along x and 111.4 km along y.
NORTH = GRID.replace("500000.0", "10").replace("5400000.5", "59.999").replace("2.0", "0.001")


@pytest.mark.parametrize(
    ("text", "projection", "spacing", "lower", "warning"),
    [
        (
            GRID.replace("cellsize 2.0", "dx 2\ndy 3"),
            "",
            (2, 3),
            (5e5, 5400000.5),
            "aspect ratio 1.5",
        ),
        (NORTH, "GEOGCS[]", (55.8, 111.4), (0, 0), "degrees at latitude 60, .*aspect ratio"),
        (NORTH, "PROJCS[]", (0.001, 0.001), (10, 59.999), "or positions in degrees"),
        (GRID, "PROJCS[]", (2, 2), (5e5, 5400000.5), None),
    ],
)
def test_asc_cells_become_squares_in_meters(read_text, text, projection, spacing, lower, warning):
    with pytest.warns(TerrainkitWarning, match=warning) if warning else nullcontext():
        raster = read_text(text, projection)
    assert raster.spacing == pytest.approx(spacing, rel=1e-3)
    assert raster.lower == pytest.approx(lower)

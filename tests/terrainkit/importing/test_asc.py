import tracemalloc

import numpy as np
import pytest

from terrainkit.errors import HeightFileError, MemoryLimitError
from terrainkit.files import memory
from terrainkit.importing import asc
from terrainkit.importing.asc import read
from terrainkit.importing.options import ReadOptions

GRID = """ncols 3
nrows 2
xllcorner 500000.0
yllcorner 5400000.5
cellsize 2.0
NODATA_value -9999
1.5 2 3
4 -9999 6.25
"""


def read_text(tmp_path, text, **options):
    (tmp_path / "a.asc").write_text(text)
    return read(tmp_path / "a.asc", ReadOptions(**options))


def test_asc_first_row_has_highest_y(tmp_path):
    raster = read_text(tmp_path, GRID)
    np.testing.assert_array_equal(raster.values, [[4, 1.5], [np.nan, 2], [6.25, 3]])
    assert raster.cell == 2.0
    assert raster.lower == (500000.0, 5400000.5)
    assert raster.upper == (500006.0, 5400004.5)


def test_asc_center_is_half_a_cell_inside(tmp_path):
    text = GRID.replace("xllcorner", "xllcenter").replace("yllcorner", "YLLCENTER")
    assert read_text(tmp_path, text).lower == (499999.0, 5399999.5)


def test_asc_rows_may_wrap(tmp_path):
    text = GRID.replace("2 3\n4", "\r\n2 3 4\n")
    raster = read_text(tmp_path, text)
    np.testing.assert_array_equal(raster.values, [[4, 1.5], [np.nan, 2], [6.25, 3]])


def test_asc_scale_is_of_heights(tmp_path):
    raster = read_text(tmp_path, GRID, scale=0.5)
    assert raster.values[2, 0] == 3.125
    assert raster.cell == 2.0


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("6.25\n", "\n", r"got 5 heights; its header states 6"),
        ("6.25\n", "6.25 7\n", r"got more than the 6 heights of its header"),
        ("ncols 3", "ncols 300000000000", r"got 21 bytes .* its header states 2 rows of 3e\+11"),
        ("nrows 2\n", "nrows 2.5\n", r"its header states 2\.5 rows of 3"),
        ("nrows 2", "nrows two", r"nrows: got two; expected a number"),
        ("nrows 2", "nrows inf", r"nrows: got inf; expected a number"),
        ("nrows 2\n", "", r"expected ncols, nrows"),
        ("cellsize 2.0", "cellsize 0", r"bytes of heights with a cellsize of 0"),
        ("6.25", "high", r"has text instead of heights"),
    ],
    ids=["short", "long", "huge", "fraction", "text", "infinite", "missing", "no size", "heights"],
)
def test_asc_invalid_is_rejected(tmp_path, old, new, message):
    with pytest.raises(HeightFileError, match=message):
        read_text(tmp_path, GRID.replace(old, new))


def test_asc_without_header_is_rejected(tmp_path):
    with pytest.raises(HeightFileError, match="got an ASCII grid with nothing in its header"):
        read_text(tmp_path, "1 2 3\n")


def test_asc_blocks_end_anywhere(tmp_path, monkeypatch):
    monkeypatch.setattr(asc, "_BLOCK_BYTES", 3)
    raster = read_text(tmp_path, GRID)
    np.testing.assert_array_equal(raster.values, [[4, 1.5], [np.nan, 2], [6.25, 3]])


def test_asc_memory_depends_on_the_header(tmp_path):
    text = f"ncols 3\nnrows 2\ncellsize 1\n{'1 ' * 10_000_000}"
    (tmp_path / "a.asc").write_text(text)
    tracemalloc.start()
    try:
        with pytest.raises(HeightFileError, match="got more than the 6 heights of its header"):
            read(tmp_path / "a.asc", ReadOptions())
        assert tracemalloc.get_traced_memory()[1] < 20e6
    finally:
        tracemalloc.stop()


def test_asc_memory_is_checked_before_parsing(tmp_path, monkeypatch):
    monkeypatch.setattr(memory, "MIN_CHECKED_BYTES", 0)
    monkeypatch.setattr(memory, "_free_memory", lambda: 100)
    monkeypatch.setattr(asc, "_parse", None)
    with pytest.raises(MemoryLimitError, match=r"reading 6 heights from .*a\.asc"):
        read_text(tmp_path, GRID)


def test_asc_without_spaces_is_rejected(tmp_path):
    with pytest.raises(HeightFileError, match="has text instead of heights"):
        read_text(tmp_path, GRID + "a" * 3_000_000)

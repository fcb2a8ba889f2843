import tracemalloc

import numpy as np
import pytest

from terrainkit.errors import HeightFileError, MemoryLimitError, TerrainkitWarning
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


@pytest.fixture
def read_text(tmp_path):
    def run(text, **options):
        (tmp_path / "a.asc").write_text(text)
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
@pytest.mark.parametrize("block", [3, 1 << 20])
def test_asc_first_row_has_highest_y(read_text, monkeypatch, block, old, new, lower):
    monkeypatch.setattr(asc, "_BLOCK_BYTES", block)
    raster = read_text(GRID.replace(old, new))
    np.testing.assert_array_equal(raster.values, [[4, 1.5], [np.nan, 2], [6.25, 3]])
    assert (raster.cell, raster.lower) == (2.0, lower)
    assert raster.upper == (lower[0] + 6, lower[1] + 4)


def test_asc_scale_is_of_heights(read_text):
    raster = read_text(GRID, scale=0.5)
    assert (raster.values[2, 0], raster.cell) == (3.125, 2.0)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("6.25\n", "\n", r"got 5 heights; its header states 6"),
        ("6.25\n", "6.25 7\n", r"got more than the 6 heights of its header"),
        ("ncols 3", "ncols 300000000000", r"got 21 bytes .* its header states 2 rows of 3e\+11"),
        ("nrows 2\n", "nrows 2.5\n", r"its header states 2\.5 rows of 3"),
        ("ncols 3\n", "ncols 0\n", r"its header states 2 rows of 0"),
        ("nrows 2", "nrows inf", r"nrows: got inf; expected a number"),
        ("nrows 2\n", "", r"expected ncols, nrows"),
        ("nrows 2\n", "nrows 2\nnrovs 2\n", r"nrovs.* in its header; expected ncols, nrows"),
        ("6.25", "high", r"has text instead of heights"),
        pytest.param("6.25\n", "a" * 3_000_000, "has text instead of heights", id="no spaces"),
        pytest.param(GRID, "1 2\n", "ASCII grid with nothing in its header", id="no header"),
    ],
)
def test_asc_invalid_is_rejected(read_text, old, new, message):
    with pytest.raises(HeightFileError, match=message):
        read_text(GRID.replace(old, new))


@pytest.mark.parametrize(("text", "fits"), [("1 2 3 4", True), ("1 2 3 ", False)])
def test_asc_size_is_checked_before_reading(read_text, text, fits):
    message = "its header states 2 rows of 2"
    text = f"ncols 2\nnrows 2\ncellsize 1\n{text}"
    if fits:
        assert read_text(text).values.tolist() == [[3, 1], [4, 2]]
    else:
        with pytest.raises(HeightFileError, match=message):
            read_text(text)


def test_asc_memory_depends_on_the_header(tmp_path):
    path = tmp_path / "a.asc"
    path.write_text(f"ncols 3\nnrows 2\ncellsize 1\n{'1 ' * 10_000_000}")
    tracemalloc.start()
    try:
        with pytest.raises(HeightFileError, match="got more than the 6 heights of its header"):
            read(path, ReadOptions())
        assert tracemalloc.get_traced_memory()[1] < 20e6
    finally:
        tracemalloc.stop()


def test_asc_memory_is_checked_before_parsing(read_text, monkeypatch):
    monkeypatch.setattr(memory, "MIN_CHECKED_BYTES", 0)
    monkeypatch.setattr(memory, "_free_memory", lambda: 100)
    monkeypatch.setattr(asc, "_parse", None)
    with pytest.raises(MemoryLimitError, match=r"reading 6 heights from .*a\.asc"):
        read_text(GRID)


# At latitude 60, a degree is 55.8 km along x and 111.4 km along y.
NORTH = GRID.replace("500000.0", "10").replace("5400000.5", "59.999").replace("2.0", "0.001")


@pytest.mark.parametrize(
    ("text", "projection", "spacing", "lower"),
    [
        (GRID.replace("cellsize 2.0", "dx 2\ndy 3"), "", (2, 3), (5e5, 5400000.5)),
        (NORTH, "GEOGCS[]", (55.8, 111.4), (0, 0)),
        (NORTH, "", (55.8, 111.4), (0, 0)),
    ],
    ids=["not square", ".prj", "a tower"],
)
def test_asc_cells_that_are_not_square(tmp_path, text, projection, spacing, lower):
    if projection:
        (tmp_path / "a.prj").write_text(projection)
    (tmp_path / "a.asc").write_text(text)
    with pytest.warns(TerrainkitWarning, match="got cells of .*aspect ratio"):
        raster = read(tmp_path / "a.asc", ReadOptions())
    assert raster.spacing == pytest.approx(spacing, rel=1e-3)
    assert raster.lower == lower
    if projection:
        (tmp_path / "a.prj").write_text("PROJCS[]")
        with pytest.warns(TerrainkitWarning, match="positions in degrees"):
            assert read(tmp_path / "a.asc", ReadOptions()).spacing == (0.001, 0.001)

from contextlib import nullcontext

import numpy as np
import pytest

from terrainkit.errors import HeightFileError, TerrainkitWarning
from terrainkit.importing.readers.asc import read
from terrainkit.importing.readers.import_options import ReadOptions
from tests.tables import read_table

GRID = read_table(__file__, "grid")


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
    read_table(__file__, "asc_first_row_has_highest_y"),
    ids=["plain", "wrapped", "x center", "y center", "no corner", "no nodata"],
)
def test_asc_first_row_has_highest_y(read_text, old, new, lower):
    raster = read_text(GRID.replace(old, new), scale=0.5)
    np.testing.assert_array_equal(raster.values, [[2, 0.75], [np.nan, 1], [3.125, 1.5]])
    assert (raster.cell, *raster.lower) == (2.0, *lower)
    assert raster.upper == (lower[0] + 6, lower[1] + 4)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        *read_table(__file__, "asc_invalid_is_rejected"),
        pytest.param("6.25\n", "1 " * 3_000_000, "got 60000.. bytes of heights; its", id="more"),
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

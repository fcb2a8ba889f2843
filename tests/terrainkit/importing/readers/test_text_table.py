import numpy as np
import pytest

from terrainkit.errors import HeightFileError
from terrainkit.importing.readers.import_options import ReadOptions
from terrainkit.importing.readers.text_table import read
from tests.tables import read_table

METER = ReadOptions(file_cell=1.0)


@pytest.fixture
def read_text(tmp_path):
    def run(text, name="a.csv"):
        (tmp_path / name).write_bytes(text.encode())
        return read(tmp_path / name, METER)

    return run


@pytest.mark.parametrize("text", read_table(__file__, "text_has_rows_along_x"))
@pytest.mark.parametrize("name", ["a.csv", "A.TXT"])
def test_text_has_rows_along_x(read_text, text, name):
    raster = read_text(text, name)
    assert raster.values.tolist() == [[0.5, 1, 2], [3, -4, 5]]
    assert raster.upper == (2.0, 3.0)


def test_text_empty_cells_are_missing(read_text):
    values = read_text("1,,3\n4,nan,6\n,8,9\n").values
    np.testing.assert_array_equal(values, [[1, np.nan, 3], [4, np.nan, 6], [np.nan, 8, 9]])


@pytest.mark.parametrize(("text", "first"), read_table(__file__, "text_row_and_column_of_pandas"))
def test_text_row_and_column_of_pandas_are_skipped(read_text, text, first):
    np.testing.assert_array_equal(read_text(text).values[0], first)


def test_text_of_an_ascii_grid_is_one(tmp_path):
    (tmp_path / "a.txt").write_text("NCOLS 2\nnrows 1\ncellsize 3\n1 2\n")
    raster = read(tmp_path / "a.txt", ReadOptions())
    assert (raster.values.tolist(), raster.cell) == ([[1], [2]], 3.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("hello\n" * 9, "got text; expected a table of numbers"),
        ("1 2 3\n4 5\n", r"columns changed from 3 to 2 at row 2; delete the line '1 2 3' if it is"),
        ("1 2 3\n4 5 6\n7 8\n", r"columns changed from 3 to 2 at row 3$"),
        ("n m\n4 3 0.5\n" + "1 2\n" * 3, r"at row 2; delete the line '4 3 0\.5' if it is no row"),
        ("1 2 3\n4 five 6\n", "could not convert string 'five' to float64 at row 1"),
        ("1\n2\n3\n", "got 3 rows of 1 numbers; expected a row of heights per line"),
        (
            "0.1 0.2 0.3\n" * 50,
            r"got 50 rows of 3 numbers; .* rename points \(x, y, z, o.*\) to \.xyz",
        ),
        ("\0" * 99, "got text"),
    ],
)
def test_text_without_a_table_is_rejected(read_text, text, message):
    with pytest.raises(HeightFileError, match=rf"a\.csv: cannot be read: .*{message}"):
        read_text(text)

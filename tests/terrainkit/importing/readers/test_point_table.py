import numpy as np
import pytest

from terrainkit.errors import HeightFileError
from terrainkit.importing.readers.height_source import open_source
from terrainkit.importing.readers.import_options import ReadOptions
from terrainkit.importing.readers.point_cloud import PointSource
from tests.tables import read_table

EXPECTED = [[1, 2, 7], [4, 6, 8.5], [5, 9, -1]]


@pytest.mark.parametrize(("name", "text"), read_table(__file__, "points"))
def test_table_has_its_points(tmp_path, name, text):
    (tmp_path / name).write_bytes(text.encode())
    source = open_source(tmp_path / name, ReadOptions())
    assert isinstance(source, PointSource)
    assert source.vertices.tolist() == EXPECTED


def test_table_of_many_columns_without_names_is_rejected(tmp_path):
    rows = np.random.default_rng(0).random((80, 7))
    for name, count in (("a.csv", 70), ("b.txt", 69)):
        np.savetxt(tmp_path / name, rows[:count], delimiter=",")
    with pytest.raises(HeightFileError, match=r"got 70 rows of 7 numbers; .*rename points.*\.npy$"):
        open_source(tmp_path / "a.csv", ReadOptions(file_cell=1.0))
    source = open_source(tmp_path / "b.txt", ReadOptions(file_cell=1.0))
    assert source.upper == (69.0, 7.0)


@pytest.mark.parametrize(("name", "text"), read_table(__file__, "no_points"))
def test_damaged_table_is_rejected(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    with pytest.raises(HeightFileError, match=rf"^\S*{name}: cannot be read: "):
        open_source(tmp_path / name, ReadOptions())

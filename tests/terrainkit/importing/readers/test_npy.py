import numpy as np
import pytest

from terrainkit.errors import HeightFileError
from terrainkit.importing.readers.import_options import ReadOptions
from terrainkit.importing.readers.npy import read

METER = ReadOptions(file_cell=1.0)


@pytest.fixture
def path(tmp_path):
    """Return the path of an array of 3 x 2 heights."""
    np.save(tmp_path / "a.npy", np.arange(6, dtype=np.float32).reshape(3, 2))
    return tmp_path / "a.npy"


def test_npy_first_index_is_x(path):
    raster = read(path, METER)
    assert raster.values.tolist() == [[0, 1], [2, 3], [4, 5]]
    assert raster.upper == (3.0, 2.0)


@pytest.mark.parametrize(
    "array",
    [
        np.zeros(3),
        np.zeros((2, 2, 2)),
        np.zeros((0, 4)),
        np.zeros((2, 2), complex),
        np.array([["a"]]),
        np.array([[{}]]),
        np.full((2, 2), 1.1e6, np.float32),
    ],
    ids=["1_axis", "3_axes", "empty", "complex", "text", "object", "high"],
)
def test_npy_without_heights_is_rejected(path, array):
    np.save(path, array, allow_pickle=True)
    with pytest.raises(HeightFileError):
        read(path, METER)


@pytest.mark.parametrize("old", [b"{'descr", b"'<f4'", b"False", b"(3, 2)", b"}"])
@pytest.mark.parametrize("new", [b"", b"(", b"[" * 200, b"\xff", b"1j", b"(9999999999999, 2)"])
def test_npy_that_is_damaged_is_rejected(path, old, new):
    data = path.read_bytes()
    path.write_bytes(data.replace(old, new, 1) if new else data[:-1])
    with pytest.raises(HeightFileError, match=r"a\.npy: cannot be read: "):
        read(path, METER)


def test_npz_with_one_grid_or_a_key(tmp_path):
    path, grid = tmp_path / "a.npz", np.arange(6.0).reshape(2, 3)
    np.savez(path, x=np.arange(3), z=grid)
    assert read(path, METER).values.tolist() == grid.tolist()
    np.savez(path, a=grid, b=2 * grid)
    with pytest.raises(
        HeightFileError, match=r"got key '' and the grids a, b; `key=a` selects one"
    ):
        read(path, METER)
    assert read(path, ReadOptions(file_cell=1.0, key="b")).values[1, 2] == 10
    with pytest.raises(HeightFileError, match=r"got key 'c' and the grids a, b; `key=a` selects"):
        read(path, ReadOptions(file_cell=1.0, key="c"))
    path.write_bytes(b"PK")
    with pytest.raises(HeightFileError, match=r"a\.npz: cannot be read"):
        read(path, METER)

import numpy as np
import pytest

from terrainkit.errors import HeightFileError, TerrainkitError
from terrainkit.importing.npy import read
from terrainkit.importing.options import ReadOptions

METER = ReadOptions(file_cell=1.0)


def test_npy_first_index_is_x(tmp_path):
    heights = np.arange(6.0).reshape(3, 2)
    np.save(tmp_path / "a.npy", heights)
    raster = read(tmp_path / "a.npy", METER)
    np.testing.assert_array_equal(raster.values, heights)
    assert raster.upper == (3.0, 2.0)


@pytest.mark.parametrize(
    "array",
    [
        np.zeros(3),
        np.zeros((2, 2, 2)),
        np.zeros((0, 4)),
        np.zeros((2, 2), complex),
        np.array([["a"]]),
        np.full((2, 2), np.inf),
        np.full((2, 2), 1e300),
        np.full((2, 2), 1.1e6, np.float32),
    ],
    ids=["one axis", "three axes", "empty", "complex", "text", "infinite", "huge", "too high"],
)
def test_npy_without_heights_is_rejected(tmp_path, array):
    np.save(tmp_path / "a.npy", array)
    with pytest.raises(HeightFileError):
        read(tmp_path / "a.npy", METER)


def test_npy_with_objects_is_rejected(tmp_path):
    np.save(tmp_path / "a.npy", np.array([[{}]]), allow_pickle=True)
    with pytest.raises(HeightFileError):
        read(tmp_path / "a.npy", METER)


def test_npy_truncated_is_rejected(tmp_path):
    np.save(tmp_path / "a.npy", np.zeros((50, 50)))
    data = (tmp_path / "a.npy").read_bytes()
    (tmp_path / "a.npy").write_bytes(data[:-8])
    with pytest.raises(HeightFileError, match=r"not an \.npy file, or truncated"):
        read(tmp_path / "a.npy", METER)


@pytest.mark.parametrize("count", [b"9" * 12, b"9" * 30])
def test_npy_that_claims_huge_size_is_rejected(tmp_path, count):
    np.save(tmp_path / "a.npy", np.zeros((50, 50)))
    data = (tmp_path / "a.npy").read_bytes()
    (tmp_path / "a.npy").write_bytes(data.replace(b"50, 50", count[:30] + b", 5").ljust(len(data)))
    with pytest.raises(TerrainkitError):
        read(tmp_path / "a.npy", METER)


@pytest.mark.parametrize("old", [b"{'descr", b"'<f4'", b"False", b"(2, 3)", b"}"])
@pytest.mark.parametrize("new", [b"", b"(", b"'", b"{", b"[" * 200, b"\xff", b"\0", b"1j"])
def test_npy_with_damaged_header_is_rejected(tmp_path, old, new):
    path = tmp_path / "a.npy"
    np.save(path, np.zeros((2, 3), np.float32))
    path.write_bytes(path.read_bytes().replace(old, new, 1))
    with pytest.raises(HeightFileError, match=r"a\.npy: "):
        read(path, METER)

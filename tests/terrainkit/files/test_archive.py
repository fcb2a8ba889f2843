import zipfile

import numpy as np
import pytest

from terrainkit.errors import MapFileError
from terrainkit.files.archive import open_archive


@pytest.fixture
def path(tmp_path):
    np.savez(
        tmp_path / "some.npz",
        heights=np.arange(6, dtype=np.float32).reshape(2, 3),
        cell=np.float64(0.1),
        lower=np.array([-1.0, 2.0]),
        count=np.int64(3),
        words=np.array(["slope", "\N{MOUNTAIN}"]),
        note=np.array("gr\u00fcn"),
    )
    return tmp_path / "some.npz"


@pytest.fixture
def archive(path):
    with open_archive(path) as archive:
        yield archive


def test_archive_lists_array_names(archive):
    assert archive.names() == {"heights", "cell", "lower", "count", "words", "note"}


@pytest.mark.parametrize(
    ("key", "kind", "shape"),
    [
        ("heights", "f4", (2, 3)),
        ("heights", "f4", (None, 3)),
        ("heights", "f", (None, None)),
        ("count", "i", ()),
        ("words", "U", (2,)),
    ],
)
def test_archive_reads_expected_array(archive, key, kind, shape):
    array = archive.array(key, kind, shape)
    assert len(array.shape) == len(shape)
    assert array.dtype.kind == kind[0]


def test_archive_check_value_accepts_equal_values(archive):
    assert archive.array("heights", "f4", (2, 3)).tolist() == [[0, 1, 2], [3, 4, 5]]
    assert archive.array("words", "U", (2,)).tolist() == ["slope", "\N{MOUNTAIN}"]
    assert archive.text("note") == "gr\u00fcn"


@pytest.mark.parametrize(
    ("key", "kind", "shape", "message"),
    [
        ("heights", "f8", (2, 3), "heights: got dtype float32; expected float64"),
        ("heights", "i", (2, 3), "heights: got dtype float32; expected integers"),
        ("heights", "U", (2, 3), "heights: got dtype float32; expected a string"),
        ("heights", "f4", (3, 2), r"heights: got shape \(2, 3\); expected \(3, 2\)"),
        ("heights", "f4", (None,), r"heights: got shape \(2, 3\); expected \(any\)"),
        ("depths", "f4", (2, 3), "has no depths"),
    ],
)
def test_archive_rejects_unexpected_array(archive, key, kind, shape, message):
    with pytest.raises(MapFileError, match=message):
        archive.array(key, kind, shape)


def test_archive_rejects_foreign_byte_order(tmp_path):
    np.savez(tmp_path / "big.npz", heights=np.zeros(2, dtype=">f4"))
    with (
        open_archive(tmp_path / "big.npz") as archive,
        pytest.raises(MapFileError, match="heights: got dtype >f4; expected float32"),
    ):
        archive.array("heights", "f4", (2,))


@pytest.mark.parametrize(
    ("code", "is_valid"),
    [
        (0xD7FF, True),
        (0xD800, False),
        (0xDFFF, False),
        (0xE000, True),
        (0x10FFFF, True),
        (0x110000, False),
    ],
)
def test_archive_rejects_code_points_that_are_not_unicode(tmp_path, code, is_valid):
    note = np.frombuffer(np.uint32(code).tobytes(), dtype="<U1").reshape(())
    np.savez(tmp_path / "note.npz", note=note)
    with open_archive(tmp_path / "note.npz") as archive:
        if is_valid:
            assert archive.text("note") == chr(code)
        else:
            with pytest.raises(MapFileError, match="note"):
                archive.text("note")


def test_archive_limit_is_inclusive(archive):
    assert archive.array("heights", "f4", (2, 3), limit=24).nbytes == 24
    with pytest.raises(MapFileError, match="heights: got 24 bytes; expected at most 23"):
        archive.array("heights", "f4", (2, 3), limit=23)


@pytest.mark.parametrize(("key", "wanted"), [("cell", 0.1), ("lower", (-1.0, 2.0))])
def test_archive_check_value_accepts_rounding(archive, key, wanted):
    archive.check_value(key, wanted)


@pytest.mark.parametrize(("key", "wanted"), [("cell", 0.1001), ("lower", (2.0, -1.0))])
def test_archive_check_value_rejects_others(archive, key, wanted):
    with pytest.raises(MapFileError, match=f"{key}: got .*; expected .* by its config"):
        archive.check_value(key, wanted)


def test_archive_path_may_be_a_string(path):
    with open_archive(str(path)) as archive:
        assert archive.path == path


def test_archive_rejects_huge_header(tmp_path):
    path = tmp_path / "bomb.npz"
    header = b"\x93NUMPY\x02\x00" + (1 << 31).to_bytes(4, "little")
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("heights.npy", header + b" " * 10**6)
    with (
        pytest.raises(MapFileError, match="its header is longer than 10000 bytes"),
        open_archive(path) as archive,
    ):
        archive.array("heights", "f4", (3,))

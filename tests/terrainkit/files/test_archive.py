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
    ("key", "kind", "shape", "expected"),
    [
        ("heights", "f4", (2, 3), [[0, 1, 2], [3, 4, 5]]),
        ("heights", "f4", (None, 3), [[0, 1, 2], [3, 4, 5]]),
        ("heights", "f", (None, None), [[0, 1, 2], [3, 4, 5]]),
        ("count", "i", (), 3),
        ("words", "U", (2,), ["slope", "\N{MOUNTAIN}"]),
    ],
)
def test_archive_reads_expected_array(archive, key, kind, shape, expected):
    array = archive.array(key, kind, shape)
    assert (array.dtype.kind, array.tolist()) == (kind[0], expected)


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
    message = "heights: got dtype >f4; expected float32"
    with open_archive(tmp_path / "big.npz") as big, pytest.raises(MapFileError, match=message):
        big.array("heights", "f4", (2,))


@pytest.mark.parametrize(
    ("valid", "invalid"), [(0xD7FF, 0xD800), (0xE000, 0xDFFF), (0x10FFFF, 0x110000)]
)
def test_archive_rejects_code_points_that_are_not_unicode(tmp_path, valid, invalid):
    codes = np.array([[valid], [invalid]], np.uint32)
    notes = [np.frombuffer(code.tobytes(), dtype="<U1").reshape(()) for code in codes]
    np.savez(tmp_path / "notes.npz", valid=notes[0], invalid=notes[1])
    with open_archive(tmp_path / "notes.npz") as archive:
        assert archive.text("valid") == chr(valid)
        with pytest.raises(MapFileError, match="invalid contains invalid Unicode"):
            archive.text("invalid")


def test_archive_limit_is_inclusive(archive):
    assert archive.array("heights", "f4", (2, 3), limit=24).nbytes == 24
    with pytest.raises(MapFileError, match="heights: got 24 bytes; expected at most 23"):
        archive.array("heights", "f4", (2, 3), limit=23)


@pytest.mark.parametrize(
    ("key", "equal", "other"),
    [("cell", 0.1 + 1e-9, 0.1 + 2e-9), ("lower", (-1.0, 2.0), (2.0, -1.0))],
)
def test_archive_check_value_accepts_rounding(archive, key, equal, other):
    archive.check_value(key, equal)
    with pytest.raises(MapFileError, match=f"{key}: got .*; expected .* by its config"):
        archive.check_value(key, other)


def test_archive_names_the_reason_of_the_system():
    message = "^cannot read a+: File name too long$"
    with pytest.raises(MapFileError, match=message), open_archive("a" * 300):
        pass


@pytest.mark.parametrize(
    ("head", "message"),
    [
        (b"\x01\x00\xff\xff", "heights cannot be read: Header info length "),
        (b"\x02\x00" + (1 << 31).to_bytes(4, "little"), r"an unknown \.npy version \(2, 0\)"),
    ],
)
def test_archive_rejects_unusual_header(tmp_path, head, message):
    path = tmp_path / "bomb.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("heights.npy", b"\x93NUMPY" + head + b" " * 10**6)
    with pytest.raises(MapFileError, match=message), open_archive(path) as archive:
        archive.array("heights", "f4", (3,))

import os

import pytest

from terrainkit_robots.files import SpecialFileError, open_regular


def test_open_regular(tmp_path):
    (tmp_path / "file").write_bytes(b"data")
    with open_regular(tmp_path / "file") as stream:
        assert stream.read() == b"data"


def test_open_regular_rejects_special_files(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path, kind in ((tmp_path, "a folder"), (tmp_path / "pipe", "a pipe")):
        with pytest.raises(SpecialFileError, match=f"is {kind}, not a file"):
            open_regular(path)


def test_open_regular_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError):
        open_regular(tmp_path / "missing")

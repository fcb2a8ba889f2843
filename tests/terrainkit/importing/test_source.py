from pathlib import Path

import pytest

import terrainkit
from terrainkit import importing
from terrainkit.errors import HeightFileError
from terrainkit.importing import source
from terrainkit.importing.source import check_file


def test_check_file_limits_the_size(tmp_path, monkeypatch):
    path = tmp_path / "a.stl"
    path.write_bytes(bytes(684))
    check_file(path)
    monkeypatch.setattr(source, "MAX_FILE_BYTES", 100)
    with pytest.raises(HeightFileError, match=r"a\.stl: got 684 bytes; expected at most 100$"):
        check_file(path)


def test_check_file_rejects_empty_file(tmp_path):
    path = tmp_path / "a.glb"
    path.touch()
    with pytest.raises(HeightFileError, match=r"a\.glb: got an empty file$"):
        check_file(path)


def test_check_file_names_the_reason_of_the_system():
    with pytest.raises(HeightFileError, match=r"^cannot read a+: .*File name too long"):
        check_file(Path("a" * 300))


def test_importing_has_the_names_of_terrainkit_only():
    assert importing.import_map is terrainkit.import_map
    with pytest.raises(AttributeError, match="no attribute 'import_maps'"):
        _ = importing.import_maps

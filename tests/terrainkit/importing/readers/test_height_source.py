from pathlib import Path

import numpy as np
import pytest

import terrainkit
from terrainkit import importing
from terrainkit.errors import HeightFileError
from terrainkit.importing.readers import height_source
from terrainkit.importing.readers.height_source import check_file, fill_missing, open_source
from terrainkit.importing.readers.import_options import ReadOptions


@pytest.mark.parametrize(
    ("size", "message"),
    [
        (0, r"a\.stl: got an empty file$"),
        (100, None),
        (101, r"a\.stl: got 101 bytes; expected at most 100$"),
    ],
)
def test_check_file_limits_the_size(tmp_path, monkeypatch, size, message):
    monkeypatch.setattr(height_source, "MAX_FILE_BYTES", 100)
    path = tmp_path / "a.stl"
    path.write_bytes(bytes(size))
    if message:
        with pytest.raises(HeightFileError, match=message):
            check_file(path)
    else:
        check_file(path)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("a.FBX", r"a\.FBX: no reader for '\.FBX'; convert it with Blender \(File"),
        ("a.e57", "convert it with PDAL .pdal translate a.e57 a.laz"),
        ("a.dwg", "ODA File Converter"),
        ("a.docx", r"no reader for '\.docx' .*; there are: \.asc, "),
    ],
)
def test_file_without_reader_names_the_converter(name, message):
    with pytest.raises(HeightFileError, match=message):
        open_source(Path(name), ReadOptions())


def test_check_file_names_the_reason_of_the_system():
    with pytest.raises(HeightFileError, match=r"^cannot read a+: .*File name too long"):
        check_file(Path("a" * 300))


def test_importing_has_the_names_of_terrainkit_only():
    assert importing.import_map is terrainkit.import_map
    with pytest.raises(AttributeError, match="no attribute 'import_maps'"):
        _ = importing.import_maps


def test_fill_missing_refuses_what_is_mostly_missing():
    heights = np.full((10, 10), np.nan)
    heights[0, :9] = 1.0  # 91 of 100 are missing
    places = np.arange(10.0)
    with pytest.raises(HeightFileError, match=r"91 of 100 .* expected at most 90%; `missing='low"):
        fill_missing(Path("a.stl"), heights, "nearest", places, places)
    assert (fill_missing(Path("a.stl"), heights, "lowest", places, places) == 1).all()

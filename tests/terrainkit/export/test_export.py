import dataclasses
import inspect
from pathlib import Path

import numpy as np
import pytest

from terrainkit.errors import ExportError
from terrainkit.export import (
    check_export,
    export_options,
    exporters_by_suffix,
    get_exporter,
)

every_suffix = pytest.mark.parametrize("suffix", sorted(exporters_by_suffix()))


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_export_has_the_usual_formats():
    assert set(exporters_by_suffix()) >= {".npz", ".png", ".stl", ".ply", ".obj", ".glb", ".xml"}


@every_suffix
def test_exporter_is_uniform(suffix):
    exporter = exporters_by_suffix()[suffix]
    assert exporter.BYTES_PER_SAMPLE >= 0
    map_, path, *options = inspect.signature(exporter.export).parameters.values()
    assert (map_.name, path.name) == ("terrain_map", "path")
    assert all(option.kind is option.KEYWORD_ONLY for option in options)


@every_suffix
def test_export_writes_to_the_given_path(level_map, tmp_path, suffix):
    path = tmp_path / f"map{suffix}"
    assert level_map.save(path) == path
    assert path.stat().st_size > 0
    assert {Path(name).stem for name in names(tmp_path)} == {"map"}


@every_suffix
def test_export_accepts_uppercase_suffix(level_map, tmp_path, suffix):
    path = tmp_path / f"MAP{suffix.upper()}"
    assert level_map.save(str(path)) == path
    assert path.is_file()


@every_suffix
def test_export_is_deterministic(level_map, tmp_path, suffix):
    folders = [tmp_path / "a", tmp_path / "b"]
    for folder in folders:
        folder.mkdir()
    first, second = (level_map.save(folder / f"map{suffix}") for folder in folders)
    assert first.read_bytes() == second.read_bytes()


@every_suffix
def test_export_keeps_existing_file_by_default(level_map, tmp_path, suffix):
    path = tmp_path / f"map{suffix}"
    path.write_text("mine")
    with pytest.raises(ExportError, match=rf"map\{suffix} exists"):
        level_map.save(path)
    assert path.read_text() == "mine"
    assert names(tmp_path) == [f"map{suffix}"]
    level_map.save(path, overwrite=True)
    assert path.read_bytes() != b"mine"


@pytest.mark.parametrize("name", ["map.fbx", "map", "npz", "map.npz.bak", ".npz"])
def test_export_unknown_suffix_lists_formats(level_map, tmp_path, name):
    with pytest.raises(ExportError, match=r"no format for .*; there are: ") as error:
        level_map.save(tmp_path / name)
    assert all(part in str(error.value) for part in (name, *exporters_by_suffix()))
    assert names(tmp_path) == []


@pytest.mark.parametrize(
    ("name", "option", "known"),
    [
        ("map.stl", "color", "full, closed, y_up"),
        ("map.xml", "merged", "collision"),
        ("map.npz", "merged", "mesh"),
        ("map.png", "merged", "nothing"),
    ],
)
def test_export_unknown_option_lists_options(level_map, tmp_path, name, option, known):
    with pytest.raises(ExportError, match=f"got '{option}'; expected {known}"):
        level_map.save(tmp_path / name, **{option: True})
    assert names(tmp_path) == []


def test_export_options_lists_names():
    assert export_options(Path("map.glb")) == ("full", "closed", "y_up")


def test_exporters_by_suffix_share_a_module():
    assert get_exporter(Path("a.stl")) is get_exporter(Path("b.OBJ"))


def test_check_export_rejects_before_generation(tmp_path):
    path = tmp_path / "map.npz"
    check_export(path, 100)
    path.write_text("mine")
    check_export(path, 100, overwrite=True)
    with pytest.raises(ExportError, match=r"map\.npz exists"):
        check_export(path, 100)
    with pytest.raises(ExportError, match=r"no format for '\.fbx'"):
        check_export(tmp_path / "map.fbx", 100)
    assert path.read_text() == "mine"


@pytest.mark.parametrize("height", [np.nan, np.inf, 1e30])
@pytest.mark.parametrize("suffix", [".npz", ".xml", ".stl", ".png"])
def test_export_rejects_non_finite_heights(terrain_map, tmp_path, suffix, height):
    heights = terrain_map.heights.copy()
    heights[3, 4] = height
    broken = dataclasses.replace(terrain_map, heights=heights)
    with pytest.raises(ExportError, match="heights has values that are not finite or beyond"):
        broken.save(tmp_path / f"a{suffix}")
    assert list(tmp_path.iterdir()) == []

import dataclasses
import inspect
from pathlib import Path

import numpy as np
import pytest

from terrainkit.errors import ExportError
from terrainkit.export import (
    check_export,
    export,
    export_options,
    exporters_by_suffix,
    get_exporter,
)

every_suffix = pytest.mark.parametrize("suffix", sorted(exporters_by_suffix()))


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_the_formats_of_the_field_are_there():
    assert set(exporters_by_suffix()) >= {".npz", ".png", ".stl", ".ply", ".obj", ".glb", ".xml"}


@every_suffix
def test_an_exporter_takes_a_map_a_path_and_options_by_keyword(suffix):
    map_, path, *options = inspect.signature(
        exporters_by_suffix()[suffix].export
    ).parameters.values()
    assert (map_.name, path.name) == ("terrain_map", "path")
    assert all(option.kind is option.KEYWORD_ONLY for option in options)


@every_suffix
def test_a_file_is_written_where_it_was_asked_for(level_map, tmp_path, suffix):
    path = tmp_path / f"map{suffix}"
    assert export(level_map, path) == path
    assert path.stat().st_size > 0
    assert {Path(name).stem for name in names(tmp_path)} == {"map"}


@every_suffix
def test_a_suffix_in_capitals_names_the_same_format(level_map, tmp_path, suffix):
    path = tmp_path / f"MAP{suffix.upper()}"
    assert export(level_map, str(path)) == path
    assert path.is_file()


@every_suffix
def test_the_same_map_gives_the_same_bytes(level_map, tmp_path, suffix):
    first, second = (export(level_map, tmp_path / f"{name}{suffix}") for name in "ab")
    assert first.read_bytes() == second.read_bytes()


@every_suffix
def test_an_existing_file_is_kept_unless_told(level_map, tmp_path, suffix):
    path = tmp_path / f"map{suffix}"
    path.write_text("mine")
    with pytest.raises(ExportError, match=rf"map\{suffix} exists"):
        export(level_map, path)
    assert path.read_text() == "mine"
    assert names(tmp_path) == [f"map{suffix}"]
    export(level_map, path, overwrite=True)
    assert path.read_bytes() != b"mine"


@pytest.mark.parametrize("name", ["map.usd", "map", "npz", "map.npz.bak", ".npz"])
def test_an_unknown_suffix_is_an_error_that_lists_those_there_are(level_map, tmp_path, name):
    with pytest.raises(ExportError, match=r"no format for .*; there are: ") as error:
        export(level_map, tmp_path / name)
    assert all(part in str(error.value) for part in (name, *exporters_by_suffix()))
    assert names(tmp_path) == []


@pytest.mark.parametrize(
    ("name", "option", "known"),
    [
        ("map.stl", "color", "full, closed, y_up"),
        ("map.xml", "merged", "collision"),
        ("map.npz", "merged", "nothing"),
    ],
)
def test_an_unknown_option_is_an_error_that_lists_those_there_are(
    level_map, tmp_path, name, option, known
):
    with pytest.raises(ExportError, match=f"has no option '{option}'; it has: {known}"):
        export(level_map, tmp_path / name, **{option: True})
    assert names(tmp_path) == []


def test_the_options_of_a_format_are_known_by_name():
    assert export_options(Path("map.glb")) == ("full", "closed", "y_up")


def test_formats_of_one_kind_share_an_exporter():
    assert get_exporter(Path("a.stl")) is get_exporter(Path("b.OBJ"))


def test_a_target_is_checked_before_a_map_is_made_for_it(tmp_path):
    path = tmp_path / "map.npz"
    check_export(path, 100)
    path.write_text("mine")
    check_export(path, 100, overwrite=True)
    with pytest.raises(ExportError, match=r"map\.npz exists"):
        check_export(path, 100)
    with pytest.raises(ExportError, match=r"no format for '\.usd'"):
        check_export(tmp_path / "map.usd", 100)
    assert path.read_text() == "mine"


@pytest.mark.parametrize("height", [np.nan, np.inf, 1e30])
@pytest.mark.parametrize("suffix", [".npz", ".xml", ".stl", ".png"])
def test_heights_that_no_view_can_hold_are_not_exported(terrain_map, tmp_path, suffix, height):
    heights = terrain_map.heights.copy()
    heights[3, 4] = height
    broken = dataclasses.replace(terrain_map, heights=heights)
    with pytest.raises(ExportError, match="heights has values that are not finite or beyond"):
        broken.save(tmp_path / f"a{suffix}")
    assert list(tmp_path.iterdir()) == []

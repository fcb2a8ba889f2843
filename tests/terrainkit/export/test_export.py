import dataclasses
import tracemalloc

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, export, generate
from terrainkit.errors import ExportError
from terrainkit.export import check_export, exporters_by_suffix, get_exporter

every_suffix = pytest.mark.parametrize("suffix", sorted(exporters_by_suffix()))


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@every_suffix
def test_export_takes_no_more_memory_than_stated(tmp_path, suffix):
    stairs = SubTerrain(terrain="pyramid_stairs")
    terrain_map = generate(MapConfig(rows=3, cols=3, terrains=(stairs,)))
    path = terrain_map.save(tmp_path / f"map{suffix}")  # after all imports
    tracemalloc.start()
    terrain_map.save(path, overwrite=True)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < get_exporter(path).BYTES_PER_SAMPLE * terrain_map.heights.size + 3e6


@every_suffix
def test_export_writes_the_same_bytes_to_the_given_path(level_map, tmp_path, suffix):
    first, folder = tmp_path / f"MAP{suffix.upper()}", tmp_path / "folder"
    assert level_map.save(str(first)) == first
    assert {file.stem for file in tmp_path.iterdir()} == {"MAP"}
    folder.mkdir()
    second = folder / first.name
    second.write_text("mine")
    with pytest.raises(ExportError, match=rf"MAP\{suffix.upper()} exists"):
        level_map.save(second)
    assert second.read_text() == "mine"
    assert names(folder) == [second.name]
    level_map.save(second, overwrite=True)
    assert second.read_bytes() == first.read_bytes()


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
        ("map.npz", "merged", "mesh"),
        ("map.png", "merged", "nothing"),
    ],
)
def test_export_unknown_option_lists_options(level_map, tmp_path, name, option, known):
    with pytest.raises(ExportError, match=f"got '{option}'; expected {known}"):
        level_map.save(tmp_path / name, **{option: True})
    assert names(tmp_path) == []


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


@pytest.mark.parametrize("suffix", [".npz", ".xml", ".stl", ".png"])
@pytest.mark.parametrize("height", [np.nan, np.inf, 1.001e6, -1.001e6])
def test_export_rejects_heights_beyond_the_limit(terrain_map, tmp_path, suffix, height):
    heights = terrain_map.heights.copy()
    heights[3, 4] = height
    broken = dataclasses.replace(terrain_map, heights=heights)
    with pytest.raises(ExportError, match="heights has values that are not finite or beyond"):
        broken.save(tmp_path / f"a{suffix}")
    assert list(tmp_path.iterdir()) == []


def test_check_export_counts_the_bytes_of_the_samples(monkeypatch, tmp_path):
    needed = []
    monkeypatch.setattr(export, "check_memory", lambda *arguments: needed.append(arguments))
    check_export(tmp_path / "a.png", 100, rows=7)
    assert needed == [(900, f"writing 100 samples to {tmp_path / 'a.png'}", ("rows", 7))]

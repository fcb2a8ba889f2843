import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from terrainkit_robots.export.collision_simplification import decomposition_cache as module
from terrainkit_robots.export.collision_simplification.decomposition_cache import (
    cache_folder,
    read_parts,
    write_parts,
)
from terrainkit_robots.mesh.surface import Surface

BOX = trimesh.creation.box([1, 2, 3])
PART = Surface(points=np.asarray(BOX.vertices), faces=np.asarray(BOX.faces))


def assert_same(found, wanted):
    assert found is not None
    assert len(found) == len(wanted)
    for a, b in zip(found, wanted, strict=True):
        np.testing.assert_array_equal(a.points, b.points)
        np.testing.assert_array_equal(a.faces, b.faces)


def test_write_and_read(tmp_path):
    file = tmp_path / "deep" / "cache" / "a.npz"
    assert read_parts(file) is None
    write_parts(file, [PART, PART])
    assert_same(read_parts(file), [PART, PART])
    assert read_parts(file.with_name("b.npz")) is None
    assert list(file.parent.iterdir()) == [file]


DAMAGES = {
    "cut off": lambda data: data[: len(data) // 2],
    "empty": lambda data: data[:0],
    "of something else": lambda data: data[::-1],
    "with zeros in it": lambda data: data[:100] + bytes(50) + data[150:],
    "with ones in it": lambda data: data[:100] + b"\xff" * 50 + data[150:],
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_file_is_replaced(tmp_path, damage):
    file = tmp_path / "a.npz"
    write_parts(file, [PART])
    file.write_bytes(DAMAGES[damage](file.read_bytes()))
    assert read_parts(file) is None
    write_parts(file, [PART])
    assert_same(read_parts(file), [PART])


@pytest.mark.parametrize(
    "part",
    [
        Surface(points=PART.points * np.nan, faces=PART.faces),
        Surface(points=PART.points, faces=PART.faces + 1),
        Surface(points=PART.points, faces=-PART.faces),
        Surface(points=PART.points[:, :2], faces=PART.faces),
        Surface(points=PART.points[:3], faces=PART.faces[:1] * 0),
    ],
)
def test_invalid_parts_are_ignored(tmp_path, part):
    file = tmp_path / "a.npz"
    for parts, is_read in (([PART], True), ([PART, part], False), ([], False)):
        write_parts(file, parts)
        assert (read_parts(file) is not None) == is_read


def test_pickles_are_not_loaded(tmp_path):
    class Evil:
        def __reduce__(self):
            return Path.touch, (tmp_path / "executed",)

    np.savez(tmp_path / "a.npz", points_0=np.array([Evil()], dtype=object))
    assert read_parts(tmp_path / "a.npz") is None
    assert not (tmp_path / "executed").exists()


def test_large_file_is_not_read(tmp_path, monkeypatch):
    write_parts(tmp_path / "a.npz", [PART])
    monkeypatch.setattr(module, "_MAX_BYTES", 10)
    assert read_parts(tmp_path / "a.npz") is None


def test_unwritable_folder_is_ignored(tmp_path):
    (tmp_path / "file").write_text("in the way")
    file = tmp_path / "file" / "cache" / "a.npz"
    write_parts(file, [PART])
    assert read_parts(file) is None


@pytest.mark.skipif(sys.platform != "linux", reason="XDG folders")
@pytest.mark.parametrize("variable", ["", "not/absolute"])
def test_cache_folder_follows_xdg(monkeypatch, tmp_path, variable):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "terrainkit" / "coacd"
    monkeypatch.setenv("XDG_CACHE_HOME", variable)
    assert cache_folder() == Path.home() / ".cache" / "terrainkit" / "coacd"

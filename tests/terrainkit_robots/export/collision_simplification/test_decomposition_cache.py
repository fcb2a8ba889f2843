import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from terrainkit_robots.export.collision_simplification import decomposition_cache as module
from terrainkit_robots.export.collision_simplification.decomposition_cache import (
    DecompositionCache,
    cache_folder,
    from_npz,
    to_npz,
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


def test_put_and_get(tmp_path):
    cache = DecompositionCache(tmp_path / "deep" / "cache")
    assert cache.get("a") is None
    cache.put("a", [PART, PART])
    assert_same(DecompositionCache(tmp_path / "deep" / "cache").get("a"), [PART, PART])
    assert cache.get("b") is None
    assert [file.name for file in (tmp_path / "deep" / "cache").iterdir()] == ["a.npz"]


DAMAGES = {
    "cut off": lambda data: data[: len(data) // 2],
    "empty": lambda data: data[:0],
    "of something else": lambda data: data[::-1],
    "with zeros in it": lambda data: data[:100] + bytes(50) + data[150:],
    "with ones in it": lambda data: data[:100] + b"\xff" * 50 + data[150:],
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_file_is_replaced(tmp_path, damage):
    cache = DecompositionCache(tmp_path)
    cache.put("a", [PART])
    file = tmp_path / "a.npz"
    file.write_bytes(DAMAGES[damage](file.read_bytes()))
    assert cache.get("a") is None
    cache.put("a", [PART])
    assert_same(cache.get("a"), [PART])


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
def test_invalid_parts_are_ignored(part):
    assert from_npz(to_npz([PART])) is not None
    assert from_npz(to_npz([PART, part])) is None
    assert from_npz(to_npz([])) is None


def test_pickles_are_not_loaded(tmp_path):
    class Evil:
        def __reduce__(self):
            return Path.touch, (tmp_path / "executed",)

    np.savez(tmp_path / "a.npz", points_0=np.array([Evil()], dtype=object))
    assert DecompositionCache(tmp_path).get("a") is None
    assert not (tmp_path / "executed").exists()


def test_large_file_is_not_read(tmp_path, monkeypatch):
    cache = DecompositionCache(tmp_path)
    cache.put("a", [PART])
    monkeypatch.setattr(module, "_MAX_BYTES", 10)
    assert cache.get("a") is None


def test_no_folder_disables_cache():
    cache = DecompositionCache(None)
    cache.put("a", [PART])
    assert cache.get("a") is None


def test_unwritable_folder_is_ignored(tmp_path):
    (tmp_path / "file").write_text("in the way")
    cache = DecompositionCache(tmp_path / "file" / "cache")
    cache.put("a", [PART])
    assert cache.get("a") is None


@pytest.mark.skipif(sys.platform != "linux", reason="XDG folders")
@pytest.mark.parametrize("variable", ["", "not/absolute"])
def test_cache_folder_follows_xdg(monkeypatch, tmp_path, variable):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "terrainkit" / "coacd"
    monkeypatch.setenv("XDG_CACHE_HOME", variable)
    assert cache_folder() == Path.home() / ".cache" / "terrainkit" / "coacd"

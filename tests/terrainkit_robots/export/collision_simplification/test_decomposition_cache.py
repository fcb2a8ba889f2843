import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from terrainkit_robots.export.collision_simplification import decomposition_cache as module
from terrainkit_robots.export.collision_simplification.decomposition_cache import (
    cache_folder,
    is_valid,
    read_parts,
    write_parts,
)
from terrainkit_robots.mesh.surface import Surface
from tests.terrainkit_robots.export.made_models import surface_of

PART = surface_of(trimesh.creation.box([1, 2, 3]))


def values(parts):
    return parts and [(part.points.tolist(), part.faces.tolist()) for part in parts]


def test_write_and_read(tmp_path):
    file = tmp_path / "deep" / "cache" / "a.npz"
    assert read_parts(file) is None
    write_parts(file, [PART, PART])
    assert values(read_parts(file)) == values([PART, PART])
    assert list(file.parent.iterdir()) == [file]
    write_parts(file, [])
    assert read_parts(file) is None


@pytest.mark.parametrize(
    "damage",
    [lambda data: data[: len(data) // 2], lambda data: data[:100] + b"\xff" * 50 + data[150:]],
    ids=["cut off", "overwritten"],
)
def test_damaged_file_is_replaced(tmp_path, damage):
    file = tmp_path / "a.npz"
    write_parts(file, [PART])
    file.write_bytes(damage(file.read_bytes()))
    assert read_parts(file) is None
    write_parts(file, [PART])
    assert values(read_parts(file)) == values([PART])


POINTS = np.eye(4)[:, :3]
TETRAHEDRON = np.array([[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]])


@pytest.mark.parametrize(
    ("points", "faces", "valid"),
    [
        (POINTS, TETRAHEDRON, True),
        (np.eye(3), TETRAHEDRON % 3, False),
        (POINTS, TETRAHEDRON[:3], False),
        (POINTS * np.nan, TETRAHEDRON, False),
        (POINTS, TETRAHEDRON + 1, False),
        (POINTS, TETRAHEDRON - 1, False),
        (POINTS[:, :2], TETRAHEDRON, False),
        (POINTS, TETRAHEDRON[:, :2], False),
        (POINTS.astype(np.float32), TETRAHEDRON, False),
        (POINTS, TETRAHEDRON.astype(np.int32), False),
        (np.ones(3), TETRAHEDRON, False),
    ],
)
def test_parts_have_finite_vertices_and_existing_ones(points, faces, valid, tmp_path):
    part = Surface(points=points, faces=faces)
    assert is_valid(part) is valid
    if points.dtype == np.float64 and faces.dtype == np.int64:
        write_parts(tmp_path / "a.npz", [PART, part])
        assert (read_parts(tmp_path / "a.npz") is not None) is valid


def test_pickles_are_not_loaded(tmp_path):
    class Evil:
        def __reduce__(self):
            return Path.touch, (tmp_path / "executed",)

    np.savez(tmp_path / "a.npz", points_0=np.array([Evil()], dtype=object))
    assert read_parts(tmp_path / "a.npz") is None
    assert not (tmp_path / "executed").exists()


def test_files_that_cannot_be_read_or_written(tmp_path, monkeypatch):
    file = tmp_path / "a.npz"
    write_parts(file, [PART])
    for most, is_read in ((file.stat().st_size, True), (file.stat().st_size - 1, False)):
        monkeypatch.setattr(module, "MAX_BYTES", most)
        assert (read_parts(file) is not None) is is_read
    write_parts(file / "below a file" / "b.npz", [PART])


@pytest.mark.skipif(sys.platform != "linux", reason="XDG folders")
@pytest.mark.parametrize("variable", ["", "not/absolute", "/cache"])
def test_cache_folder_follows_xdg(monkeypatch, variable):
    monkeypatch.setenv("XDG_CACHE_HOME", variable)
    expected = Path(variable) if variable == "/cache" else Path.home() / ".cache"
    assert cache_folder() == expected / "terrainkit" / "coacd"

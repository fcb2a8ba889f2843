import hashlib

import cv2
import numpy as np
import pytest
import trimesh

import terrainkit as tk
from terrainkit.errors import ConfigError, HeightFileError
from terrainkit.geometry.grid import Grid
from terrainkit.map.validate import validate
from terrainkit.terrains.imported import Imported


def plane(shape, cell):
    """Return heights that rise by 0.1 m per meter along x and fall by 0.05 m along y."""
    x, y = (cell * (np.arange(n) + 0.5) for n in shape)
    return np.add.outer(0.1 * x, -0.05 * y)


@pytest.fixture
def file(tmp_path):
    np.save(tmp_path / "plane.npy", plane((160, 120), 0.1))
    return str(tmp_path / "plane.npy")


def test_imported_center_crop_has_heights_of_the_file(grid, rng, file):
    heights = Imported(file=file, file_cell=0.1, crop="center").build(grid, rng)
    # Patch 8 m x 8 m. At least 1 m from its edges and from the platform of 2 m, nothing is faded.
    # Heights are relative to the sample beside the center, at (4.05, 4.05).
    for i, j in ((12, 12), (65, 30), (30, 65)):
        x, y = (i + 0.5) / 10 - 4.05, (j + 0.5) / 10 - 4.05
        assert heights[i, j] == pytest.approx(0.1 * x - 0.05 * y, abs=1e-5)
    assert heights[40, 40] == heights[32, 47] == 0.0
    assert np.abs(heights[0]).max() == np.abs(heights[:, -1]).max() == 0.0


def test_imported_vertical_exaggeration_scales_heights(grid, file):
    flat, steep = (
        Imported(file=file, file_cell=0.1, vertical_exaggeration=factor).build(
            grid, np.random.default_rng(1)
        )
        for factor in (0.5, 2.0)
    )
    np.testing.assert_allclose(steep, 4 * flat, atol=1e-5)


def test_imported_random_crop_is_part_of_the_file(grid, tmp_path):
    peak = np.zeros((160, 120))
    peak[140, 100] = 1.0
    np.save(tmp_path / "peak.npy", peak)
    terrain = Imported(file=str(tmp_path / "peak.npy"), file_cell=0.1)
    highest = [terrain.build(grid, np.random.default_rng(seed)).max() for seed in range(40)]
    assert min(highest) == 0.0  # the peak is elsewhere
    assert max(highest) > 0.5


def test_imported_small_file_continues_as_its_mirror_image(rng, tmp_path):
    np.save(tmp_path / "ramp.npy", plane((20, 20), 0.1))
    terrain = Imported(file=str(tmp_path / "ramp.npy"), file_cell=0.1, crop="center", platform=0.2)
    heights = terrain.build(Grid(shape=(80, 80), cell=0.1), rng)
    # The file is 2 m wide and rises by 0.2 m; the ground rises and falls without a step.
    assert np.abs(np.diff(heights[15:65, 15:65], axis=0)).max() < 0.03
    assert np.ptp(heights[15:65, 60]) == pytest.approx(0.19, abs=0.02)


def test_imported_image_and_mesh(rng, tmp_path, grid):
    pixels = np.tile(np.arange(0, 65535, 500, dtype=np.uint16), (100, 1))
    cv2.imwrite(str(tmp_path / "a.png"), pixels)
    image = Imported(file=str(tmp_path / "a.png"), file_cell=0.1, height_span=65.535, crop="center")
    heights = image.build(grid, rng)
    # 500 gray levels of 1 mm per cell.
    assert heights[65, 20] - heights[64, 20] == pytest.approx(0.5, abs=1e-3)
    ramp = trimesh.creation.box((20, 4, 12))  # y up: 20 m along x and 12 m along y
    ramp.vertices[:, 1] += np.where(ramp.vertices[:, 1] > 0, 0.1 * ramp.vertices[:, 0], 0)
    ramp.export(tmp_path / "a.glb")
    mesh = Imported(file=str(tmp_path / "a.glb"), up="y", crop="center")
    heights = mesh.build(grid, rng)
    assert heights[65, 20] - heights[64, 20] == pytest.approx(0.01, abs=1e-4)


def test_imported_missing_heights(rng, tmp_path, grid):
    heights = plane((100, 100), 0.1)
    heights[5, 5] = np.nan
    np.save(tmp_path / "a.npy", heights)
    with pytest.raises(HeightFileError, match="1 of 10000 heights are missing"):
        Imported(file=str(tmp_path / "a.npy"), file_cell=0.1).build(grid, rng)
    built = Imported(file=str(tmp_path / "a.npy"), file_cell=0.1, missing="nearest")
    assert np.isfinite(built.build(grid, rng)).all()


def imported_map(file):
    terrain = tk.SubTerrain(terrain="imported", parameters={"file": file, "file_cell": 0.1})
    return tk.generate(tk.MapConfig(rows=2, cols=2, border=1.0, terrains=(terrain,)))


def test_imported_map_records_the_file(file, tmp_path):
    terrain_map = imported_map(file)
    record = terrain_map.patch(0, 0).parameters
    with open(file, "rb") as stream:  # noqa: PTH123
        digest = hashlib.sha256(stream.read()).hexdigest()
    assert record.requested["sha256"] == ""
    assert record.realized["sha256"] == digest
    loaded = tk.TerrainMap.load(terrain_map.save(tmp_path / "map.npz"))
    assert validate(loaded) == []


def test_imported_map_of_changed_file_has_issues(file):
    terrain_map = imported_map(file)
    np.save(file, plane((160, 120), 0.1) * 1.5)
    messages = [issue.message for issue in validate(terrain_map)]
    assert "patch (0, 0): the recorded parameters differ from its config: sha256" in messages


def test_imported_map_of_missing_file_has_issues(file, tmp_path):
    terrain_map = imported_map(file)
    (tmp_path / "plane.npy").unlink()
    messages = [issue.message for issue in validate(terrain_map)]
    assert messages[0].startswith("cannot be generated from the config: patch (0, 0): no file")


def test_imported_sha256_must_match(grid, rng, file):
    with pytest.raises(
        ConfigError, match=r"^imported\.sha256: got [0-9a-f]{64} of .*; expected abc"
    ):
        Imported(file=file, file_cell=0.1, sha256="abc").build(grid, rng)


def test_imported_rejects_solids():
    message = r"^imported\.solids: .* terrainkit import --solids keeps the overhangs"
    with pytest.raises(ConfigError, match=message):
        tk.SubTerrain(terrain="imported", parameters={"solids": True})

import hashlib
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

import terrainkit as tk
from terrainkit.errors import ConfigError, HeightFileError
from terrainkit.map.validate import validate
from terrainkit.terrains.imported import Imported
from tests.terrains import heights_of


def plane(shape, cell):
    """Return heights that rise by 0.1 m per meter along x and fall by 0.05 m along y."""
    x, y = (cell * (np.arange(n) + 0.5) for n in shape)
    return np.add.outer(0.1 * x, -0.05 * y)


@pytest.fixture
def save(tmp_path):
    """Return a function that saves heights and returns the parameters of their terrain."""

    def write(heights, **parameters):
        np.save(tmp_path / "file.npy", heights)
        return {"file": str(tmp_path / "file.npy"), "file_cell": 0.1, **parameters}

    return write


@pytest.fixture
def file(save):
    return save(plane((160, 120), 0.1))["file"]


@pytest.mark.parametrize("exaggeration", [0.5, 1.0, 2.0])
def test_imported_center_crop_has_heights_of_the_file(file, exaggeration):
    terrain = Imported(file=file, file_cell=0.1, crop="center", vertical_exaggeration=exaggeration)
    heights = heights_of(terrain)
    # Patch 8 m x 8 m. At least 1 m from its edges and from the platform of 2 m, nothing is faded.
    # Heights are relative to the sample beside the center, at (4.05, 4.05).
    for i, j in ((12, 12), (65, 30), (30, 65)):
        x, y = (i + 0.5) / 10 - 4.05, (j + 0.5) / 10 - 4.05
        assert heights[i, j] == pytest.approx(exaggeration * (0.1 * x - 0.05 * y), abs=1e-5)
    assert heights[40, 40] == heights[32, 47] == 0.0
    assert np.abs(heights[0]).max() == np.abs(heights[:, -1]).max() == 0.0


def test_imported_random_crop_is_part_of_the_file(save):
    peak = np.zeros((160, 120))
    peak[140, 100] = 1.0
    terrain = Imported(**save(peak))
    highest = [heights_of(terrain, seed).max() for seed in range(40)]
    assert min(highest) == 0.0  # the peak is elsewhere
    assert max(highest) > 0.5


def test_imported_small_file_continues_as_its_mirror_image(save):
    heights = heights_of(Imported(**save(plane((20, 20), 0.1), crop="center", platform=0.2)))
    # The file is 2 m wide and rises by 0.2 m; the ground rises and falls without a step.
    assert np.abs(np.diff(heights[15:65, 15:65], axis=0)).max() < 0.03
    assert np.ptp(heights[15:65, 60]) == pytest.approx(0.19, abs=0.02)


def test_imported_image_and_mesh(tmp_path):
    pixels = np.tile(np.arange(0, 65535, 500, dtype=np.uint16), (100, 1))
    cv2.imwrite(str(tmp_path / "a.png"), pixels)
    ramp = trimesh.creation.box((20, 4, 12))  # y up: 20 m along x and 12 m along y
    ramp.vertices[:, 1] += np.where(ramp.vertices[:, 1] > 0, 0.1 * ramp.vertices[:, 0], 0)
    ramp.export(tmp_path / "a.glb")
    for name, parameters, rise in (
        ("a.png", {"file_cell": 0.1, "height_span": 65.535}, 0.5),  # 500 gray levels of 1 mm
        ("a.glb", {"up": "y"}, 0.01),
    ):
        heights = heights_of(Imported(file=str(tmp_path / name), crop="center", **parameters))
        assert heights[65, 20] - heights[64, 20] == pytest.approx(rise, rel=2e-2)


def test_imported_missing_heights(save):
    heights = plane((100, 100), 0.1)
    heights[5, 5] = np.nan
    parameters = save(heights)
    with pytest.raises(HeightFileError, match="1 of 10000 heights are missing"):
        heights_of(Imported(**parameters, missing="reject"))
    with pytest.warns(tk.TerrainkitWarning, match="1 of 10000 heights are missing"):
        assert np.isfinite(heights_of(Imported(**parameters))).all()


def test_imported_cells_may_be_longer_along_y(save):
    # Along x, 0.01 m per sample; along y, -0.005 m per sample of 0.2 m.
    terrain = Imported(
        **save(plane((160, 60), 0.1)), file_cell_y=0.2, crop="center", vertical_exaggeration=1.0
    )
    heights = heights_of(terrain)
    assert heights[65, 20] - heights[64, 20] == pytest.approx(0.01, abs=1e-5)
    assert heights[20, 65] - heights[20, 63] == pytest.approx(-0.005, abs=1e-5)


def imported_map(file):
    terrain = tk.SubTerrain(terrain="imported", parameters={"file": file, "file_cell": 0.1})
    return tk.generate(tk.MapConfig(rows=2, cols=2, border=1.0, terrains=(terrain,)))


def test_imported_map_records_the_file(file, tmp_path):
    terrain_map = imported_map(file)
    record = terrain_map.patch(0, 0).parameters
    assert record.requested["sha256"] == ""
    assert record.realized["sha256"] == hashlib.sha256(Path(file).read_bytes()).hexdigest()
    loaded = tk.TerrainMap.load(terrain_map.save(tmp_path / "map.npz"))
    assert validate(loaded) == []


def test_imported_map_of_changed_or_missing_file_has_issues(file):
    terrain_map = imported_map(file)
    np.save(file, plane((160, 120), 0.1) * 1.5)
    messages = [issue.message for issue in validate(terrain_map)]
    assert "patch (0, 0): the recorded parameters differ from its config: sha256" in messages
    Path(file).unlink()
    first, *_ = [issue.message for issue in validate(terrain_map)]
    assert first.startswith("cannot be generated from the config: patch (0, 0): no file")


def test_imported_sha256_must_match(file):
    message = r"^imported\.sha256: got [0-9a-f]{64} of .*; expected abc"
    with pytest.raises(ConfigError, match=message):
        heights_of(Imported(file=file, file_cell=0.1, sha256="abc"))


def test_imported_rejects_solids():
    message = r"^imported\.solids: .* terrainkit import --solids keeps the overhangs"
    with pytest.raises(ConfigError, match=message):
        tk.SubTerrain(terrain="imported", parameters={"solids": True})


def test_imported_folder_is_sorted_by_difficulty_beside_other_terrains(tmp_path):
    for name, steps in (("a", 0.1), ("b", 0.3)):
        heights = plane((80, 80), 0.1) * 0
        heights[::8] = steps
        np.save(tmp_path / f"{name}.npy", heights)
    parameters = {"file": str(tmp_path), "file_cell": 0.1, "vertical_exaggeration": 1.0}
    terrains = (
        tk.SubTerrain(terrain="imported", parameters=parameters),
        tk.SubTerrain(terrain="stairs"),
    )
    terrain_map = tk.generate(tk.MapConfig(rows=3, cols=2, border=1.0, terrains=terrains))
    # Round to even: rank 0.5 of two files is the first.
    names = [Path(each.realized["file"]).name for each in terrain_map.parameters[:, 0]]
    assert names == ["a.npy", "a.npy", "b.npy"]
    assert "file" not in terrain_map.parameters[0, 1].realized
    assert validate(terrain_map) == []
    for values, message in (
        ({"rank": 2.0}, r"imported\.rank: got 2; expected a number from 0 to 1"),
        ({"files": ["a.npy"]}, r"imported\.file: got .* beside files; expected one of them"),
    ):
        with pytest.raises(ConfigError, match=message):
            heights_of(Imported(**parameters | values))


def test_imported_steep_slopes_stay_slopes(save):
    # A roof of 45 degrees, 1 m high, and a block of 1 m, away from the platform and the edges.
    heights = np.zeros((160, 160))
    heights[15:36, 60:100] = 0.1 * np.minimum(np.arange(21), np.arange(21)[::-1])[:, None]
    heights[120:130, 60:100] = 1.0
    parameters = save(heights, crop="center", vertical_exaggeration=1.0)
    config = tk.MapConfig(
        rows=1,
        cols=2,
        patch_size=(16.0, 16.0),
        border=1.0,
        terrains=(
            tk.SubTerrain(terrain="imported", parameters=parameters),
            tk.SubTerrain(terrain="stairs"),
        ),
    )
    terrain_map = tk.generate(config)
    cells = config.patch_cells(0, 0)
    along_x, along_y = (terrain_map.walls[cells] & bit > 0 for bit in (1, 2))
    assert not along_x[15:36, 70].any()
    assert np.flatnonzero(along_x[:, 70]).tolist() == [119, 129]
    assert np.flatnonzero(along_y[125]).tolist() == [
        59,
        99,
        159,
    ]  # the last is the side of the stairs
    stairs = terrain_map.walls[config.patch_cells(0, 1)]
    by_threshold = tk.generate(
        tk.MapConfig(rows=1, cols=1, patch_size=(16.0, 16.0), terrains=config.terrains[1:])
    )
    assert by_threshold.walls is None
    threshold = config.wall_threshold
    steps = np.abs(np.diff(terrain_map.patch(0, 1).heights, axis=0)) > threshold
    assert np.array_equal(stairs[:-1] & 1 > 0, steps)
    alone, whole = tk.make_patch(config, 0, 0), terrain_map.patch(0, 0)
    assert np.array_equal(alone.heights, whole.heights)
    assert np.array_equal(alone.walls[:-1, :-1], whole.walls[:-1, :-1])
    assert tk.make_patch(config, 0, 1).walls is None
    assert validate(terrain_map) == []

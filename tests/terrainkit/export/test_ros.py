import dataclasses

import cv2
import numpy as np
import pytest

import terrainkit as tk
from terrainkit.errors import ExportError, TerrainkitWarning
from terrainkit.export.ros import occupied_cells
from terrainkit.importing import ImportOptions, import_map


def read(path):
    """Return the values of a YAML file of plain `key: value` lines."""
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    pairs = (line.split(": ", 1) for line in lines)
    return {key: text.strip('"') for key, text in pairs}


def occupancy(path):
    """Return the cells as map_server reads them: 100 occupied, 0 free, -1 unknown; from below."""
    table = read(path)
    assert (table["mode"], table["negate"]) == ("trinary", "0")
    gray = cv2.imread(str(path.parent / table["image"]), cv2.IMREAD_UNCHANGED)[::-1]
    probability = (255 - gray.astype(float)) / 255
    return np.select(
        [probability > float(table["occupied_thresh"]), probability < float(table["free_thresh"])],
        [100, 0],
        -1,
    )


@pytest.fixture
def block_map():
    """A level map of 8 m x 4 m with a border of 1 m, and a block 0.5 m high on 3 x 2 cells."""
    flat = (tk.SubTerrain(terrain="flat"),)
    config = tk.MapConfig(rows=1, cols=1, patch_size=(8.0, 4.0), border=1.0, terrains=flat)
    terrain_map = tk.generate(config)
    heights = terrain_map.heights.copy()
    heights[20:23, 41:43] = 0.5
    return dataclasses.replace(terrain_map, heights=heights)


def test_yaml_places_occupied_cells(block_map, tmp_path):
    path = block_map.save(tmp_path / "map.yaml")
    table, cells = read(path), occupancy(path)
    assert cells.shape == (60, 100)  # rows along y, columns along x
    assert np.argwhere(cells == 100).tolist() == [[y, x] for y in (41, 42) for x in (20, 21, 22)]
    assert (cells >= 0).all()
    x, y, yaw = map(float, table["origin"].strip("[]").split(", "))
    cell = float(table["resolution"])
    assert (x, y, yaw, cell) == (-1.0, -1.0, 0.0, 0.1)
    # The pixel of the lower left corner starts at the origin, so this is the middle of a cell.
    assert block_map.height([x + 20.5 * cell, y + 41.5 * cell]) == pytest.approx(0.5)


def test_heights_have_the_scale_of_the_yaml(terrain_map, tmp_path):
    path = terrain_map.save(tmp_path / "map.yaml")
    table = read(path)
    gray = cv2.imread(str(tmp_path / table["elevation_image"]), cv2.IMREAD_UNCHANGED)
    assert gray.dtype == np.uint16
    heights = float(table["elevation_offset"]) + float(table["elevation_scale"]) * gray
    np.testing.assert_allclose(heights[::-1].T, terrain_map.heights, atol=1e-3)


def test_import_restores_heights_and_position(terrain_map, tmp_path):
    path = terrain_map.save(tmp_path / "map.yaml")
    config = terrain_map.config
    options = ImportOptions(
        origin=(0.0, 0.0, 0.0),
        rows=config.rows,
        cols=config.cols,
        patch_size=config.patch_size,
        border=config.border,
    )
    imported = import_map(path.with_suffix(".png"), options).terrain_map
    assert imported.grid == terrain_map.grid
    np.testing.assert_allclose(imported.heights, terrain_map.heights, atol=1e-3)


def test_max_step_selects_occupied_cells(block_map, tmp_path):
    path = block_map.save(tmp_path / "map.yaml", max_step=0.6)
    assert (occupancy(path) == 0).all()
    with pytest.raises(ExportError, match="max_step: got 0 m"):
        block_map.save(path, max_step=0.0, overwrite=True)


def test_cells_above_diagonal_steps_are_occupied():
    heights = np.zeros((4, 4), np.float32)
    heights[:2, :2] = 1.0
    expected = np.zeros((4, 4), bool)
    expected[:2, :2] = [[False, True], [True, True]]
    np.testing.assert_array_equal(occupied_cells(heights, 0.5), expected)


def test_map_with_solids_is_rejected(solid_map, tmp_path):
    with pytest.raises(ExportError, match="solids"):
        solid_map.save(tmp_path / "map.yaml")
    assert not list(tmp_path.iterdir())


def test_map_with_several_frictions_warns(tmp_path):
    icy = tk.SubTerrain(terrain="flat", friction=0.3)
    config = tk.MapConfig(rows=1, cols=1, patch_size=(2.0, 2.0), border=0.0, terrains=(icy,))
    with pytest.warns(TerrainkitWarning, match="has one friction"):
        tk.generate(config).save(tmp_path / "map.yaml")

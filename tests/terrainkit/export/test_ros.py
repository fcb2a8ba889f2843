import cv2
import numpy as np
import pytest

import terrainkit as tk
from terrainkit.errors import ExportError, TerrainkitWarning
from terrainkit.export.ros import occupied_cells
from tests.tables import read_table
from tests.terrainkit.maps import plot

HEIGHTS = np.zeros((7, 6))
HEIGHTS[2:4, 3] = 65535 / 2**18  # gray levels of 2**-18 m
YAML = read_table(__file__, "yaml")


def test_yaml_and_occupancy_by_hand(tmp_path):
    path = plot(HEIGHTS, border=0.1).save(tmp_path / "map.yaml")
    assert path.read_text() == YAML
    free, step = bytes([254] * 7), bytes([254, 254, 0, 0, 254, 254, 254])
    # The first of 6 rows has the largest y, so that row 2 shows y index 3.
    pixels = 2 * free + step + 3 * free
    assert path.with_suffix(".pgm").read_bytes() == b"P5\n7 6\n255\n" + pixels
    grey = cv2.imread(str(path.with_suffix(".png")), cv2.IMREAD_UNCHANGED)
    assert (grey[::-1].T / 2**18 == HEIGHTS).all()


def test_cells_above_steps_of_more_than_max_step_are_occupied():
    """Of the block of 2 x 2 cells, all but the corner of the map have a lower neighbor."""
    heights = np.zeros((4, 4), np.float32)
    heights[:2, :2] = 0.5
    expected = np.zeros((4, 4), bool)
    expected[:2, :2] = [[False, True], [True, True]]
    np.testing.assert_array_equal(occupied_cells(heights, 0.49), expected)
    assert not occupied_cells(heights, 0.5).any()


def test_max_step_is_above_0(tmp_path):
    path = tmp_path / "map.yaml"
    with pytest.raises(ExportError, match="max_step: got 0 m"):
        plot(HEIGHTS).save(path, max_step=0.0)
    plot(HEIGHTS).save(path, max_step=0.3)
    assert set(path.with_suffix(".pgm").read_bytes()[11:]) == {254}


def test_map_with_several_frictions_warns(tmp_path):
    icy = tk.SubTerrain(terrain="flat", friction=0.3)
    config = tk.MapConfig(rows=1, cols=1, patch_size=(2.0, 2.0), border=0.0, terrains=(icy,))
    with pytest.warns(TerrainkitWarning, match="has one friction"):
        tk.generate(config).save(tmp_path / "map.yaml")

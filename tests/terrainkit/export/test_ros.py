import cv2
import numpy as np
import pytest

import terrainkit as tk
from terrainkit.errors import ConfigError, TerrainkitWarning
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


def test_height_band_is_not_empty(tmp_path):
    path = tmp_path / "map.yaml"
    for low, high in ((-0.1, 1.0), (0.5, 0.5), (0.1, np.nan)):
        with pytest.raises(ConfigError, match=f"height band: got {low:g} m to {high:g} m"):
            plot(HEIGHTS).save(path, height_band=(low, high))
    plot(HEIGHTS).save(path, height_band=(0.3, 1.0))
    assert set(path.with_suffix(".pgm").read_bytes()[11:]) == {254}


def test_map_server_reads_the_occupancy_of_solids(solid_map, tmp_path):
    path = solid_map.save(tmp_path / "map.yaml", height_band=(0.1, 1.0))
    grey = cv2.imread(str(path.with_suffix(".pgm")), cv2.IMREAD_UNCHANGED)
    # As map_server does: the last row has the lowest y, and dark pixels are occupied.
    is_occupied = 1 - grey[::-1].T / 255 > 0.65
    np.testing.assert_array_equal(is_occupied, solid_map.occupancy(0.1, 1.0))


def test_map_with_several_frictions_warns(tmp_path):
    icy = tk.SubTerrain(terrain="flat", friction=0.3)
    config = tk.MapConfig(rows=1, cols=1, patch_size=(2.0, 2.0), border=0.0, terrains=(icy,))
    with pytest.warns(TerrainkitWarning, match="has one friction"):
        tk.generate(config).save(tmp_path / "map.yaml")

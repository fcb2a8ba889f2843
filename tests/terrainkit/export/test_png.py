import dataclasses
import json

import cv2
import numpy as np
import pytest

from terrainkit.errors import ExportError


@pytest.fixture(scope="module")
def picture(terrain_map, tmp_path_factory):
    path = terrain_map.save(tmp_path_factory.mktemp("png") / "map.png")
    grey = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    return grey, json.loads(path.with_suffix(".json").read_text())


def with_heights(terrain_map, low, high):
    heights = np.full_like(terrain_map.heights, low)
    heights[50:, 30:] = high
    return dataclasses.replace(terrain_map, heights=heights)


def read(path):
    sidecar = json.loads(path.with_suffix(".json").read_text())
    grey = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    return sidecar["offset"] + sidecar["scale"] * grey


def test_png_is_16_bit_gray(picture):
    grey, _ = picture
    assert grey.dtype == np.uint16
    assert grey.shape == (144, 184)


def test_png_uses_all_gray_levels(picture):
    grey, _ = picture
    assert (grey.min(), grey.max()) == (0, 65535)


def test_png_axes_match_the_sidecar(picture, terrain_map):
    grey, sidecar = picture
    row, column = np.indices(grey.shape)
    first = np.array(sidecar["first_sample"])
    index = np.stack([column, grey.shape[0] - 1 - row], axis=-1)
    heights = sidecar["offset"] + sidecar["scale"] * grey
    expected = terrain_map.height(first + index * sidecar["cell"])
    np.testing.assert_allclose(heights, expected, atol=1e-3)


def test_png_brightest_pixel_is_highest_ground(terrain_map, tmp_path):
    heights = np.zeros_like(terrain_map.heights)
    heights[20, 30] = 1.0
    path = dataclasses.replace(terrain_map, heights=heights).save(tmp_path / "map.png")
    # Column 20 from the left; row 30 counted from below, of 144.
    assert np.argwhere(read(path) > 0.5).tolist() == [[144 - 1 - 30, 20]]


def test_png_sidecar_has_size_and_friction(picture):
    _, sidecar = picture
    assert sidecar["size"] == pytest.approx([18.4, 14.4])
    assert sidecar["cell"] == 0.1
    assert sidecar["static_friction"] == 0.8
    assert sidecar["dynamic_friction"] == 0.6
    assert sidecar["restitution"] == 0.1


def test_png_flat_ground_keeps_its_height(terrain_map, tmp_path):
    path = with_heights(terrain_map, 0.25, 0.25).save(tmp_path / "map.png")
    np.testing.assert_allclose(read(path), 0.25)


def test_png_ground_below_zero_keeps_its_height(terrain_map, tmp_path):
    path = with_heights(terrain_map, -7.5, -3.0).save(tmp_path / "map.png")
    heights = read(path)
    assert heights.min() == pytest.approx(-7.5)
    assert heights.max() == pytest.approx(-3.0)


@pytest.mark.parametrize("height", [100.0, 131.0])
def test_png_range_of_131_m_is_accurate(terrain_map, tmp_path, height):
    rng = np.random.default_rng(0)
    heights = rng.uniform(0, height, terrain_map.heights.shape).astype(np.float32)
    heights[0, :2] = 0.0, height
    path = dataclasses.replace(terrain_map, heights=heights).save(tmp_path / "map.png")
    # 65535 steps of 2 mm are 131.07 m; rounding is off by half a step.
    np.testing.assert_allclose(read(path)[::-1].T, heights, atol=1e-3 + 1e-5)


def test_png_larger_range_writes_nothing(terrain_map, tmp_path):
    with pytest.raises(
        ExportError, match=r"height range: got 131\.2 m; expected at most 131\.07 m"
    ):
        with_heights(terrain_map, -0.1, 131.1).save(tmp_path / "map.png")
    assert list(tmp_path.iterdir()) == []


def test_png_keeps_existing_sidecar(terrain_map, tmp_path):
    (tmp_path / "map.json").write_text("mine")
    with pytest.raises(ExportError, match=r"map\.json exists"):
        terrain_map.save(tmp_path / "map.png")
    assert (tmp_path / "map.json").read_text() == "mine"
    assert not (tmp_path / "map.png").exists()

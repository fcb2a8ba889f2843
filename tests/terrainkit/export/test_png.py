import dataclasses
import json

import cv2
import numpy as np
import pytest

from terrainkit.errors import ExportError
from tests.terrainkit.maps import plot


def saved(heights, folder, **config):
    """Return the gray levels and the sidecar of an image of heights."""
    path = plot(heights, **config).save(folder / "map.png")
    grey = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    return grey, json.loads(path.with_suffix(".json").read_text())


def test_png_by_hand(tmp_path):
    """65535 levels of 1 mm; rows go down and y goes up."""
    heights = [[-1.0, 0.0, 1.0], [2.0, 3.0, 4.0], [5.0, 6.0, 64.535], [7.0, 8.0, 9.0]]
    contact = {"static_friction": 0.8, "dynamic_friction": 0.6, "restitution": 0.1}
    grey, sidecar = saved(heights, tmp_path, centered=True, **contact)
    assert grey.dtype == np.uint16
    assert grey.tolist() == [
        [2000, 5000, 65535, 10000],
        [1000, 4000, 7000, 9000],
        [0, 3000, 6000, 8000],
    ]
    del sidecar["about"]
    assert sidecar == {
        "scale": pytest.approx(0.001),
        "offset": -1.0,
        "cell": 0.1,
        "first_sample": pytest.approx([-0.15, -0.1]),
        "size": pytest.approx([0.4, 0.3]),
        **contact,
    }


@pytest.mark.parametrize(("low", "high"), [(0.25, 0.25), (-7.5, -3.0), (0.0, 131.069)])
def test_png_is_accurate_to_a_millimeter(tmp_path, low, high):
    heights = np.random.default_rng(0).uniform(low, high, (30, 20)).astype(np.float32)
    heights[0, :2] = low, high
    grey, sidecar = saved(heights, tmp_path)
    # 65535 levels of 2 mm are 131.07 m; rounding is off by half of a level.
    found = sidecar["offset"] + sidecar["scale"] * grey[::-1].T
    np.testing.assert_allclose(found, heights, atol=1e-3 + 1e-5)


def test_png_larger_range_writes_nothing(tmp_path):
    heights = np.full((4, 3), -0.1)
    heights[0, 0] = 131.0
    message = r"height range: got 131\.1 m; expected at most 131\.07 m"
    with pytest.raises(ExportError, match=message):
        saved(heights, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_images_reject_maps_with_solids(solid_map, tmp_path):
    solids = solid_map.solids.select(np.arange(4) < 1)
    terrain_map = dataclasses.replace(solid_map, solids=solids)
    with pytest.raises(ExportError, match="1 solids, which an image of heights cannot represent"):
        terrain_map.save(tmp_path / "map.png")
    assert not list(tmp_path.iterdir())

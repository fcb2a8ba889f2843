from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from terrainkit.errors import TerrainkitWarning
from terrainkit.importing.readers.import_options import ReadOptions
from terrainkit.importing.readers.raster import Raster, make_raster


def centers(count, step):
    return (np.arange(count) + 0.5) * step


@pytest.mark.parametrize("spacing", [(0.5, 0.5), (0.5, 0.8), (2.0, 0.3)])
@pytest.mark.parametrize("step", [0.1, 0.5, 0.6, 1.3, 2.0])
def test_heights_of_a_plane_are_exact_away_from_the_edge(spacing, step):
    x, y = centers(40, spacing[0]), centers(60, spacing[1])
    raster = Raster(values=np.add.outer(0.3 * x, -0.2 * y).astype(np.float32), spacing=spacing)
    at_x = np.arange(4.0, 14.0, step)
    at_y = np.arange(4.0, 12.0, step)
    expected = np.add.outer(0.3 * at_x, -0.2 * at_y)
    np.testing.assert_allclose(raster.heights(at_x, at_y), expected, atol=2e-6)


@pytest.mark.parametrize(("factor", "kept"), [(1, 1.0), (2, 0.0), (3, 1 / 3), (4, 0.0), (5, 0.2)])
def test_coarse_heights_are_means(factor, kept):
    # Teeth of 2 m and 0 m: of 3 or 5 samples, one more is high or low.
    values = np.tile([0.0, 2.0], 30).astype(np.float32)[:, None] * np.ones((1, 60), np.float32)
    raster = Raster(values=values, spacing=(0.1, 0.1))
    found = raster.heights(*(centers(60 // factor, 0.1 * factor),) * 2)
    np.testing.assert_allclose(np.abs(found - 1.0)[2:-2], kept, atol=1e-5)


def test_heights_where_most_is_missing_are_missing():
    values = np.ones((4, 4), np.float32)
    values[0, 0] = values[2, 0] = values[2:, 2:] = np.nan
    found = Raster(values=values, spacing=(1.0, 1.0)).heights(*(np.array([1.0, 3.0]),) * 2)
    np.testing.assert_array_equal(found, [[1.0, 1.0], [1.0, np.nan]])


def test_values_of_nodata_are_missing_in_their_unit():
    values = np.array([[150, -9999, -225]], np.int16)
    options = ReadOptions(file_cell=1.0, scale=0.01, nodata=-9999, detect_nodata=False)
    raster = make_raster(Path("a.npy"), values, options)
    np.testing.assert_allclose(raster.values, [[1.5, np.nan, -2.25]])


@pytest.mark.parametrize(("relief", "is_warned"), [(100.0, False), (101.0, True)])
def test_heights_that_are_not_of_ground_are_warned_of(relief, is_warned):
    values = np.linspace(0, relief, 50).reshape(10, 5)
    message = (
        r"got 10 m x 5 m with heights over 101 m; .*scale=0\.01.*file_cell=\(111000, 111000\)` is"
    )
    with pytest.warns(TerrainkitWarning, match=message) if is_warned else nullcontext():
        make_raster(Path("a.npy"), values, ReadOptions(file_cell=1.0))


@pytest.mark.parametrize(
    ("bottom", "top", "expected"),
    [
        (0, 127, "In MuJoCo and Gazebo, .* `height_range=\\(1, 5.01575\\)`$"),
        (0, 191, "In MuJoCo and Gazebo, .* `height_range=\\(1, 3.67016\\)`$"),
        (0, 192, ""),
        (0, 0, ""),
        (7, 7, ""),
        # 40 values are 2 m in MuJoCo, 168 in Gazebo.
        (
            128,
            168,
            r"MuJoCo, .* `height_range=\(-5.4, 7.35\)`; in Gazebo, .*=\(1, 4.03571\)`$",
        ),
        (128, 255, r"In MuJoCo, .* `height_range=\(-1.01575, 3\)`$"),
    ],
)
@pytest.mark.filterwarnings("ignore:.*8 bits have terraces")
def test_values_that_do_not_use_their_range_are_warned_of(bottom, top, expected):
    values = np.linspace(bottom, top, 24).astype(np.uint8).reshape(4, 6)
    options = ReadOptions(file_cell=(0.1,), height_range=(1.0, 3.0))
    message = f"got values from {bottom} to {top}; .*{expected}"
    with pytest.warns(TerrainkitWarning, match=message) if expected else nullcontext():
        raster = make_raster(Path("a.png"), values, options)
    assert raster.values.max() == pytest.approx(1 + 2 * top / 255)

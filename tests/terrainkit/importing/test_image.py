import json
from zlib import crc32

import cv2
import numpy as np
import pytest

import terrainkit as tk
from terrainkit.errors import ConfigError, HeightFileError
from terrainkit.importing.image import read
from terrainkit.importing.options import ReadOptions

# Three columns along x and two rows along y. The upper row of the image has the higher y.
PIXELS = np.array([[0, 13107, 26214], [39321, 52428, 65535]], dtype=np.uint16)


def write(path, pixels, **sidecar):
    assert cv2.imwrite(str(path), pixels)
    if sidecar:
        path.with_suffix(".json").write_text(json.dumps(sidecar))
    return path


SIDECAR = {"scale": 0.001, "offset": -2.0, "cell": 0.2}
SAMPLE = {"first_sample": [3.1, 3.1]}
RANGE = {"file_cell": 0.5, "height_range": (-1.0, 4.0)}


@pytest.mark.parametrize(
    ("sidecar", "options", "level", "offset", "cell", "lower"),
    [
        ({}, RANGE, 1.0, -1.0, 0.5, 0.0),  # 65535 levels are 5 m: 13107 levels are 1 m
        (SIDECAR, RANGE, 1.0, -1.0, 0.5, 0.0),
        (SIDECAR, {}, 13.107, -2.0, 0.2, 0.0),
        (SIDECAR | SAMPLE, {"scale": 0.002}, 26.214, -2.0, 0.2, 3.0),
        (SAMPLE, {"scale": 0.002, "file_cell": 0.4}, 26.214, 0.0, 0.4, 2.9),
    ],
)
def test_image_columns_are_x_and_rows_go_down(
    tmp_path, sidecar, options, level, offset, cell, lower
):
    raster = read(write(tmp_path / "a.png", PIXELS, **sidecar), ReadOptions(**options))
    levels = np.array([[3, 0], [4, 1], [5, 2]])
    np.testing.assert_allclose(raster.values, levels * level + offset, atol=1e-5)
    assert raster.cell == cell
    assert raster.lower == pytest.approx((lower, lower))
    assert raster.upper == pytest.approx((lower + 3 * cell, lower + 2 * cell))


@pytest.mark.parametrize(
    ("name", "heights", "options"),
    [
        ("a.tif", np.array([[1.5, np.nan, -2.25]], np.float32), {}),
        ("a.tif", np.array([[150, -9999, -225]], np.int16), {"scale": 0.01, "nodata": -9999}),
    ],
)
def test_image_float_tiff_is_in_meters(tmp_path, name, heights, options):
    raster = read(write(tmp_path / name, heights), ReadOptions(file_cell=1.0, **options))
    np.testing.assert_allclose(raster.values, [[1.5], [np.nan], [-2.25]])


def test_image_with_8_bits_warns_about_terraces(tmp_path):
    path = write(tmp_path / "a.png", np.arange(256, dtype=np.uint8).reshape(16, 16))
    with pytest.warns(
        tk.TerrainkitWarning, match=r"a\.png: an 8-bit image has terraces: .*0\.02 m"
    ):
        read(path, ReadOptions(file_cell=1.0, height_range=(0.0, 5.1)))


METER = {"file_cell": 1.0}
COLORS, FLOATS = np.zeros((4, 5, 3), np.uint16), PIXELS.astype(np.float32)


@pytest.mark.parametrize(
    ("name", "pixels", "options", "error", "message"),
    [
        ("a.png", PIXELS, METER, ConfigError, "^height_range: missing; .* uint16 values"),
        ("a.png", PIXELS, {"scale": 1.0}, ConfigError, "^file_cell: missing"),
        ("a.tif", FLOATS, RANGE, ConfigError, "^height_range: got float32 values"),
        ("a.png", COLORS, METER, HeightFileError, r"got shape .*3.* expected a gray image"),
    ],
)
def test_image_needs_options_and_gray_pixels(tmp_path, name, pixels, options, error, message):
    with pytest.raises(error, match=message):
        read(write(tmp_path / name, pixels), ReadOptions(**options))


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_image_truncated_is_rejected(tmp_path, suffix):
    pixels = np.random.default_rng(0).integers(0, 65535, (64, 64)).astype(np.uint16)
    path = write(tmp_path / f"a{suffix}", pixels)
    path.write_bytes(path.read_bytes()[:3000])
    with pytest.raises(HeightFileError, match=r"cannot be read: not an image, truncated, or more"):
        read(path, ReadOptions(file_cell=1.0, scale=1.0))


@pytest.mark.usefixtures("real_child")
def test_image_that_claims_huge_size_is_rejected(tmp_path):
    path = write(tmp_path / "a.png", PIXELS)
    data = bytearray(path.read_bytes())
    for side in (1 << 14) + 1, 2**31 - 1:
        data[16:24] = side.to_bytes(4, "big") * 2  # width and height of the IHDR chunk
        data[29:33] = crc32(data[12:29]).to_bytes(4, "big")
        path.write_bytes(data)
        with pytest.raises(HeightFileError, match=r"more than 268435456 pixels$"):
            read(path, ReadOptions(file_cell=1.0, scale=1.0))


@pytest.mark.parametrize("text", ["[", '{"scale": "x"}', '{"first_sample": 3}', "[1]"])
def test_image_invalid_sidecar_is_rejected(tmp_path, text):
    path = write(tmp_path / "a.png", PIXELS)
    path.with_suffix(".json").write_text(text)
    with pytest.raises(HeightFileError, match=r"a\.json: got .*; expected numbers"):
        read(path, ReadOptions(file_cell=1.0, scale=1.0))

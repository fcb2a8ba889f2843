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


def test_image_columns_are_x_and_rows_go_down(tmp_path):
    path = write(tmp_path / "a.png", PIXELS)
    raster = read(path, ReadOptions(file_cell=0.5, height_range=(-1.0, 4.0)))
    # 65535 levels are 5 m: 13107 levels are 1 m. values[x, y], y upward.
    np.testing.assert_allclose(raster.values, [[2.0, -1.0], [3.0, 0.0], [4.0, 1.0]], atol=1e-6)
    assert raster.cell == 0.5
    assert raster.lower == (0.0, 0.0)
    assert raster.upper == (1.5, 1.0)


def test_image_sidecar_has_scale_and_position(tmp_path):
    path = write(
        tmp_path / "a.png", PIXELS, scale=0.001, offset=-2.0, cell=0.2, first_sample=[3.1, -0.9]
    )
    raster = read(path, ReadOptions())
    assert raster.values[0, 0] == pytest.approx(39.321 - 2.0)
    assert raster.cell == 0.2
    assert raster.lower == pytest.approx((3.0, -1.0))


def test_image_options_override_the_sidecar(tmp_path):
    path = write(tmp_path / "a.png", PIXELS, scale=0.001, offset=-2.0, cell=0.2)
    raster = read(path, ReadOptions(file_cell=0.5, height_range=(0.0, 5.0)))
    assert raster.values[2, 0] == pytest.approx(5.0)
    assert raster.cell == 0.5


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("suffix", [".tif", ".tiff"])
def test_image_float_tiff_is_in_meters(tmp_path, dtype, suffix):
    heights = np.array([[1.5, -2.25, np.nan]], dtype=dtype)
    raster = read(write(tmp_path / f"a{suffix}", heights), ReadOptions(file_cell=1.0))
    np.testing.assert_array_equal(raster.values, [[1.5], [-2.25], [np.nan]])


def test_image_scale_and_nodata(tmp_path):
    heights = np.array([[100, -9999, 250]], dtype=np.int16)
    options = ReadOptions(file_cell=1.0, scale=0.01, nodata=-9999)
    raster = read(write(tmp_path / "a.tif", heights), options)
    np.testing.assert_allclose(raster.values, [[1.0], [np.nan], [2.5]])


def test_image_with_8_bits_warns_about_terraces(tmp_path):
    path = write(tmp_path / "a.png", np.arange(256, dtype=np.uint8).reshape(16, 16))
    with pytest.warns(
        tk.TerrainkitWarning, match=r"a\.png: an 8-bit image has terraces: .*0\.02 m"
    ):
        read(path, ReadOptions(file_cell=1.0, height_range=(0.0, 5.1)))


def test_image_needs_a_height_range(tmp_path):
    path = write(tmp_path / "a.png", PIXELS)
    with pytest.raises(ConfigError, match=r"^height_range: missing; .* uint16 values"):
        read(path, ReadOptions(file_cell=1.0))


def test_image_needs_a_cell(tmp_path):
    path = write(tmp_path / "a.png", PIXELS)
    with pytest.raises(ConfigError, match=r"^file_cell: missing"):
        read(path, ReadOptions(scale=1.0))


def test_image_height_range_needs_unsigned_integers(tmp_path):
    path = write(tmp_path / "a.tif", np.zeros((2, 2), np.float32))
    with pytest.raises(ConfigError, match=r"^height_range: got float32 values"):
        read(path, ReadOptions(file_cell=1.0, height_range=(0.0, 1.0)))


def test_image_with_colors_is_rejected(tmp_path):
    path = write(tmp_path / "a.png", np.zeros((4, 5, 3), np.uint16))
    with pytest.raises(HeightFileError, match=r"got shape .*3.* expected a gray image"):
        read(path, ReadOptions(file_cell=1.0, scale=1.0))


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

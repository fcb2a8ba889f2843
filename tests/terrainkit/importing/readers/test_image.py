import json
from zlib import crc32

import cv2
import numpy as np
import pytest

import terrainkit as tk
from terrainkit.errors import ConfigError, HeightFileError
from terrainkit.importing.readers import image
from terrainkit.importing.readers.image import read
from terrainkit.importing.readers.import_options import ReadOptions

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
        (SIDECAR | SAMPLE, {"file_cell": 0.4}, 13.107, -2.0, 0.4, 0.0),
    ],
)
@pytest.mark.filterwarnings("ignore:.*with heights over")
def test_image_columns_are_x_and_rows_go_down(
    tmp_path, sidecar, options, level, offset, cell, lower
):
    raster = read(write(tmp_path / "a.png", PIXELS, **sidecar), ReadOptions(**options))
    levels = np.array([[3, 0], [4, 1], [5, 2]])
    np.testing.assert_allclose(raster.values, levels * level + offset, atol=1e-5)
    assert raster.cell == cell
    assert raster.lower == pytest.approx((lower, lower))
    assert raster.upper == pytest.approx((lower + 3 * cell, lower + 2 * cell))


def test_image_with_8_bits_warns_about_terraces(tmp_path):
    path = write(tmp_path / "a.png", np.arange(256, dtype=np.uint8).reshape(16, 16))
    with pytest.warns(tk.TerrainkitWarning, match=r"a\.png: 8 bits have terraces: .*0\.02 m"):
        read(path, ReadOptions(file_cell=1.0, height_range=(0.0, 5.1)))


GRAY = (np.arange(20).reshape(4, 5) * 3000).astype(np.uint16)


def tinted(*offsets):
    """Return an image whose blue, green, red (and opacity) are a gray plus offsets."""
    return np.stack([GRAY + np.uint16(each) for each in offsets], axis=2)


@pytest.mark.parametrize("opacity", [(), (0,)])
def test_image_of_equal_colors_is_gray(tmp_path, opacity):
    path = write(tmp_path / "a.png", tinted(0, 0, 0, *opacity))
    raster = read(path, ReadOptions(file_cell=9.0, scale=1e-3))
    expected = GRAY[::-1].T * 1e-3
    if opacity:
        expected[0, 3] = np.nan  # the pixel of opacity 0
    np.testing.assert_allclose(raster.values, expected, atol=1e-5)


def test_image_of_other_colors_needs_a_band(tmp_path):
    path = write(tmp_path / "a.png", tinted(0, 2000, 0))
    options = {"file_cell": 9.0, "scale": 1e-3}
    with pytest.raises(HeightFileError, match=r"got 3 different colors .*band=1"):
        read(path, ReadOptions(**options))
    green = read(path, ReadOptions(**options, band=2))
    assert green.values[0, 3] == pytest.approx(2.0)
    with pytest.raises(ConfigError, match=r"^band: got 4; .* has 3"):
        read(path, ReadOptions(**options, band=4))


@pytest.mark.parametrize(
    ("dtype", "options", "message"),
    [
        (np.uint16, {}, r"got uint16 values .*file_cell=0\.1` .* `height_range=\(0, 2\)` "),
        (np.uint16, {"file_cell": 1.0}, "got uint16 values.*example `height_range=\\(0, 2\\)"),
        (np.uint16, {"scale": 1.0}, "got uint16 values.*example `file_cell=0.1`[^=]*$"),
        (np.float32, {}, r"got float32 values.*example `file_cell=0\.1` \(.*\), or"),
        (np.float32, RANGE, "^height_range: got float32 values"),
    ],
)
def test_image_needs_options(tmp_path, dtype, options, message):
    with pytest.raises(ConfigError, match=message):
        read(write(tmp_path / "a.tif", PIXELS.astype(dtype)), ReadOptions(**options))


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_image_truncated_is_rejected(tmp_path, monkeypatch, suffix):
    monkeypatch.setattr(image, "is_installed", lambda _: False)
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


@pytest.mark.parametrize("text", ["[", '{"scale": "x"}', '{"cell": 1, "first_sample": 3}', "[1]"])
def test_image_invalid_sidecar_is_rejected(tmp_path, text):
    path = write(tmp_path / "a.png", PIXELS)
    path.with_suffix(".json").write_text(text)
    with pytest.raises(HeightFileError, match=r"a\.json: got .*; expected numbers"):
        read(path, ReadOptions(file_cell=1.0, scale=1.0))

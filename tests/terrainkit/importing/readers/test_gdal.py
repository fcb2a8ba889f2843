from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from terrainkit.errors import HeightFileError, TerrainkitWarning
from terrainkit.importing.readers.gdal import read_gdal
from terrainkit.importing.readers.geotiff import read_geo_tags
from terrainkit.importing.readers.height_source import open_source
from terrainkit.importing.readers.import_options import ReadOptions
from tests.terrainkit.importing.readers import test_geotiff as geotiff


@pytest.mark.parametrize(
    "tags",
    [
        {},
        {"order": ">", "keys": geotiff.POINTS},
        {"keys": geotiff.DEGREES},
        {"keys": geotiff.WEB_MERCATOR},
        {"scale": (), "matrix": geotiff.MATRIX},
        {"keys": (1, 1, 0, 2, 1024, 0, 1, 1, 4099, 0, 1, 9002)},
        {"scale": (), "tie_point": (), "keys": (), "nodata": b""},
    ],
)
def test_gdal_and_own_reader_of_tags_agree(tmp_path, tags):
    pytest.importorskip("rasterio")
    path = geotiff.write(tmp_path / "a.tif", **tags)
    pixels, reference = read_gdal(path)
    assert reference == replace(read_geo_tags(path), nodata=None)
    assert pixels.mask.any() == ("nodata" not in tags)
    np.testing.assert_array_equal(pixels.data[..., 0], geotiff.HEIGHTS)


def write(path, bands, **profile):
    import rasterio

    rows, cols = bands.shape[1:]
    options = {"driver": "GTiff", "dtype": bands.dtype, "count": len(bands), **profile}
    with rasterio.open(path, "w", width=cols, height=rows, **options) as file:
        file.write(bands)
    return path


BANDS = np.arange(2 * 40 * 30, dtype=np.float32).reshape(2, 40, 30) / 7


@pytest.mark.filterwarnings("ignore:Dataset has no geotransform")
@pytest.mark.parametrize(
    "profile", [{"compress": "lzw", "predictor": 3}, {"BIGTIFF": "YES"}, {"tiled": True}]
)
def test_gdal_reads_bands_of_all_tiffs(tmp_path, profile):
    pytest.importorskip("rasterio")
    path = write(tmp_path / "a.tif", BANDS, **profile)
    with pytest.raises(HeightFileError, match=r"2 different colors or bands; .*band=1"):
        open_source(path, ReadOptions(file_cell=1.0))
    found = open_source(path, ReadOptions(file_cell=1.0, band=2))
    np.testing.assert_array_equal(found.values, BANDS[1, ::-1].T)


def test_gdal_reads_srtm_tiles_by_their_names(tmp_path):
    pytest.importorskip("rasterio")
    heights = np.add.outer(np.arange(1201), np.zeros(1201)).astype(">i2")
    heights[5, 7] = -32768
    Path(tmp_path / "S61E010.hgt").write_bytes(heights.tobytes())
    with pytest.warns(TerrainkitWarning) as caught:
        found = open_source(tmp_path / "S61E010.hgt", ReadOptions())
    assert "degrees at latitude -60.5" in str(caught[0].message)
    # A degree of longitude is 111.32 km times the cosine of the latitude, within 0.3 %.
    assert found.cell == pytest.approx(111320 * np.cos(np.radians(60.5)) / 1200, rel=3e-3)
    assert found.values[0, [0, 1200]].tolist() == [1200, 0]
    assert np.argwhere(np.isnan(found.values)).tolist() == [[7, 1195]]

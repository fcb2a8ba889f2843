import struct
from contextlib import nullcontext

import numpy as np
import pytest

from terrainkit.errors import HeightFileError, TerrainkitWarning
from terrainkit.importing.readers import geotiff, image
from terrainkit.importing.readers.image import read
from terrainkit.importing.readers.import_options import ReadOptions

# Two rows of three cells of 2 m; the upper left corner is at (500000, 4649776).
HEIGHTS = np.array([[1, 2, 3], [4, -9999, 6]], dtype=np.float32)
SCALE, TIE_POINT = (2.0, 2.0, 0.0), (0.0, 0.0, 0.0, 500000.0, 4649776.0, 0.0)
UTM = (1, 1, 0, 1, 1024, 0, 1, 1)
DEGREES = (1, 1, 0, 1, 1024, 0, 1, 2)
US_FEET = (1, 1, 0, 3, 1024, 0, 1, 1, 3076, 0, 1, 9003, 4099, 0, 1, 9002)
WEB_MERCATOR = (1, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, 3857)
POINTS = (1, 1, 0, 2, 1024, 0, 1, 1, 1025, 0, 1, 2)


def write(
    path,
    scale=SCALE,
    tie_point=TIE_POINT,
    keys=UTM,
    nodata=b"-9999\0",
    order="<",
    matrix=(),
    bands=1,
):
    """Write a GeoTIFF of one strip as GDAL does."""
    rows, cols = HEIGHTS.shape
    tags = [
        (256, "H", (cols,)), (257, "H", (rows,)), (258, "H", (32,)), (259, "H", (1,)),
        (262, "H", (1,)), (273, "I", (8,)), (277, "H", (bands,)), (278, "H", (rows,)),
        (279, "I", (HEIGHTS.nbytes,)), (339, "H", (3,)),
        (33550, "d", scale), (33922, "d", tie_point), (34264, "d", matrix),
        (34735, "H", keys), (42113, "s", nodata),
    ]  # fmt: skip
    kinds = {"s": 2, "H": 3, "I": 4, "d": 12}
    tags = [each for each in tags if len(each[2])]
    start = 8 + HEIGHTS.nbytes
    extra = start + 2 + 12 * len(tags) + 4
    entries, data = b"", b""
    for tag, kind, values in tags:
        packed = values if kind == "s" else struct.pack(f"{order}{len(values)}{kind}", *values)
        entries += struct.pack(f"{order}HHI", tag, kinds[kind], len(values))
        if len(packed) > 4:
            entries += struct.pack(f"{order}I", extra + len(data))
            data += packed
        else:
            entries += packed.ljust(4, b"\0")
    head = {"<": b"II", ">": b"MM"}[order] + struct.pack(f"{order}HI", 42, start)
    pixels = HEIGHTS.astype(f"{order}f4").tobytes()
    directory = struct.pack(f"{order}H", len(tags)) + entries + bytes(4)
    path.write_bytes(head + pixels + directory + data)
    return path


@pytest.mark.parametrize("order", ["<", ">"])
def test_geotiff_states_cell_position_and_nodata(tmp_path, order):
    raster = read(write(tmp_path / "a.tif", order=order), ReadOptions())
    assert raster.cell == 2.0
    assert raster.lower == (500000.0, 4649776.0 - 4.0)
    np.testing.assert_array_equal(raster.values, [[4, 1], [np.nan, 2], [6, 3]])


@pytest.fixture(autouse=True)
def no_gdal(monkeypatch):
    """Read the tags without GDAL, also where rasterio is installed."""
    monkeypatch.setattr(image, "is_installed", lambda _: False)


# At latitude 60, a degree is 55.8 km along x and 111.4 km along y.
NORTH = (0.0, 0.0, 0.0, 10.0, 60.001, 0.0)
MATRIX = (0.0, 2.0, 0.0, 7.0, 1.0, 0.0, 0.0, 8.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


@pytest.mark.parametrize(
    ("tags", "spacing", "lower", "warning"),
    [
        ({"scale": (2.0, 2.001, 0.0)}, (2.0, 2.001), (500000.0, 4649776.0 - 4.002), None),
        ({"keys": POINTS}, (2.0, 2.0), (499999.0, 4649773.0), None),
        (
            {"scale": (2.0, 3.0, 0.0)},
            (2.0, 3.0),
            (500000.0, 4649776.0 - 6.0),
            r"cells of 2 x 3 m \(aspect ratio 1\.5\); they become squares of 2 m$",
        ),
        (
            {"keys": US_FEET},
            (2400 / 3937,) * 2,
            (500000 * 1200 / 3937, 4649772 * 1200 / 3937),
            None,
        ),
        (
            {"keys": DEGREES, "scale": (0.001, 0.001, 0.0), "tie_point": NORTH},
            (55.800, 111.412),
            (0.0, 0.0),
            r"0\.001 x 0\.001 degrees at latitude 60, .*ratio 2\); .*corner becomes \(0, 0\)",
        ),
        (
            {"keys": WEB_MERCATOR, "tie_point": (0.0, 0.0, 0.0, 0.0, 8399737.9, 0.0)},
            (1.0, 1.0),
            (0.0, 0.0),
            r"cells of 2 x 2 m of web maps at latitude 60, which are 1 m x 1 m",
        ),
        (
            {"scale": (), "matrix": MATRIX},
            (1.0, 2.0),
            (0.0, 0.0),
            r"cells of 1 x 2 m along turned axes \(aspect ratio 2\)",
        ),
    ],
    ids=["almost square", "points", "not square", "feet", "degrees", "web map", "turned"],
)
def test_geotiff_cells_become_squares_in_meters(tmp_path, tags, spacing, lower, warning):
    path = write(tmp_path / "a.tif", **tags)
    with pytest.warns(TerrainkitWarning, match=warning) if warning else nullcontext():
        raster = read(path, ReadOptions())
    assert raster.spacing == pytest.approx(spacing, rel=1e-4)
    assert raster.lower == pytest.approx(lower)
    assert raster.values[2, 1] == pytest.approx(3 * (0.3048 if tags.get("keys") == US_FEET else 1))
    raster = read(path, ReadOptions(file_cell=(0.5, 0.75)))
    assert (raster.spacing, raster.lower) == ((0.5, 0.75), (0.0, 0.0))


@pytest.mark.parametrize(
    "tags",
    [
        {"scale": (0.0, 1.0, 0.0)},
        {"scale": (np.nan, 1.0, 0.0)},
        {"scale": (1.0, 0.99e-4, 0.0)},
        {"scale": (1.01e6, 1.0, 0.0)},
        {"keys": DEGREES, "tie_point": (0.0, 0.0, 0.0, 10.0, 93.0, 0.0)},
    ],
    ids=["zero", "NaN", "small", "large", "beyond the pole"],
)
def test_geotiff_with_cells_without_size_is_rejected(tmp_path, tags):
    with pytest.raises(HeightFileError, match=r"expected 0\.0001 m to 1,000,000 m"):
        read(write(tmp_path / "a.tif", **tags), ReadOptions())


def test_geotiff_whose_bands_opencv_drops_is_rejected(tmp_path, monkeypatch):
    path = write(tmp_path / "a.tif", bands=4)
    monkeypatch.setattr(image, "decode", lambda *_: {"pixels": HEIGHTS})
    with pytest.raises(HeightFileError, match=r"got 1 of 4 bands; expected all; .* pip install"):
        read(path, ReadOptions())


def test_geotiff_tags_of_many_values_are_not_read(tmp_path, monkeypatch):
    path = write(tmp_path / "a.tif")
    monkeypatch.setattr(geotiff, "MAX_VALUES", 8)
    assert read(path, ReadOptions()).cell == 2.0  # the keys are 8 numbers
    monkeypatch.setattr(geotiff, "MAX_VALUES", 7)
    with pytest.raises(HeightFileError, match="tag 34735 has 8 values of type 3"):
        read(path, ReadOptions())


@pytest.mark.parametrize("tags", [{"scale": (1.0,)}, {"tie_point": (1.0,)}, {"nodata": b"none\0"}])
def test_geotiff_invalid_tags_are_rejected(tmp_path, tags):
    with pytest.raises(HeightFileError, match=r"a\.tif: got invalid TIFF tags: "):
        read(write(tmp_path / "a.tif", **tags), ReadOptions())

import struct

import numpy as np
import pytest

from terrainkit.errors import ConfigError, HeightFileError
from terrainkit.importing.image import read
from terrainkit.importing.options import ReadOptions

# Two rows of three cells of 2 m; the upper left corner is at (500000, 4649776).
HEIGHTS = np.array([[1, 2, 3], [4, -9999, 6]], dtype=np.float32)
SCALE, TIE_POINT = (2.0, 2.0, 0.0), (0.0, 0.0, 0.0, 500000.0, 4649776.0, 0.0)
UTM = (1, 1, 0, 1, 1024, 0, 1, 1)
DEGREES = (1, 1, 0, 1, 1024, 0, 1, 2)
US_FEET = (1, 1, 0, 2, 1024, 0, 1, 1, 3076, 0, 1, 9003)
POINTS = (1, 1, 0, 2, 1024, 0, 1, 1, 1025, 0, 1, 2)


def write(path, scale=SCALE, tie_point=TIE_POINT, keys=UTM, nodata=b"-9999\0", order="<"):
    """Write a GeoTIFF of one strip as GDAL does."""
    rows, cols = HEIGHTS.shape
    tags = [
        (256, "H", (cols,)), (257, "H", (rows,)), (258, "H", (32,)), (259, "H", (1,)),
        (262, "H", (1,)), (273, "I", (8,)), (277, "H", (1,)), (278, "H", (rows,)),
        (279, "I", (HEIGHTS.nbytes,)), (339, "H", (3,)),
        (33550, "d", scale), (33922, "d", tie_point), (34735, "H", keys), (42113, "s", nodata),
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


def test_geotiff_of_points_is_half_a_cell_lower(tmp_path):
    tie_point = (1.0, 1.0, 0.0, 10.0, 20.0, 0.0)  # the center of the second pixel of both axes
    raster = read(write(tmp_path / "a.tif", keys=POINTS, tie_point=tie_point), ReadOptions())
    assert raster.lower == (10.0 - 3.0, 20.0 - 1.0)


@pytest.mark.parametrize(
    ("tags", "message"),
    [
        ({"keys": DEGREES}, r"has cells of 2 x 2, not in meters; expected squares in meters"),
        ({"keys": US_FEET}, r"has cells of 2 x 2, not in meters; expected squares in meters"),
        ({"scale": (2.0, 3.0, 0.0)}, r"has cells of 2 x 3 m; expected squares in meters"),
        ({"scale": (np.nan, 1.0, 0.0)}, r"has cells of nan x 1 m; expected squares in meters"),
        ({"scale": ()}, r"does not state the distance of its samples"),
    ],
)
def test_geotiff_without_cells_in_meters_needs_file_cell(tmp_path, tags, message):
    path = write(tmp_path / "a.tif", **tags)
    with pytest.raises(ConfigError, match=rf"^file_cell: missing; .*a\.tif {message}$"):
        read(path, ReadOptions())
    raster = read(path, ReadOptions(file_cell=0.5))
    assert (raster.cell, raster.lower) == (0.5, (0.0, 0.0))


@pytest.mark.parametrize("tags", [{"scale": (1.0,)}, {"tie_point": (1.0,)}, {"nodata": b"none\0"}])
def test_geotiff_invalid_tags_are_rejected(tmp_path, tags):
    with pytest.raises(HeightFileError, match=r"a\.tif: got invalid TIFF tags: "):
        read(write(tmp_path / "a.tif", **tags), ReadOptions())

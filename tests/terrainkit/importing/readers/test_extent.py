from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from terrainkit.errors import HeightFileError, TerrainkitWarning
from terrainkit.importing.readers.extent import MAX_SAMPLES, check_length, check_samples
from terrainkit.importing.readers.height_source import VertexSource
from terrainkit.importing.readers.import_options import ReadOptions
from terrainkit.importing.readers.raster import read_raster
from tests.meshes import box


def source(x, y, *, is_metric=False):
    return VertexSource(vertices=np.array([[0, 0, 0], [x, y, 1]], float), is_metric=is_metric)


@pytest.mark.parametrize(
    ("size", "message"),
    [
        ((1.0, 0.5), None),
        ((0.999, 0.5), r"^a\.stl is 0\.999 m x 0\.5 m; expected at least 10 cells of 0\.1 m"),
        ((0.05, 0.03), r"smaller cell, such as `cell=0\.0045`, or a scale if its unit is larger"),
        ((0.0, 0.0), "is 0 m x 0 m; expected at least 10 cells"),
    ],
)
def test_length_is_at_least_ten_cells(size, message):
    with pytest.raises(HeightFileError, match=message) if message else nullcontext():
        check_length(Path("a.stl"), source(*size), 0.1)


DOUBT = r"^a\.stl is {} m: in millimeters\? `scale=0\.001` .*"


@pytest.mark.parametrize(
    ("size", "samples", "is_metric", "kind", "message"),
    [
        ((499, 50), MAX_SAMPLES, False, None, None),
        ((501, 50), 5000, False, TerrainkitWarning, DOUBT.format("501 m x 50")),
        ((501, 50), 4 * MAX_SAMPLES, True, None, None),
        ((9990, 50), 5000, True, None, None),
        ((99, 50), MAX_SAMPLES + 1, False, HeightFileError, DOUBT.format("99 m x 50")),
        (
            (1990, 200),
            39_800_000,
            False,
            HeightFileError,
            DOUBT.format("1990 m x 200") + r"; 39800000 samples of 0\.1 m; .*: `cell=0\.32`,",
        ),
    ],
)
def test_samples_of_a_large_source_are_doubtful(size, samples, is_metric, kind, message):
    expected = nullcontext()
    if kind:
        expected = (pytest.warns if kind is TerrainkitWarning else pytest.raises)(
            kind, match=message
        )
    with expected:
        check_samples(Path("a.stl"), source(*size, is_metric=is_metric), 0.1, samples)


@pytest.mark.parametrize(
    ("size", "message"), [((0.5, 0.5, 1), "at least 10 cells"), ((1990, 500, 180), "millimeters")]
)
def test_extent_of_a_mesh_of_a_generated_map_is_checked(tmp_path, size, message):
    box(size, (0, 0, 0)).export(tmp_path / "a.stl")
    with pytest.raises(HeightFileError, match=message):
        read_raster(tmp_path / "a.stl", ReadOptions(), "nearest", 0.1)

from pathlib import Path

import numpy as np
import pytest

from terrainkit.errors import HeightFileError, TerrainkitWarning
from terrainkit.importing.mesh_extent import (
    MAX_SAMPLES,
    check_length,
    check_samples,
    round_down,
    warn_about_up,
)
from terrainkit.importing.mesh_file import MeshSource
from tests.meshes import box


def source(size, *, is_metric=False):
    mesh = box(size, (0, 0, 0))
    return MeshSource(
        vertices=np.asarray(mesh.vertices, float), faces=np.asarray(mesh.faces), is_metric=is_metric
    )


def check(size, samples=1000, cell=0.1, **options):
    mesh = source(size, **options)
    check_length(Path("a.stl"), mesh, cell)
    check_samples(Path("a.stl"), mesh, samples, cell)


@pytest.mark.parametrize(
    ("size", "samples", "message"),
    [
        ((99.9, 50, 1), MAX_SAMPLES, None),
        (
            (0.999, 0.5, 1),
            50,
            r"0\.999 m x 0\.5 m; expected at least 10 cells of 0\.1 m: --scale 10 ",
        ),
        ((0.05, 0.03, 1), 1, r"--scale 100 if its unit is larger than a meter, or --cell 0\.005$"),
        ((1.0, 0.5, 1), 50, None),
        ((0.0, 0.0, 1), 1, r"0 m x 0 m; expected at least 10 cells .* --cell 0\.0001$"),
        (
            (1990, 200, 180),
            39_800_000,
            r"^a\.stl is 1990 m x 200 m: in millimeters\? --scale 0\.001 .*; 39800000 samples of "
            r"0\.1 m; expected at most 4194304: --cell 0\.4,",
        ),
        ((99, 50, 1), MAX_SAMPLES + 1, "expected at most"),
    ],
)
def test_extent_of_a_mesh_without_unit(size, samples, message):
    if message:
        with pytest.raises(HeightFileError, match=message):
            check(size, samples)
    else:
        check(size, samples)


def test_extent_of_a_large_mesh_without_unit_is_doubtful():
    with pytest.warns(TerrainkitWarning, match=r"is 101 m x 50 m: in millimeters\? --scale 0\.001"):
        check((101, 50, 1))
    check((2000, 2000, 50), 4 * MAX_SAMPLES, is_metric=True)


@pytest.mark.parametrize(
    ("size", "is_warned"),
    [((10, 1, 10), True), ((10, 5.1, 10), False), ((10, 4, 8), False), ((10, 1, 2), False)],
)
@pytest.mark.parametrize(("up", "other"), [("z", "y"), ("y", "z")])
def test_mesh_that_lies_on_its_side_is_warned_of(size, is_warned, up, other):
    def warn():
        warn_about_up(Path("a.stl"), source(size), up)

    if is_warned:
        with pytest.warns(TerrainkitWarning, match=rf"10 m high and 1 m wide.*--up {other}$"):
            warn()
    else:
        warn()


@pytest.mark.parametrize(
    ("value", "expected"), [(0.0999, 0.09), (0.3, 0.3), (2.45, 2.0), (-0.154, -0.2), (-2.0, -2.0)]
)
def test_round_down_keeps_one_digit(value, expected):
    assert round_down(value) == pytest.approx(expected, abs=1e-12)

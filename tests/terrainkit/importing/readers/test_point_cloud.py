from contextlib import nullcontext

import numpy as np
import pytest
import trimesh

from terrainkit.errors import ConfigError, HeightFileError, TerrainkitWarning
from terrainkit.importing.readers import height_source as source_module
from terrainkit.importing.readers.height_source import open_source
from terrainkit.importing.readers.import_options import ReadOptions
from terrainkit.importing.readers.point_cloud import PointSource, read
from terrainkit.importing.readers.raster import Raster

X = np.array([0.5, 1.5, 2.5])


@pytest.mark.parametrize(
    ("z", "expected"),
    [
        (np.linspace(0.0, 4.0, 41), 3.1),  # a wall: 80 % are below 3.2 m, so from 2.2 m on
        ([0.0, 0.1, 0.0, 2.0, 2.2], 2.1),  # a table
        ([5.0, 0.0, 0.2, 0.0, 0.2, 0.1], 0.15),  # a stray point
        ([5.0, 0.0, 0.0, 0.0], 5.0),
        ([-1.0], -1.0),
    ],
)
def test_height_of_points_is_the_median_of_their_highest_surface(z, expected):
    points = np.column_stack([np.full(len(z), 1.5), np.full(len(z), 0.5), z])
    corners = [[0.0, 0.0, 0.0], [3.0, 3.0, 0.0]]
    found = PointSource(vertices=np.concatenate([points, corners]), cell=1.0).heights(X, X)
    assert found[1, 0] == pytest.approx(expected)
    assert np.isnan(found[:, 1]).all()


def pcd(kind, data):
    return (
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x _ y z\nSIZE 4 1 4 8\nTYPE F U F F\nCOUNT 1 3 1 1\n"
        f"WIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA {kind}\n"
    ).encode() + data


TABLE = np.zeros(2, [("x", "<f4"), ("_", "u1", 3), ("y", "<f4"), ("z", "<f8")])
TABLE["x"], TABLE["y"], TABLE["z"] = [1, 2], [3, 5], [7, np.nan]


@pytest.mark.parametrize(
    ("kind", "data"),
    [("ascii", b"1 0 0 0 3 7\n2 0 0 0 5 nan\n"), ("binary", TABLE.tobytes()), ("lzf", b"")],
)
def test_pcd_has_its_points(tmp_path, kind, data):
    (tmp_path / "a.pcd").write_bytes(pcd(kind, data))
    if kind == "lzf":
        with pytest.raises(HeightFileError, match="got lzf; expected ascii or binary"):
            read(tmp_path / "a.pcd", ReadOptions())
    else:
        found = read(tmp_path / "a.pcd", ReadOptions(scale=2.0))
        assert found.vertices.tolist() == [[2, 6, 14]]


@pytest.mark.parametrize("text", ["1 2 3\n4,5", "a b", "", "1 2\n", "VERSION 7\nDATA ascii\n1 2 a"])
@pytest.mark.parametrize("suffix", ["xyz", "pcd"])
def test_damaged_points_are_rejected(tmp_path, suffix, text):
    (tmp_path / f"a.{suffix}").write_text(text)
    with pytest.raises(HeightFileError, match=rf"a\.{suffix}"):
        open_source(tmp_path / f"a.{suffix}", ReadOptions())


def test_xyz_on_a_regular_grid_is_a_raster(tmp_path):
    x, y = np.meshgrid(np.arange(4) * 0.5 + 100, np.arange(3) * 0.5, indexing="ij")
    rows = [f"{a},{b},{a - b},255\n" for a, b in zip(x.ravel(), y.ravel(), strict=True)]
    (tmp_path / "a.xyz").write_text("// X,Y,Z,R\n" + "".join(rows[:-1]))
    source = open_source(tmp_path / "a.xyz", ReadOptions())
    assert isinstance(source, Raster)
    assert (source.cell, source.lower) == (0.5, (99.75, -0.25))
    np.testing.assert_array_equal(np.isnan(source.values), np.arange(12).reshape(4, 3) == 11)
    assert source.values[3, 1] == 101.0
    (tmp_path / "b.xyz").write_text("".join([*rows[:8], rows[0]]))  # two points at one position
    assert isinstance(open_source(tmp_path / "b.xyz", ReadOptions()), PointSource)


def test_ply_without_faces_is_a_point_cloud(tmp_path):
    points = np.random.default_rng(0).random((600, 3)) * [10, 1, 5]
    trimesh.PointCloud(points).export(tmp_path / "a.ply")
    source = open_source(tmp_path / "a.ply", ReadOptions(up="y"))
    assert isinstance(source, PointSource)
    # 50 m2 with 6 points in a cell: 0.7 m.
    assert source.cell == pytest.approx(0.7)
    np.testing.assert_allclose(source.vertices, points[:, [0, 2, 1]] * [1, -1, 1], atol=1e-6)


@pytest.mark.parametrize(
    ("suffix", "module"),
    [(".las", "laspy"), (".LAZ", "laspy"), (".hgt", "rasterio"), (".usd", "pxr")],
)
def test_missing_modules_are_named_with_their_extra(tmp_path, monkeypatch, suffix, module):
    monkeypatch.setattr(source_module, "is_installed", lambda _: False)
    (tmp_path / f"a{suffix}").write_bytes(b"0" * 8)
    with pytest.raises(HeightFileError, match=rf"files need {module}; run: pip install "):
        open_source(tmp_path / f"a{suffix}", ReadOptions())


def save_las(path, classes, records=()):
    laspy = pytest.importorskip("laspy")
    cloud = laspy.create()
    cloud.header.scales = [0.01, 0.01, 0.01]
    cloud.x, cloud.y = np.arange(len(classes)), np.arange(len(classes)) ** 2
    cloud.z = 10 * np.array(classes)
    cloud.classification = classes
    cloud.header.vlrs.extend(records)
    cloud.write(path)
    return path


@pytest.mark.parametrize(
    ("classes", "wanted", "expected"),
    [
        ([2, 5, 2, 6], None, [20, 20]),
        ([2, 5, 2, 6], (5, 6, 9), [50, 60]),
        ([1, 5, 1, 6], None, [10, 50, 10, 60]),
        ([2, 2, 2], None, [20, 20, 20]),
    ],
)
def test_las_has_the_points_of_its_ground(tmp_path, classes, wanted, expected):
    path = save_las(tmp_path / "a.las", classes)
    is_cut = wanted is None and len(expected) < len(classes)
    message = (
        r"the 2 of 4 points of class 2 \(ground\) are taken; `point_class=\(2, 5, 6\)` takes all"
    )
    with pytest.warns(TerrainkitWarning, match=message) if is_cut else nullcontext():
        source = read(path, ReadOptions(point_class=wanted))
    assert source.vertices[:, 2].tolist() == expected


def test_las_without_the_class_is_rejected(tmp_path):
    path = save_las(tmp_path / "a.las", [2, 5])
    with pytest.raises(ConfigError, match=r"class: got \(9,\); .*a\.las has the classes 2, 5$"):
        read(path, ReadOptions(point_class=(9,)))


@pytest.mark.parametrize(
    ("number", "data", "is_feet"),
    [
        (34735, np.array([1, 1, 0, 1, 3076, 0, 1, 9003], "<u2").tobytes(), True),
        (34735, np.array([1, 1, 0, 1, 3076, 0, 1, 9001], "<u2").tobytes(), False),
        (34735, np.array([1, 1, 0, 1, 4099, 0, 1, 9003], "<u2").tobytes(), True),
        (2112, b'PROJCS["a",UNIT["US survey foot",0.3048006]]\0', True),
        (2112, b'PROJCS["a",UNIT["metre",1]]\0', False),
    ],
)
def test_las_in_feet_is_warned_of(tmp_path, number, data, is_feet):
    laspy = pytest.importorskip("laspy")
    record = laspy.VLR("LASF_Projection", number, record_data=data)
    path = save_las(tmp_path / "a.las", [2, 2, 2], [record])
    message = "states feet, which are taken as meters; `scale=0.3048` converts them$"
    with pytest.warns(TerrainkitWarning, match=message) if is_feet else nullcontext():
        assert read(path, ReadOptions()).upper == (2.0, 4.0)
    assert read(path, ReadOptions(scale=0.5)).upper == (1.0, 2.0)

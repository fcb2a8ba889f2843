import numpy as np
import pytest
import trimesh

from terrainkit.errors import HeightFileError, TerrainkitWarning
from terrainkit.importing.options import ReadOptions
from terrainkit.importing.point_cloud import PointSource, _decompress, read
from terrainkit.importing.raster import Raster
from terrainkit.importing.source import open_source

X = np.array([0.5, 1.5, 2.5])


def column(x, z):
    """Return points of different heights at x, y = 0.5."""
    return np.column_stack([np.full(len(z), x), np.full(len(z), 0.5), z])


def heights(*columns):
    corners = [[0.0, 0.0, 0.0], [3.0, 3.0, 0.0]]
    points = np.concatenate([*columns, corners])
    return PointSource(points=points, cell=1.0).heights(X, X)


def test_height_of_points_is_the_median_of_their_highest_surface():
    wall = column(0.5, np.linspace(0.0, 4.0, 41))  # to 4 m: the median of 3 m to 4 m
    table = column(1.5, [0.0, 0.1, 0.0, 2.0, 2.2])
    found = heights(wall, table, column(2.5, [-1.0]))
    np.testing.assert_allclose(found[:, 0], [3.5, 2.1, -1.0], atol=1e-9)
    assert np.isnan(found[:, 1]).all()


@pytest.mark.parametrize(("number", "expected", "is_warned"), [(4, 5.0, False), (5, 0.0, True)])
def test_stray_points_above_others_are_left_out(number, expected, is_warned):
    cell = column(1.5, [5.0, *[0.0] * number])
    if not is_warned:
        assert heights(cell)[1, 0] == expected
        return
    with pytest.warns(TerrainkitWarning, match="^1 of 8 points are far above"):
        assert heights(cell)[1, 0] == expected


def pcd(kind, fields="x _ y z", data=b""):
    sizes = {"x _ y z": ("4 1 4 8", "F U F F", "1 3 1 1")}[fields]
    return (
        f"# .PCD v0.7\nVERSION 0.7\nFIELDS {fields}\nSIZE {sizes[0]}\nTYPE {sizes[1]}\n"
        f"COUNT {sizes[2]}\nWIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA {kind}\n"
    ).encode() + data


def pcd_bodies():
    table = np.zeros(2, [("x", "<f4"), ("_", "u1", 3), ("y", "<f4"), ("z", "<f8")])
    table["x"], table["y"], table["z"] = [1, 2], [3, 5], [7, np.nan]
    yield "ascii", b"1 0 0 0 3 7\n2 0 0 0 5 nan\n"
    yield "binary", table.tobytes()
    packed = b"".join(table[name].tobytes() for name in table.dtype.names)
    literals = bytes([31]) + packed[:32] + bytes([len(packed) - 33]) + packed[32:]
    yield "binary_compressed", np.array([len(literals), len(packed)], "<u4").tobytes() + literals


@pytest.mark.parametrize(("kind", "data"), list(pcd_bodies()))
def test_pcd_has_its_points_in_all_encodings(tmp_path, kind, data):
    (tmp_path / "a.pcd").write_bytes(pcd(kind, data=data))
    assert read(tmp_path / "a.pcd", ReadOptions(scale=2.0)).points.tolist() == [[2, 6, 14]]


def test_decompressed_copies_may_overlap():
    # The literals "ab", 5 bytes from 2 before, and 9 + 0 + ... from 1 before.
    data = bytes([1]) + b"ab" + bytes([3 << 5, 1]) + bytes([7 << 5, 1, 0])
    assert _decompress(data, 17) == b"ab" + b"ababa" + b"a" * 10
    with pytest.raises(ValueError, match="damaged"):
        _decompress(bytes([0, 65, 1 << 5, 9]), 9)


@pytest.mark.parametrize("text", ["1 2 3\n4,5", "a b", "", "1 2\n", "VERSION 7\nDATA ascii\n1 2 3"])
@pytest.mark.parametrize("suffix", ["xyz", "pcd"])
def test_damaged_points_are_rejected(tmp_path, suffix, text):
    (tmp_path / f"a.{suffix}").write_text(text)
    with pytest.raises(HeightFileError, match=rf"a\.{suffix}"):
        open_source(tmp_path / f"a.{suffix}", ReadOptions())


def test_xyz_on_a_regular_grid_is_a_raster(tmp_path):
    x, y = np.meshgrid(np.arange(4) * 0.5 + 100, np.arange(3) * 0.5, indexing="ij")
    rows = [f"{a},{b},{a - b},255\n" for a, b in zip(x.ravel(), y.ravel(), strict=True)]
    (tmp_path / "a.xyz").write_text("// X,Y,Z,R\n" + "".join(rows[:-1]))
    source = read(tmp_path / "a.xyz", ReadOptions())
    assert isinstance(source, Raster)
    assert (source.cell, source.lower) == (0.5, (99.75, -0.25))
    np.testing.assert_array_equal(np.isnan(source.values), np.arange(12).reshape(4, 3) == 11)
    assert source.values[3, 1] == 101.0
    (tmp_path / "b.xyz").write_text("".join([*rows[:8], rows[0]]))  # two points at one position
    assert isinstance(read(tmp_path / "b.xyz", ReadOptions()), PointSource)


def test_ply_without_faces_is_a_point_cloud(tmp_path):
    points = np.random.default_rng(0).random((600, 3)) * [10, 1, 5]
    trimesh.PointCloud(points).export(tmp_path / "a.ply")
    source = open_source(tmp_path / "a.ply", ReadOptions(up="y"))
    assert isinstance(source, PointSource)
    # 50 m2 with 6 points in a cell: 0.7 m.
    assert source.cell == pytest.approx(0.7)
    np.testing.assert_allclose(source.points, points[:, [0, 2, 1]] * [1, -1, 1], atol=1e-6)

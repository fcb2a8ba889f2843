import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from terrainkit_robots.mesh import surface
from tests.terrainkit_robots.export.made_models import surface_of

BOX = surface_of(trimesh.creation.box([1, 2, 3]))
SPHERE = surface_of(trimesh.creation.icosphere(subdivisions=3, radius=0.1))


def test_numbers_are_separated_by_white_space():
    assert list(surface.parse_float_list(b" 1\t2\n3.5\r\n-1e3 ")) == [1, 2, 3.5, -1000]
    assert surface.parse_float_list(b"").size == 0
    assert list(surface.parse_int_list(b"1 -2")) == [1, -2]


@pytest.mark.parametrize("text", [b"1 two 3", b"1,2", b"0x10", b"1 2 -"])
def test_text_instead_of_numbers_is_rejected(text):
    with pytest.raises(surface.MeshError, match="text instead of numbers"):
        surface.parse_float_list(text)


@pytest.mark.parametrize("text", [b"nan", b"1e300", b"-inf", b"1099511627776"])
def test_invalid_indices_are_rejected(text):
    with pytest.raises(surface.MeshError, match="index"):
        surface.parse_int_list(text)
    assert surface.parse_int_list(b"1099511627775") == 2**40 - 1


def test_triangulate_fan():
    triangles = surface.triangulate_fan(np.array([0, 1, 2, 3, 9, 8, 7, 5, 4]), np.array([4, 3, 2]))
    assert triangles.tolist() == [[0, 1, 2], [0, 2, 3], [9, 8, 7]]
    assert surface.triangulate_fan(np.array([1, 2, 3]), np.array([3])).tolist() == [[1, 2, 3]]
    assert surface.triangulate_fan(np.zeros(0, int), np.zeros(0, int)).shape == (0, 3)


@settings(max_examples=50, deadline=None)
@given(arrays(np.float32, (30, 3), elements=st.sampled_from([0.0, -0.0, 0.125, -7.0, 2.0**-100])))
def test_unique_points(points):
    different, which = surface.unique_points(points)
    assert len(different) == len(set(map(tuple, points.tolist())))
    assert (different[which] == points).all()


@pytest.mark.parametrize(
    ("points", "faces", "volume"),
    [
        (BOX.points, BOX.faces, 6.0),
        (BOX.points, BOX.faces[:, ::-1], -6.0),
        (np.add(BOX.points, [1e4, 0, 0]), BOX.faces, 6.0),
    ],
    ids=["box", "inverted", "far away"],
)
def test_signed_volume(points, faces, volume):
    assert surface.signed_volume(surface.Surface(points=points, faces=faces)) == pytest.approx(
        volume
    )


@pytest.mark.parametrize(
    ("faces", "closed"),
    [
        (BOX.faces, True),
        (BOX.faces[1:], False),
        (np.concatenate([BOX.faces[:1, ::-1], BOX.faces[1:]]), False),
        (np.concatenate([BOX.faces, [[0, 0, 0]]]), True),
        (np.zeros((0, 3), int), False),
    ],
    ids=["box", "missing face", "inverted face", "degenerate face", "no faces"],
)
def test_is_closed(faces, closed):
    assert surface.is_closed(surface.Surface(points=BOX.points, faces=faces)) == closed


def test_separate_triangles_are_closed_after_welding():
    corners = BOX.points[BOX.faces].reshape(-1, 3)
    loose = surface.Surface(points=corners, faces=np.arange(36).reshape(-1, 3))
    assert not surface.is_closed(loose)
    assert surface.is_closed(surface.welded(loose))
    assert len(surface.welded(loose).points) == 8


TURN = trimesh.transformations.rotation_matrix(1.0, [1, 2, 3])[:3, :3]


# The diagonal of a sheet of 1 m x 0.5 m is 1.118 m.
@pytest.mark.parametrize(
    ("height", "flat"), [(1e-3, False), (1.13e-4, False), (1.11e-4, True), (0.0, True)]
)
@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("count", [4, 5000])
def test_sheet_is_flat_in_any_orientation(height, flat, size, count):
    corners = trimesh.creation.box([1, 0.5, height]).vertices
    points = np.resize(corners, (2 * count, 3)) @ TURN * size + size
    assert surface.is_flat(points) == flat


def test_few_or_collinear_points_are_flat():
    assert surface.is_flat(np.zeros((100, 3)))
    assert surface.is_flat(np.outer(np.arange(9.0), [1, 2, 3]))
    assert surface.is_flat(np.eye(3))
    assert not surface.is_flat(np.eye(4)[:, :3])


def test_thickness_of_box():
    assert surface.thickness(BOX.points @ TURN) == pytest.approx(1 / 14**0.5)


def test_vertices_of_a_cell_become_their_mean():
    # Two cells of 0.5 along each axis; the third and the fourth point share one.
    points = np.array([[0, 0, 0], [1.0, 0, 0], [0, 0.6, 0], [0, 1, 0], [0.2, 0.2, 0]])
    coarse = surface.cluster_vertices(
        surface.Surface(points=points, faces=np.array([[0, 1, 2], [3, 0, 1]])), 2
    )
    assert coarse.points.tolist() == [[0.1, 0.1, 0], [0, 0.8, 0], [1, 0, 0]]
    assert coarse.faces.tolist() == [[0, 2, 1]]  # and the second triangle is the same one
    one = surface.cluster_vertices(
        surface.Surface(points=np.ones((3, 3)), faces=np.array([[0, 1, 2]])), 4
    )
    assert len(one.faces) == 0


def test_stl_is_read_by_trimesh(tmp_path):
    (tmp_path / "a.stl").write_bytes(surface.binary_stl(BOX))
    mesh = trimesh.load(tmp_path / "a.stl")
    assert mesh.is_watertight
    assert np.allclose(mesh.triangles, BOX.points[BOX.faces])


def test_normals_of_an_stl():
    corners = np.array([[0, 0, 0], [2, 0, 0], [0, 3, 0.0]])
    data = surface.binary_stl(
        surface.Surface(points=corners, faces=np.array([[0, 1, 2], [0, 2, 1], [0, 0, 0]]))
    )
    assert len(data) == 84 + 50 * 3
    normals = np.frombuffer(data, surface.STL_RECORD, offset=84)["normal"]
    assert normals.tolist() == [[0, 0, 1], [0, 0, -1], [0, 0, 0]]

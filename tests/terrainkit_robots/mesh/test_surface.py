import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from terrainkit_robots.mesh.surface import (
    MeshError,
    Surface,
    binary_stl,
    cluster_vertices,
    is_closed,
    is_flat,
    parse_float_list,
    parse_int_list,
    signed_volume,
    thickness,
    triangulate_fan,
    unique_points,
    welded,
)


def surface_of(mesh):
    return Surface(points=np.asarray(mesh.vertices), faces=np.asarray(mesh.faces))


def loose(surface):
    """Return the same triangles, none of which share a corner: what an STL holds."""
    points = surface.points[surface.faces].reshape(-1, 3)
    return Surface(points=points, faces=np.arange(len(points)).reshape(-1, 3))


BOX = surface_of(trimesh.creation.box([1, 2, 3]))
SPHERE = surface_of(trimesh.creation.icosphere(subdivisions=3, radius=0.1))


class TestNumbers:
    def test_white_space(self):
        assert list(parse_float_list(b" 1\t2\n3.5\r\n-1e3 ")) == [1, 2, 3.5, -1000]
        assert parse_float_list(b"").size == 0

    @pytest.mark.parametrize("text", [b"1 two 3", b"1,2", b"0x10", b"1 2 -"])
    def test_text_is_rejected(self, text):
        with pytest.raises(MeshError, match="text instead of numbers"):
            parse_float_list(text)

    @pytest.mark.parametrize("text", [b"nan", b"1e300", b"-inf"])
    def test_invalid_indices(self, text):
        with pytest.raises(MeshError, match="index"):
            parse_int_list(text)


def test_triangulate_fan():
    triangles = triangulate_fan(np.array([0, 1, 2, 3, 9, 8, 7, 5, 4]), np.array([4, 3, 2]))
    assert triangles.tolist() == [[0, 1, 2], [0, 2, 3], [9, 8, 7]]
    assert triangulate_fan(np.array([1, 2, 3]), np.array([3])).tolist() == [[1, 2, 3]]
    assert triangulate_fan(np.zeros(0, int), np.zeros(0, int)).shape == (0, 3)


@settings(max_examples=50, deadline=None)
@given(
    arrays(
        np.float32, (30, 3), elements=st.sampled_from([0.0, -0.0, 0.125, 0.375, -7.0, 2.0**-100])
    )
)
def test_unique_points(points):
    different, which = unique_points(points)
    assert len(different) == len(set(map(tuple, points.tolist())))
    assert (different[which] == points).all()


class TestVolume:
    def test_box(self):
        assert signed_volume(BOX) == pytest.approx(6.0)

    def test_inverted_faces(self):
        assert signed_volume(Surface(points=BOX.points, faces=BOX.faces[:, ::-1])) == pytest.approx(
            -6.0
        )

    def test_far_from_origin(self):
        away = Surface(points=BOX.points + np.array([1e4, 0, 0]), faces=BOX.faces)
        assert signed_volume(away) == pytest.approx(6.0)


class TestClosed:
    def test_box_of_separate_triangles(self):
        assert not is_closed(loose(BOX))
        assert is_closed(welded(loose(BOX)))
        assert len(welded(loose(BOX)).points) == 8

    def test_missing_face(self):
        assert not is_closed(Surface(points=BOX.points, faces=BOX.faces[1:]))

    def test_inverted_face(self):
        faces = BOX.faces.copy()
        faces[0] = faces[0, ::-1]
        assert not is_closed(Surface(points=BOX.points, faces=faces))

    def test_degenerate_triangle_is_ignored(self):
        faces = np.concatenate([BOX.faces, [[0, 0, 0]]])
        assert is_closed(Surface(points=BOX.points, faces=faces))

    def test_no_triangles(self):
        assert not is_closed(Surface(points=BOX.points, faces=np.zeros((0, 3), int)))


class TestFlat:
    TURN = trimesh.transformations.rotation_matrix(1.0, [1, 2, 3])[:3, :3]

    @pytest.mark.parametrize(("height", "flat"), [(1e-3, False), (1e-5, True), (0.0, True)])
    @pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
    @pytest.mark.parametrize("count", [4, 5000])
    def test_sheet_in_any_orientation(self, height, flat, size, count):
        corners = trimesh.creation.box([1, 1, height]).vertices
        points = np.resize(corners, (2 * count, 3)) @ self.TURN * size + size
        assert is_flat(points) == flat

    def test_few_points(self):
        assert is_flat(np.zeros((100, 3)))
        assert is_flat(np.outer(np.arange(9.0), [1, 2, 3]))
        assert is_flat(np.eye(3))

    def test_thickness_of_box(self):
        assert thickness(BOX.points) == pytest.approx(1 / 14**0.5)


class TestClusterVertices:
    def test_sphere_keeps_its_shape(self):
        coarse = cluster_vertices(SPHERE, 8)
        assert len(coarse.faces) < len(SPHERE.faces)
        assert np.linalg.norm(coarse.points, axis=1).max() < 0.1001
        assert np.ptp(coarse.points, axis=0) == pytest.approx(0.2, rel=0.1)
        assert signed_volume(coarse) == pytest.approx(signed_volume(SPHERE), rel=0.15)

    def test_no_duplicate_or_degenerate_triangles(self):
        faces = cluster_vertices(SPHERE, 6).faces
        assert len(np.unique(np.sort(faces, axis=1), axis=0)) == len(faces)
        assert (faces != np.roll(faces, 1, axis=1)).all()

    def test_points_in_one_place(self):
        assert not len(
            cluster_vertices(Surface(points=np.ones((3, 3)), faces=BOX.faces[:0]), 4).faces
        )


class TestBinaryStl:
    def test_stl_is_read_by_trimesh(self, tmp_path):
        (tmp_path / "a.stl").write_bytes(binary_stl(BOX))
        mesh = trimesh.load(tmp_path / "a.stl")
        assert mesh.is_watertight
        assert mesh.volume == pytest.approx(6.0)
        assert np.allclose(mesh.triangles, BOX.points[BOX.faces])

    def test_normals_have_unit_length_or_zero(self):
        faces = np.concatenate([BOX.faces, [[0, 0, 0]]])
        data = binary_stl(Surface(points=BOX.points, faces=faces))
        assert len(data) == 84 + 50 * 13
        normals = np.frombuffer(data, np.dtype((np.void, 50)), offset=84)
        lengths = [np.linalg.norm(np.frombuffer(n.tobytes()[:12], "<f4")) for n in normals]
        assert lengths == pytest.approx([1.0] * 12 + [0.0])

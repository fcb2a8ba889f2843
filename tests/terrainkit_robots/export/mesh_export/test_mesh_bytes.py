from pathlib import Path

import numpy as np
import pytest
import trimesh

from terrainkit_robots.description.model import MeshFile, Source
from terrainkit_robots.export.mesh_export import mesh_bytes as module
from terrainkit_robots.export.mesh_export.mesh_bytes import has_no_volume, mesh_bytes, scaled
from terrainkit_robots.mesh.mesh_cache import MeshError, Meshes
from terrainkit_robots.mesh.surface import Surface, binary_stl, signed_volume, welded

# a wedge: no two of its axes are alike, so that a mirror or a turn shows
WEDGE = trimesh.convex.convex_hull(
    [(0, 0, 0), (3, 0, 0), (0, 2, 0), (0, 0, 1), (3, 0, 0.5), (1, 1, 1)]
)
SURFACE = Surface(points=np.asarray(WEDGE.vertices), faces=np.asarray(WEDGE.faces))
STL = binary_stl(SURFACE)


def use_of(name, scale=(1.0, 1.0, 1.0)):
    return MeshFile(
        source=Source(file=Path("robot.urdf"), line=1), filename=name, path=Path(name), scale=scale
    )


def content(data, name, scale=(1.0, 1.0, 1.0)):
    return mesh_bytes(Meshes({Path(name): data}), use_of(name, scale))


def read(packed):
    """Return the surface that a reader makes of it."""
    surface = Meshes({Path("a.stl"): packed.data}).surface(Path("a.stl"))
    return welded(Surface(points=surface.points * packed.scale, faces=surface.faces))


def msh():
    counts = np.array([len(SURFACE.points), 0, 0, len(SURFACE.faces)], "<i4")
    points, faces = SURFACE.points.astype("<f4"), SURFACE.faces.astype("<i4")
    return counts.tobytes() + points.tobytes() + faces.tobytes()


class TestFormats:
    def test_valid_binary_stl_is_unchanged(self):
        data = b"x" * 80 + STL[80:]
        packed = content(data, "a.STL", scale=(0.001, 0.002, 0.003))
        assert packed.data == data
        assert packed.scale == (0.001, 0.002, 0.003)
        assert not packed.change

    def test_stl_that_looks_like_text(self):
        packed = content(b"solid".ljust(80) + STL[80:], "a.stl")
        assert packed.data == STL

    @pytest.mark.parametrize("suffix", ["obj", "ply", "glb", "stl_ascii"])
    def test_formats_keep_shape_and_size(self, suffix):
        data = WEDGE.export(file_type=suffix)
        name = f"a.{suffix.removesuffix('_ascii')}"
        self.assert_same(content(data if isinstance(data, bytes) else data.encode(), name))

    def test_mujoco_mesh(self):
        self.assert_same(content(msh(), "a.msh"))

    def test_collada_with_unit_and_node(self):
        points = " ".join(f"{x * 1000:.9g}" for x in SURFACE.points.ravel())
        faces = " ".join(map(str, SURFACE.faces.ravel()))
        data = f"""<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema">
          <asset><unit meter="0.001"/><up_axis>Z_UP</up_axis></asset>
          <library_geometries><geometry id="g"><mesh>
            <source id="p"><float_array>{points}</float_array>
              <technique_common><accessor stride="3"/></technique_common></source>
            <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
            <triangles><input semantic="VERTEX" source="#v" offset="0"/><p>{faces}</p></triangles>
          </mesh></geometry></library_geometries>
          <library_visual_scenes><visual_scene id="s"><node>
            <translate>0 0 500</translate><instance_geometry url="#g"/>
          </node></visual_scene></library_visual_scenes>
          <scene><instance_visual_scene url="#s"/></scene></COLLADA>"""
        surface = read(content(data.encode(), "a.dae"))
        assert surface.points.min(axis=0) == pytest.approx([0, 0, 0.5])
        assert surface.points.max(axis=0) == pytest.approx([3, 2, 1.5])
        assert signed_volume(surface) == pytest.approx(WEDGE.volume, rel=1e-6)

    def assert_same(self, packed):
        surface = read(packed)
        assert packed.data[:6] == b"binary"
        assert surface.points.min(axis=0) == pytest.approx(WEDGE.bounds[0])
        assert surface.points.max(axis=0) == pytest.approx(WEDGE.bounds[1])
        assert signed_volume(surface) == pytest.approx(WEDGE.volume, rel=1e-6)

    def test_bytes_are_deterministic(self):
        data = WEDGE.export(file_type="obj").encode()
        assert content(data, "a.obj").data == content(data, "a.obj").data


class TestMirroredScale:
    @pytest.mark.parametrize("scale", [(1, -1, 1), (-0.5, 2, 1), (-1, -1, -2), (-1, -1, 1)])
    def test_mirrored_mesh_faces_outward(self, scale):
        packed = content(STL, "a.stl", scale)
        assert packed.scale == (1, 1, 1)
        surface = read(packed)
        corners = WEDGE.vertices * scale
        assert surface.points.min(axis=0) == pytest.approx(corners.min(axis=0))
        assert surface.points.max(axis=0) == pytest.approx(corners.max(axis=0))
        # positive: not inside out
        volume = WEDGE.volume * abs(np.prod(scale))
        assert signed_volume(surface) == pytest.approx(volume, rel=1e-6)

    def test_scaled_surface(self):
        mirrored = scaled(SURFACE, (1, -1, 1))
        assert signed_volume(mirrored) == pytest.approx(WEDGE.volume)
        assert scaled(SURFACE, (1, 2, 1)).faces is SURFACE.faces


class TestTooManyFaces:
    def test_mesh_is_decimated_with_note(self, monkeypatch):
        monkeypatch.setattr(module, "MAX_FACES", 1000)
        ball = trimesh.creation.icosphere(subdivisions=4, radius=0.1)
        data = binary_stl(Surface(points=ball.vertices, faces=ball.faces))
        packed = content(data, "a.stl", (1, 1, -1))
        surface = read(packed)
        assert len(surface.faces) <= 1000
        assert packed.change == f"was decimated from 5,120 to {len(surface.faces)} faces"
        assert signed_volume(surface) == pytest.approx(ball.volume, rel=0.05)


class TestWithoutVolume:
    @pytest.mark.parametrize(
        ("scale", "flat"),
        [((1, 1, 1), False), ((1, 1, 0), True), ((1, 1e-6, 1), True), ((1e-6, 1e-6, 1e-6), True)],
    )
    def test_scale_makes_mesh_flat(self, scale, flat):
        meshes = Meshes({Path("a.stl"): STL})
        assert has_no_volume(meshes, use_of("a.stl", scale)) is flat

    def test_flat_mesh_is_an_error(self):
        with pytest.raises(MeshError, match="is flat"):
            content(STL, "a.stl", (1, 1, 0))

    def test_missing_mesh_is_an_error(self):
        with pytest.raises(MeshError, match="does not exist"):
            mesh_bytes(Meshes(), use_of("nowhere.stl"))

from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh

from terrainkit_robots.description.load import load_robot
from terrainkit_robots.description.model import Geometry, Link, MeshFile, RobotModel, Source
from terrainkit_robots.description.xml.document import RobotFileError
from terrainkit_robots.export.mesh_export.mesh_export import export_meshes
from terrainkit_robots.mesh.mesh_cache import Meshes
from terrainkit_robots.mesh.surface import Surface, binary_stl, signed_volume, welded
from terrainkit_robots.quiet_mujoco import quiet_mujoco

SOURCE = Source(file=Path("robot.urdf"), line=1)


def stl_of(mesh):
    return binary_stl(Surface(points=np.asarray(mesh.vertices), faces=np.asarray(mesh.faces)))


BOX = stl_of(trimesh.creation.box([0.1, 0.2, 0.3]))
BALL = stl_of(trimesh.creation.icosphere(subdivisions=2, radius=0.1))


def mesh(name, scale=(1.0, 1.0, 1.0), **fields):
    file = MeshFile(source=SOURCE, filename=f"package://r/{name}", path=Path(name), scale=scale)
    return Geometry(source=SOURCE, shape="mesh", mesh=file, **fields)


def shape(kind, *size, **fields):
    return Geometry(source=SOURCE, shape=kind, size=size, **fields)


def robot(*, visuals=(), collisions=()):
    link = Link(name="leg", source=SOURCE, visuals=tuple(visuals), collisions=tuple(collisions))
    return RobotModel(name="r", kind="urdf", file=Path("robot.urdf"), source=SOURCE, links=(link,))


def packed(*, visuals=(), collisions=(), **contents):
    held = {Path(name.replace("__", ".")): data for name, data in contents.items()}
    return export_meshes(robot(visuals=visuals, collisions=collisions), Meshes(held))


class TestNames:
    def test_names_are_relative(self):
        done = packed(visuals=[mesh("a.stl", (2, 2, 2))], a__stl=BOX)
        (visual,) = done.model.links[0].visuals
        assert done.files == {"meshes/a.stl": BOX}
        assert visual.mesh.filename == "meshes/a.stl"
        assert visual.mesh.path == Path("meshes/a.stl")
        assert visual.mesh.scale == (2, 2, 2)
        assert not done.changes

    def test_equal_content_is_stored_once(self):
        shapes = [mesh("a.stl"), mesh("b/c.stl"), mesh("a.stl", (1, 1, 2))]
        held = {Path("a.stl"): BOX, Path("b/c.stl"): BOX}
        done = export_meshes(robot(visuals=shapes, collisions=shapes), Meshes(held), folder="m")
        assert list(done.files) == ["m/a.stl"]
        assert {each.mesh.filename for each in done.model.links[0].visuals} == {"m/a.stl"}

    def test_different_files_with_same_name(self):
        held = {Path("a/hip.stl"): BOX, Path("b/hip.stl"): BALL}
        done = export_meshes(robot(visuals=[mesh("a/hip.stl"), mesh("b/hip.stl")]), Meshes(held))
        assert done.files == {"meshes/hip.stl": BOX, "meshes/hip_2.stl": BALL}

    def test_mirrored_mesh_is_separate_file(self):
        done = packed(visuals=[mesh("a.stl"), mesh("a.stl", (1, -1, 1))], a__stl=BALL)
        assert list(done.files) == ["meshes/a.stl", "meshes/a_2.stl"]
        assert [v.mesh.scale for v in done.model.links[0].visuals] == [(1, 1, 1), (1, 1, 1)]


class TestRemoved:
    def test_missing_visual_mesh(self):
        done = packed(visuals=[mesh("a.stl"), shape("sphere", 0.1)])
        assert done.changes == ("removed the visual mesh a.stl of leg: it does not exist",)
        assert [each.shape for each in done.model.links[0].visuals] == ["sphere"]

    def test_flat_visual_mesh(self):
        done = packed(visuals=[mesh("a.stl", (1, 0, 1))] * 2, a__stl=BOX)
        assert done.changes == ("removed the visual mesh a.stl of leg: it is flat",)
        assert not done.model.links[0].visuals
        assert not done.files

    @pytest.mark.parametrize(
        ("given", "change"),
        [
            (shape("plane"), "removed a plane of leg: it has no valid size"),
            (
                shape("unknown"),
                "removed a geometry of unknown shape of leg: it has no valid size",
            ),
            (shape("box", 1, 0, 1), "removed a box of leg: its size is 1 0 1"),
            (
                shape("sphere", -1),
                "removed a sphere of leg: it has no valid size",
            ),
            (
                shape("cylinder", float("nan"), 1),
                "removed a cylinder of leg: it has no valid size",
            ),
        ],
    )
    def test_geometry_without_size(self, given, change):
        done = packed(collisions=[given, shape("sphere", 0.1)])
        assert done.changes == (change,)
        assert [each.shape for each in done.model.links[0].collisions] == ["sphere"]


class TestCollisionMeshes:
    @pytest.mark.parametrize(
        ("data", "reason"),
        [(None, "does not exist"), (b"", "is empty"), (BOX[:-1], "header declares")],
    )
    def test_unreadable_mesh_is_one_line_error(self, data, reason):
        contents = {} if data is None else {"a__stl": data}
        with pytest.raises(RobotFileError, match=reason) as error:
            packed(collisions=[mesh("a.stl")], **contents)
        assert "package://r/a.stl of leg" in str(error.value)
        assert "\n" not in str(error.value)

    def test_flat_mesh_becomes_box(self):
        origin = np.eye(4)
        origin[:3, 3] = [1, 2, 3]
        done = packed(collisions=[mesh("a.stl", (1, 1, 0), origin=origin)], a__stl=BOX)
        (box,) = done.model.links[0].collisions
        assert box.shape == "box"
        assert sorted(box.size) == pytest.approx([0.0005, 0.05, 0.1])
        assert box.origin[:3, 3] == pytest.approx([1, 2, 3])
        assert box.mesh is None
        assert "by a box of 1 mm thickness" in done.changes[0]

    def test_mesh_without_surface_is_removed(self):
        done = packed(collisions=[mesh("a.stl", (1, 0, 0))], a__stl=BOX)
        assert not done.model.links[0].collisions
        assert "it has no surface" in done.changes[0]

    def test_fitted_mesh_is_exported(self):
        done = packed(collisions=[mesh("a.stl", fit_to_mesh=True)], a__stl=BOX)
        assert not done.model.links[0].collisions[0].fit_to_mesh
        assert "instead of MuJoCo's fitted primitive" in done.changes[0]


class TestPrimitives:
    def test_primitives_are_unchanged(self):
        shapes = [shape("box", 1, 2, 3), shape("cylinder", 1, 2), shape("capsule", 1, 2)]
        done = packed(visuals=shapes)
        assert [(s.shape, s.size) for s in done.model.links[0].visuals] == [
            (s.shape, s.size) for s in shapes
        ]

    def test_capsule_without_length_is_sphere(self):
        (done,) = packed(visuals=[shape("capsule", 0.1, 0)]).model.links[0].visuals
        assert (done.shape, done.size) == ("sphere", (0.1,))

    def test_ellipsoid_has_mesh(self):
        done = packed(collisions=[shape("ellipsoid", 0.1, 0.2, 0.3)])
        (ellipsoid,) = done.model.links[0].collisions
        assert (ellipsoid.shape, ellipsoid.size) == ("ellipsoid", (0.1, 0.2, 0.3))
        assert ellipsoid.mesh.filename == "meshes/leg_ellipsoid.stl"
        held = Meshes({Path(name): data for name, data in done.files.items()})
        surface = welded(held.surface(ellipsoid.mesh.path))
        assert np.abs(surface.points).max(axis=0) == pytest.approx([0.1, 0.2, 0.3], rel=1e-3)
        volume = 4 / 3 * np.pi * 0.1 * 0.2 * 0.3
        assert signed_volume(surface) == pytest.approx(volume, rel=0.015)


@pytest.fixture(scope="module", params=["go2/urdf/go2.urdf", "h1/urdf/h1.urdf"])
def source(robot_file, request):
    return load_robot(robot_file(request.param))


@pytest.fixture(scope="module")
def done(source):
    return export_meshes(source, Meshes())


def corners(meshes, mesh):
    """Return the corners of triangles, of which there may be fewer than of points."""
    return meshes.vertices(mesh)[meshes.surface(mesh.path).faces].reshape(-1, 3)


class TestRobots:
    def test_mujoco_loads_every_file(self, done):
        spec = mujoco.MjSpec()
        for k, file in enumerate(done.files):
            spec.add_mesh(name=f"m{k}", file=file)
            spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"m{k}")
        spec.assets = dict(done.files)
        with quiet_mujoco():
            model = spec.compile()
        assert model.nmesh == len(done.files) > 0

    def test_bounding_boxes_are_unchanged(self, source, done):
        before = Meshes()
        after = Meshes({Path(file): data for file, data in done.files.items()})
        pairs = {
            first.mesh.path: (corners(before, first.mesh), corners(after, second.mesh))
            for old, new in zip(source.links, done.model.links, strict=True)
            for first, second in zip(old.visuals, new.visuals, strict=True)
            if first.mesh is not None
        }
        assert len(pairs) > 5
        for a, b in pairs.values():
            assert b.min(axis=0) == pytest.approx(a.min(axis=0), abs=1e-6)
            assert b.max(axis=0) == pytest.approx(a.max(axis=0), abs=1e-6)

    def test_files_are_deterministic_and_unique(self, source, done):
        again = export_meshes(source, Meshes())
        assert dict(again.files) == dict(done.files)
        assert list(again.files) == list(done.files)
        assert len(set(done.files.values())) == len(done.files)


def test_links_without_geometry():
    (link,) = export_meshes(robot(), Meshes()).model.links
    assert link.name == "leg"

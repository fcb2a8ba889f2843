import re
from pathlib import Path

import numpy as np
import pytest
import trimesh

from terrainkit_robots.analysis.bodies.shapes import volume
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.description.model import Geometry, Link, MeshFile, RobotModel, Source
from terrainkit_robots.export.collision_simplification import simplify as module
from terrainkit_robots.export.collision_simplification.simplify import simplify_collisions
from terrainkit_robots.export.mesh_export.mesh_export import export_meshes
from terrainkit_robots.mesh.mesh_cache import Meshes
from terrainkit_robots.mesh.surface import MeshError, Surface, binary_stl

SOURCE = Source(file=Path("robot.urdf"), line=1)


def stl_of(mesh):
    return binary_stl(Surface(points=np.asarray(mesh.vertices), faces=np.asarray(mesh.faces)))


def extruded(*corners):
    return trimesh.creation.extrude_polygon(trimesh.path.polygons.Polygon(corners), 1.0)


BOX = trimesh.creation.box([0.1, 0.2, 0.3])
# 1.28 times and 2.4 times as large with their hulls
ANGLE = extruded((0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (0, 2))
THIN = extruded((0, 0), (3, 0), (3, 0.4), (0.4, 0.4), (0.4, 3), (0, 3))
FILES = {
    Path("box.stl"): stl_of(BOX),
    Path("angle.stl"): stl_of(ANGLE),
    Path("thin.stl"): stl_of(THIN),
    Path("open.stl"): stl_of(trimesh.Trimesh(BOX.vertices, BOX.faces[1:], process=False)),
}


def mesh(file_name, scale=(1.0, 1.0, 1.0), **fields):
    file = MeshFile(source=SOURCE, filename=file_name, path=Path(file_name), scale=scale)
    return Geometry(source=SOURCE, shape="mesh", mesh=file, **fields)


def robot(*collisions, visuals=()):
    link = Link(name="leg", source=SOURCE, collisions=collisions, visuals=visuals)
    return RobotModel(name="r", kind="urdf", file=Path("robot.urdf"), source=SOURCE, links=(link,))


def treated(how, *collisions, **options):
    return simplify_collisions(robot(*collisions), Meshes(FILES), how, **options)


def shapes(done):
    return done.model.links[0].collisions


def volumes(done):
    return [volume(shape, done.meshes) for shape in shapes(done)]


def percent(change):
    return float(re.search(r"\(volume (\S+) %\)", change)[1])


def test_keep():
    model, meshes = robot(mesh("thin.stl")), Meshes(FILES)
    done = simplify_collisions(model, meshes)
    assert done.model is model
    assert done.meshes is meshes
    assert not done.contents
    assert not done.changes


class TestHull:
    def test_hull_replaces_mesh(self):
        pose = np.eye(4)
        pose[:3, 3] = [1, 2, 3]
        done = treated("hull", mesh("angle.stl", origin=pose, contype=2, name="shin"))
        (shape,) = shapes(done)
        assert (shape.shape, shape.contype, shape.name) == ("mesh", 2, "shin")
        np.testing.assert_array_equal(shape.origin, pose)
        assert shape.mesh.path in done.contents
        assert not shape.mesh.path.exists()
        assert volumes(done) == pytest.approx([ANGLE.convex_hull.volume])

    def test_volume_error(self):
        done = treated("hull", mesh("angle.stl", (1, 2, 1)))
        assert volumes(done) == pytest.approx([2 * ANGLE.convex_hull.volume])
        percent = 100 * (2 * ANGLE.convex_hull.volume / 8 - 1)
        assert done.changes == (
            f"replaced collision mesh angle.stl by its convex hull (volume {percent:+.1f} %)",
        )

    def test_open_mesh(self):
        done = treated("hull", mesh("open.stl"))
        assert done.changes == (
            "replaced collision mesh open.stl by its convex hull (volume unknown)",
        )
        assert volumes(done) == pytest.approx([0.006])

    def test_scale_is_applied_to_vertices(self):
        done = treated("hull", mesh("angle.stl", (1, -2, 1)), mesh("angle.stl", (2, 2, 2)))
        mirrored, large = shapes(done)
        assert mirrored.mesh.scale == large.mesh.scale == (1, 1, 1)
        corners = done.meshes.vertices(mirrored.mesh)
        assert corners.min(axis=0) == pytest.approx([0, -4, 0])
        assert corners.max(axis=0) == pytest.approx([3, 0, 1])

    def test_number_of_vertices(self):
        ball = trimesh.creation.icosphere(subdivisions=4, radius=0.1)
        done = simplify_collisions(
            robot(mesh("a.stl")), Meshes({Path("a.stl"): stl_of(ball)}), "hull"
        )
        (shape,) = shapes(done)
        hull = done.meshes.welded(shape.mesh.path)
        assert 300 < len(hull.points) <= 500
        assert volumes(done) == pytest.approx([ball.volume], rel=0.02)

    def test_unused_vertices_are_ignored(self):
        data = BOX.export(file_type="obj").encode() + b"\nv 9 9 9\n"
        done = simplify_collisions(robot(mesh("a.obj")), Meshes({Path("a.obj"): data}), "hull")
        assert volumes(done) == pytest.approx([0.006])


class TestCoacd:
    def test_nonconvex_mesh_is_decomposed(self, tmp_path):
        done = treated("coacd", mesh("thin.stl", name="shin"), mesh("angle.stl"), cache=tmp_path)
        thin, angle = done.changes
        assert "thin.stl by 2 convex parts (" in thin
        assert percent(thin) == pytest.approx(0, abs=2)
        assert "angle.stl by its convex hull (" in angle
        assert [shape.name for shape in shapes(done)] == ["shin", "shin_2", ""]
        assert sum(volumes(done)[:2]) == pytest.approx(THIN.volume, rel=0.02)
        assert len(list(tmp_path.iterdir())) == 1

    def test_mirrored_parts(self, tmp_path):
        left = treated("coacd", mesh("thin.stl"), cache=tmp_path)
        right = treated("coacd", mesh("thin.stl", (1, -1, 1)), cache=tmp_path)
        assert len(list(tmp_path.iterdir())) == 1
        for a, b in zip(shapes(left), shapes(right), strict=True):
            ours, theirs = left.meshes.vertices(a.mesh), right.meshes.vertices(b.mesh)
            both = [each[np.lexsort(each.T)] for each in (ours * [1, -1, 1], theirs)]
            np.testing.assert_allclose(*both, atol=1e-6)
        assert sum(volumes(right)) == pytest.approx(THIN.volume, rel=0.02)

    def test_hull_if_coacd_fails(self, monkeypatch):
        def fail(*_):
            raise MeshError("makes CoACD fail: no reason")

        monkeypatch.setattr(module, "convex_parts", fail)
        done = treated("coacd", mesh("thin.stl"))
        failed, replaced = done.changes
        expected = "collision mesh thin.stl makes CoACD fail: no reason; its convex hull is used"
        assert failed == expected
        assert "thin.stl by its convex hull (" in replaced


class TestPrimitives:
    def test_box_at_pose_of_mesh(self):
        pose = np.eye(4)
        pose[:3, 3] = [1, 2, 3]
        done = treated("primitives", mesh("box.stl", (1, -2, 1), origin=pose))
        (shape,) = shapes(done)
        assert shape.shape == "box"
        assert sorted(shape.size) == pytest.approx([0.05, 0.15, 0.2])
        assert shape.origin[:3, 3] == pytest.approx([1, 2, 3])
        assert shape.mesh is None
        assert not done.contents
        assert volumes(done) == pytest.approx([0.012])
        (change,) = done.changes
        assert change.startswith("replaced collision mesh box.stl by a box (volume ")
        assert percent(change) == 0

    def test_fit_to_mesh_is_cleared(self):
        assert (
            shapes(treated("primitives", mesh("box.stl", fit_to_mesh=True)))[0].fit_to_mesh is False
        )


class TestUnchanged:
    @pytest.mark.parametrize("how", ["hull", "coacd", "primitives"])
    def test_primitives_and_flat_meshes(self, how):
        given = (
            Geometry(source=SOURCE, shape="sphere", size=(0.1,)),
            mesh("nowhere.stl"),
            mesh("box.stl", (1, 1, 0)),
        )
        done = treated(how, *given)
        assert shapes(done) == given
        assert not done.changes

    def test_visual_meshes(self):
        visual = mesh("thin.stl")
        done = simplify_collisions(
            robot(mesh("thin.stl"), visuals=(visual,)), Meshes(FILES), "hull"
        )
        assert done.model.links[0].visuals == (visual,)
        assert done.meshes.is_readable(visual.mesh)


def test_progress():
    seen = []

    def progress(items, total):
        for item in items:
            seen.append((item.filename, total))
            yield item

    uses = mesh("box.stl"), mesh("box.stl"), mesh("box.stl", (2, 2, 2)), mesh("angle.stl")
    done = treated("hull", *uses, progress=progress)
    assert seen == [("box.stl", 3), ("box.stl", 3), ("angle.stl", 3)]
    assert shapes(done)[0].mesh.path == shapes(done)[1].mesh.path


@pytest.mark.parametrize("how", ["hull", "coacd", "primitives"])
def test_result_is_deterministic(how):
    first, second = (treated(how, mesh("thin.stl"), mesh("angle.stl")) for _ in range(2))
    assert dict(first.contents) == dict(second.contents)
    assert first.changes == second.changes
    assert [shape.size for shape in shapes(first)] == [shape.size for shape in shapes(second)]


def test_robot_with_meshes(robot_file):
    model = load_robot(robot_file("h1/urdf/h1.urdf"))
    done = simplify_collisions(model, Meshes(), "hull")
    assert len(done.changes) == 18
    # never smaller than the mesh, but for corners that a hull may not have
    assert all(-1 < percent(change) < 200 for change in done.changes)
    packed = export_meshes(done.model, done.meshes)
    names = {s.mesh.filename for link in packed.model.links for s in link.collisions if s.mesh}
    assert names <= set(packed.files)
    assert len(names) == 18

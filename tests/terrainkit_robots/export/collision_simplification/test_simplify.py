from pathlib import Path

import numpy as np
import pytest
import trimesh

from terrainkit_robots.analysis.bodies.shapes import volume
from terrainkit_robots.export.collision_simplification import simplify as module
from terrainkit_robots.export.collision_simplification.simplify import simplify_collisions
from terrainkit_robots.mesh.mesh_cache import Meshes
from terrainkit_robots.mesh.surface import MeshError
from tests.terrainkit_robots.export.made_models import at, link, mesh, model, shape, stl_of


def extruded(*corners):
    return trimesh.creation.extrude_polygon(trimesh.path.polygons.Polygon(corners), 1.0)


BOX = trimesh.creation.box([0.1, 0.2, 0.3])
# Their hulls are 1.25 times, 1.98 times and 2.03 times as large.
ANGLE = extruded((0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (0, 2))
WIDE, THIN = (extruded((0, 0), (3, 0), (3, w), (w, w), (w, 3), (0, 3)) for w in (0.56, 0.54))
BALL = trimesh.creation.icosphere(subdivisions=4, radius=0.1)
FILES = {
    Path("box.stl"): stl_of(BOX),
    Path("angle.stl"): stl_of(ANGLE),
    Path("wide.stl"): stl_of(WIDE),
    Path("thin.stl"): stl_of(THIN),
    Path("ball.stl"): stl_of(BALL),
    Path("open.stl"): stl_of(trimesh.Trimesh(BOX.vertices, BOX.faces[1:], process=False)),
    Path("box.obj"): BOX.export(file_type="obj").encode() + b"\nv 9 9 9\n",  # which no face uses
}


def simplified(how, *collisions, visuals=(), **options):
    robot = model(link("leg", collisions=collisions, visuals=visuals))
    return simplify_collisions(robot, Meshes(FILES), how, **options)


def shapes(done):
    return done.model.links[0].collisions


def volumes(done):
    return [volume(shape, done.meshes) for shape in shapes(done)]


def test_keep():
    robot, meshes = model(link("leg", collisions=(mesh("thin.stl"),))), Meshes(FILES)
    done = simplify_collisions(robot, meshes)
    assert (done.model, done.meshes, done.contents, done.changes) == (robot, meshes, {}, ())


def test_hull_replaces_mesh():
    visual = mesh("thin.stl")
    given = mesh("angle.stl", origin=at(1, 2, 3), contype=2, name="shin", fit_to_mesh=True)
    done = simplified("hull", given, visuals=(visual,))
    (hull,) = shapes(done)
    assert (hull.shape, hull.contype, hull.name, hull.fit_to_mesh) == ("mesh", 2, "shin", False)
    assert hull.origin.tolist() == at(1, 2, 3).tolist()
    assert list(done.contents) == [hull.mesh.path] == [Path(".terrainkit-hull/angle_hull.stl")]
    assert not hull.mesh.path.exists()
    assert volumes(done) == pytest.approx([5])
    assert done.model.links[0].visuals == (visual,)
    assert done.meshes.is_readable(visual.mesh)


@pytest.mark.parametrize(
    ("file", "scale", "hull", "change"),
    [
        ("angle.stl", (1, 2, 1), 10, "+25.0 %"),
        ("open.stl", (1, 1, 1), 0.006, "unknown"),
        ("box.obj", (1, 1, 1), 0.006, "+0.0 %"),
    ],
)
def test_change_of_volume_is_told(file, scale, hull, change):
    done = simplified("hull", mesh(file, scale))
    assert volumes(done) == pytest.approx([hull])
    assert done.changes == (
        f"replaced collision mesh package://r/{file} by its convex hull (volume {change})",
    )


def test_scale_is_applied_to_vertices():
    done = simplified("hull", mesh("angle.stl", (1, -2, 1)), mesh("angle.stl", (2, 2, 2)))
    mirrored, large = shapes(done)
    assert mirrored.mesh.scale == large.mesh.scale == (1, 1, 1)
    points = done.meshes.vertices(mirrored.mesh)
    assert np.r_[points.min(axis=0), points.max(axis=0)] == pytest.approx([0, -4, 0, 3, 0, 1])


def test_number_of_vertices_is_bounded():
    done = simplified("hull", mesh("ball.stl"))
    (hull,) = shapes(done)
    assert 300 < len(done.meshes.welded(hull.mesh.path).points) <= 500
    assert volumes(done) == pytest.approx([BALL.volume], rel=0.02)


def test_huge_meshes_are_decimated(monkeypatch):
    monkeypatch.setattr(module, "MAX_WELDED_FACES", 1000)
    done = simplified("hull", mesh("ball.stl"))
    assert volumes(done) == pytest.approx([BALL.volume], rel=0.05)
    assert volumes(done) != pytest.approx([BALL.volume], rel=1e-3)


def test_nonconvex_mesh_is_decomposed(tmp_path):
    given = mesh("thin.stl", (2, 1, 1), name="shin"), mesh("wide.stl", (2, 1, 1)), mesh("angle.stl")
    done = simplified("coacd", *given, cache=tmp_path)
    first, *others = done.changes
    assert first.startswith("replaced collision mesh package://r/thin.stl by 2 convex parts (vol")
    assert all("by its convex hull (" in other for other in others)
    assert len(shapes(done)) == 4
    assert [each.mesh.path.stem for each in shapes(done)[:2]] == ["thin_part_1", "thin_part_2"]
    assert sum(volumes(done)[:2]) == pytest.approx(2 * THIN.volume, rel=0.02)
    assert len(list(tmp_path.iterdir())) == 1


def test_mirrored_parts(tmp_path):
    left, right = (
        simplified("coacd", mesh("thin.stl", (1, side, 1)), cache=tmp_path) for side in (1, -1)
    )
    assert len(list(tmp_path.iterdir())) == 1
    for a, b in zip(shapes(left), shapes(right), strict=True):
        ours, theirs = left.meshes.vertices(a.mesh) * [1, -1, 1], right.meshes.vertices(b.mesh)
        both = [each[np.lexsort(np.round(each, 4).T)] for each in (ours, theirs)]
        np.testing.assert_allclose(*both, atol=1e-6)
    assert sum(volumes(right)) == pytest.approx(THIN.volume, rel=0.02)


def test_hull_if_coacd_fails(monkeypatch):
    def fail(*_):
        raise MeshError("makes CoACD fail: no reason")

    monkeypatch.setattr(module, "convex_parts", fail)
    failed, replaced = simplified("coacd", mesh("thin.stl")).changes
    assert failed == (
        "collision mesh package://r/thin.stl makes CoACD fail: no reason; its convex hull is used"
    )
    assert "thin.stl by its convex hull (" in replaced


def test_box_at_pose_of_mesh():
    done = simplified("primitives", mesh("box.stl", (1, -2, 1), origin=at(1, 2, 3)))
    (box,) = shapes(done)
    assert (box.shape, box.mesh, done.contents) == ("box", None, {})
    assert sorted(box.size) == pytest.approx([0.05, 0.15, 0.2])
    assert box.origin[:3, 3] == pytest.approx([1, 2, 3])
    (change,) = done.changes
    assert change.endswith("box.stl by a box (volume +0.0 %)")


@pytest.mark.parametrize("how", ["hull", "coacd", "primitives"])
def test_primitives_and_meshes_without_volume_are_unchanged(how):
    given = (shape("sphere", 0.1), mesh("nowhere.stl"), mesh("box.stl", (1, 1, 0)))
    done = simplified(how, *given)
    assert (shapes(done), done.changes) == (given, ())


def test_each_mesh_is_simplified_once():
    seen = []

    def progress(items, total):
        for item in items:
            seen.append((item.filename[-7:], total))
            yield item

    uses = mesh("box.stl"), mesh("box.stl"), mesh("box.stl", (2, 2, 2)), mesh("angle.stl")
    done = simplified("hull", *uses, progress=progress)
    assert seen == [("box.stl", 3), ("box.stl", 3), ("gle.stl", 3)]
    assert shapes(done)[0].mesh.path == shapes(done)[1].mesh.path
    again = simplified("hull", *uses)
    assert (dict(again.contents), again.changes) == (dict(done.contents), done.changes)

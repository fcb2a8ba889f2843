from pathlib import Path

import numpy as np
import pytest
import trimesh

from terrainkit_robots.description.xml.document import RobotFileError
from terrainkit_robots.export.mesh_export import mesh_bytes
from terrainkit_robots.export.mesh_export.mesh_export import export_meshes
from terrainkit_robots.mesh.mesh_cache import Meshes
from terrainkit_robots.mesh.surface import signed_volume, welded
from tests.terrainkit_robots.export.made_models import at, link, mesh, model, shape, stl_of

BOX = stl_of(trimesh.creation.box([0.1, 0.2, 0.3]))
BALL = stl_of(trimesh.creation.icosphere(subdivisions=2, radius=0.1))
FILES = {"box.stl": BOX, "sub/box.stl": BALL, "copy.stl": BOX}
FILES |= {"empty.stl": b"", "cut.stl": BOX[:-1]}


def packed(*, visuals=(), collisions=(), **options):
    robot = model(link("leg", visuals=visuals, collisions=collisions))
    return export_meshes(robot, Meshes({Path(k): data for k, data in FILES.items()}), **options)


def visuals(done):
    return done.model.links[0].visuals


def collisions(done):
    return done.model.links[0].collisions


def test_names_are_relative():
    done = packed(visuals=[mesh("box.stl", (2, 2, 2))])
    (visual,) = visuals(done)
    assert (done.files, done.changes) == ({"meshes/box.stl": BOX}, ())
    assert (visual.mesh.filename, visual.mesh.path) == ("meshes/box.stl", Path("meshes/box.stl"))
    assert (visual.mesh.scale, visual.mesh.found_by) == ((2, 2, 2), "path")


def test_equal_content_is_stored_once():
    shapes = [mesh("box.stl"), mesh("copy.stl"), mesh("sub/box.stl"), mesh("box.stl", (1, 1, 2))]
    done = packed(visuals=shapes, collisions=shapes, folder="m")
    assert done.files == {"m/box.stl": BOX, "m/box_2.stl": BALL}
    names = ["m/box.stl", "m/box.stl", "m/box_2.stl", "m/box.stl"]
    for of in (visuals, collisions):
        assert [each.mesh.filename for each in of(done)] == names


def test_mirrored_mesh_is_separate_file():
    done = packed(visuals=[mesh("sub/box.stl"), mesh("sub/box.stl", (1, -1, 1))])
    assert list(done.files) == ["meshes/box.stl", "meshes/box_2.stl"]
    assert [visual.mesh.scale for visual in visuals(done)] == [(1, 1, 1), (1, 1, 1)]


@pytest.mark.parametrize(
    ("given", "change"),
    [
        (mesh("a/no.stl"), "the visual mesh no.stl of leg: it does not exist"),
        (mesh("box.stl", (1, 0, 1)), "the visual mesh box.stl of leg: it is flat"),
        (shape("plane"), "a plane of leg: it has no valid size"),
        (shape("unknown"), "a geometry of unknown shape of leg: it has no valid size"),
        (shape("box", 1, 0, 1), "a box of leg: its size is 1 0 1"),
        (shape("sphere", -1), "a sphere of leg: it has no valid size"),
        (shape("cylinder", float("nan"), 1), "a cylinder of leg: it has no valid size"),
        (shape("cylinder", 1, 0), "a cylinder of leg: its size is 1 0"),
    ],
)
def test_invalid_visuals_are_removed_and_told_once(given, change):
    done = packed(visuals=[given, given, shape("sphere", 0.1)])
    assert done.changes == (f"removed {change}",)
    assert [each.shape for each in visuals(done)] == ["sphere"]
    assert done.files == {}


@pytest.mark.parametrize(
    ("name", "reason"),
    [("no.stl", "does not exist"), ("empty.stl", "is empty"), ("cut.stl", "header declares")],
)
def test_unreadable_collision_mesh_is_one_line_error(name, reason):
    with pytest.raises(RobotFileError, match=f"mesh package://r/{name} of leg .*{reason}") as error:
        packed(collisions=[mesh(name)])
    assert "\n" not in str(error.value)


def test_flat_collision_mesh_becomes_box():
    """Of a line, nothing remains; a strip is wide enough from half a millimeter on."""
    done = packed(collisions=[mesh("box.stl", (1, 1, 0), origin=at(1, 2, 3), fit_to_mesh=True)])
    (box,) = collisions(done)
    assert (box.shape, box.mesh, box.fit_to_mesh) == ("box", None, False)
    assert sorted(box.size) == pytest.approx([0.0005, 0.05, 0.1])
    assert box.origin[:3, 3] == pytest.approx([1, 2, 3])
    told = "replaced the flat collision mesh box.stl of leg by a box of 1 mm thickness"
    assert done.changes == (told,)
    for width, change in ((0.011, told), (0.009, None), (0.0, None)):
        done = packed(collisions=[mesh("box.stl", (1, width / 2, 0))])
        removed = "removed the collision mesh box.stl of leg: it has no surface"
        assert done.changes == (change or removed,)
        assert len(collisions(done)) == (change is not None)


def test_fitted_mesh_is_exported():
    done = packed(collisions=[mesh("box.stl", fit_to_mesh=True)])
    assert not collisions(done)[0].fit_to_mesh
    assert done.changes == ("leg collides with mesh box.stl instead of MuJoCo's fitted primitive",)


def test_large_mesh_is_decimated(monkeypatch):
    monkeypatch.setattr(mesh_bytes, "MAX_FACES", 100)
    (change,) = packed(visuals=[mesh("sub/box.stl")] * 2).changes
    assert change.startswith("mesh box.stl was decimated from 320 to ")


def test_primitives():
    given = [shape("box", 1, 2, 3, mesh=mesh("box.stl").mesh), shape("capsule", 1, 2)]
    done = packed(visuals=[*given, shape("capsule", 0.1, 0)])
    assert [(each.shape, each.size, each.mesh) for each in visuals(done)] == [
        ("box", (1, 2, 3), None),
        ("capsule", (1, 2), None),
        ("sphere", (0.1,), None),
    ]


def test_ellipsoid_has_mesh():
    done = packed(collisions=[shape("ellipsoid", 0.1, 0.2, 0.3)])
    (ellipsoid,) = collisions(done)
    assert (ellipsoid.shape, ellipsoid.size) == ("ellipsoid", (0.1, 0.2, 0.3))
    assert list(done.files) == [ellipsoid.mesh.filename] == ["meshes/leg_ellipsoid.stl"]
    held = Meshes({Path(name): data for name, data in done.files.items()})
    surface = welded(held.surface(ellipsoid.mesh.path))
    assert np.abs(surface.points).max(axis=0) == pytest.approx([0.1, 0.2, 0.3], rel=1e-3)
    volume = 4 / 3 * np.pi * 0.1 * 0.2 * 0.3
    assert signed_volume(surface) == pytest.approx(volume, rel=0.015)

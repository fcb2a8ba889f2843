from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh

from terrainkit_robots.description.load import load_robot
from terrainkit_robots.transforms import quat_to_matrix
from tests.terrainkit_robots.description.made_robots import body, link, read


def write_box(file):
    """Write a box that is nowhere symmetrical; return its corners."""
    box = trimesh.creation.box(bounds=[(0.1, 0.2, -0.3), (0.5, 0.9, 0.7)])
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(box.export(file_type="stl"))
    return np.asarray(box.vertices)


def collision(robot):
    (shape,) = link(robot).collisions
    return shape


def in_order(points):
    return points[np.lexsort(np.round(points, 4).T)]


@pytest.mark.parametrize(
    "asset",
    [
        "",
        'scale="1 2 -3"',
        'scale="2 2 2" refpos="0.1 0.2 0.3" refquat="1 2 3 4"',
        'refpos="0.1 0.2 0.3" scale="1 2 3"',
    ],
)
def test_mesh_pose_matches_mujoco(asset, tmp_path):
    file = tmp_path / "robot.xml"
    corners = write_box(tmp_path / "parts" / "box.stl")
    file.write_text(
        body(
            '<joint/><frame pos="0 1 0" euler="0 0 30">'
            '<geom type="mesh" mesh="box" pos="0.3 0.2 0.1" quat="1 1 0 0.5"/></frame>',
            f'<compiler meshdir="parts"/><asset><mesh file="box.stl" {asset}/></asset>',
        )
    )
    shape = collision(load_robot(file))
    mesh = shape.mesh
    assert (shape.shape, mesh.path) == ("mesh", tmp_path / "parts" / "box.stl")
    assert (mesh.attribute, mesh.filename, mesh.found_by) == ("file", "box.stl", "path")
    ours = corners * mesh.scale @ shape.origin[:3, :3].T + shape.origin[:3, 3]
    model = mujoco.MjModel.from_xml_path(str(file))
    theirs = model.mesh_vert @ quat_to_matrix(model.geom_quat[0]).T + model.geom_pos[0]
    np.testing.assert_allclose(in_order(ours), in_order(theirs), atol=1e-6)  # float32


def test_turned_mesh_with_unequal_scales_is_no_scaled_mesh():
    asset = '<asset><mesh name="m" file="m.stl" scale="1 2 1" refquat="1 {} 0 0"/></asset>'
    for angle, kind in (("1e-12", "mesh"), ("1", "unknown")):
        shape = collision(read(body('<geom type="mesh" mesh="m"/>', asset.format(angle))))
        assert (shape.shape, shape.mesh.scale) == (kind, (1, 2, 1))


@pytest.mark.parametrize(
    ("compiler", "name", "path"),
    [
        ("", "box.stl", "box.stl"),
        ('meshdir="m"', "sub/box.stl", "m/sub/box.stl"),
        ('assetdir="m/"', "box.stl", "m/box.stl"),
        ('strippath="true" meshdir="m"', "somewhere/else/box.stl", "m/box.stl"),
    ],
)
def test_mesh_paths_follow_compiler_settings(compiler, name, path, tmp_path):
    file = tmp_path / "robot.xml"
    assets = f'<compiler {compiler}/><asset><mesh file="{name}" name="box"/></asset>'
    file.write_text(body('<geom type="mesh" mesh="box"/>', assets))
    write_box(tmp_path / path)
    assert collision(load_robot(file)).mesh.path == tmp_path / path
    mujoco.MjModel.from_xml_path(str(file))  # MuJoCo finds it there


def test_absolute_mesh_path_is_unchanged():
    assets = '<compiler meshdir="m"/><asset><mesh file="/robots/b.stl"/></asset>'
    shape = collision(read(body('<geom type="mesh" mesh="b"/>', assets)))
    assert shape.mesh.path == Path("/robots/b.stl")


def test_meshes_that_are_not_drawn_as_they_are():
    """One is in the file, to one a box is fitted, and one belongs to a sphere by mistake."""
    robot = read(
        body(
            '<geom type="mesh" mesh="m"/><geom type="box" mesh="f"/><geom type="box" mesh="m"/>',
            '<asset><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/>'
            '<mesh name="f" file="f.stl"/></asset>',
        )
    )
    shapes = link(robot).collisions
    found = [(s.shape, s.size, s.mesh and s.mesh.filename, s.fit_to_mesh) for s in shapes]
    fitted = ("mesh", (), "f.stl", True)
    assert found == [("unknown", (), None, False), fitted, ("unknown", (), None, True)]


@pytest.mark.parametrize(
    ("geom", "kind", "size"),
    [
        ('size="1 2 3"', "sphere", (1,)),
        ('type="capsule" size="1 2 3"', "capsule", (1, 2)),
        ('type="cylinder" size="1 2 3"', "cylinder", (1, 2)),
        ('type="ellipsoid" size="1 2 3"', "ellipsoid", (1, 2, 3)),
        ('type="box" size="1 2 3"', "box", (1, 2, 3)),
        ('type="plane" size="1 2 3"', "plane", ()),
        ('type="hfield" hfield="h"', "unknown", ()),
    ],
)
def test_kind_and_size(geom, kind, size):
    hfield = '<asset><hfield name="h" file="h.png" size="1 1 1 1"/></asset>'
    shape = collision(read(body(f"<geom {geom}/>", hfield)))
    assert (shape.shape, shape.size) == (kind, size)


@pytest.mark.parametrize(
    ("attributes", "color"),
    [
        ("", None),
        ('rgba="0.5 0.5 0.5 1"', None),
        ('rgba="1 0 0 0.25"', (1, 0, 0, 0.25)),
        ('material="blue"', (0, 0, 1, 1)),
        ('material="blue" rgba="1 0 0 1"', (1, 0, 0, 1)),
        ('material="nothing"', None),
        ('class="painted"', (0, 0, 1, 1)),
        ('class="red"', (1, 0, 0, 1)),
        ('material="new"', (1, 1, 1, 1)),
        ('rgba="1.01 0 0 1"', None),
        ('rgba="-0.01 0 0 1"', None),
        ('rgba="0.1 0.123456789 0 1"', (0.1, 0.123457, 0, 1)),
    ],
)
def test_geom_color_or_material_color(attributes, color):
    rest = (
        '<default><default class="painted"><geom material="blue"/></default>'
        '<default class="red"><geom rgba="1 0 0 1"/></default></default>'
        '<asset><material name="blue" rgba="0 0 1 1"/><material name="new"/></asset>'
    )
    assert collision(read(body(f'<geom size="1" {attributes}/>', rest))).color == color

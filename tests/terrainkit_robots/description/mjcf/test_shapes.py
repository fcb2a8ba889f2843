from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh

from terrainkit_robots.description.load import load_robot
from terrainkit_robots.transforms import quat_to_matrix
from tests.tables import read_table
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


@pytest.mark.parametrize("asset", read_table(__file__, "mesh_pose_matches_mujoco"))
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


@pytest.mark.parametrize(("compiler", "name", "path"), read_table(__file__, "mesh_paths_follow"))
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


@pytest.mark.parametrize(("geom", "kind", "size"), read_table(__file__, "kind_and_size"))
def test_kind_and_size(geom, kind, size):
    hfield = '<asset><hfield name="h" file="h.png" size="1 1 1 1"/></asset>'
    shape = collision(read(body(f"<geom {geom}/>", hfield)))
    assert (shape.shape, *shape.size) == (kind, *size)


@pytest.mark.parametrize(("attributes", "color"), read_table(__file__, "geom_color_or_material"))
def test_geom_color_or_material_color(attributes, color):
    rest = (
        '<default><default class="painted"><geom material="blue"/></default>'
        '<default class="red"><geom rgba="1 0 0 1"/></default></default>'
        '<asset><material name="blue" rgba="0 0 1 1"/><material name="new"/></asset>'
    )
    assert collision(read(body(f'<geom size="1" {attributes}/>', rest))).color == (
        tuple(color) or None
    )

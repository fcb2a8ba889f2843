"""Test that bodies are weighed by their meshes, as MuJoCo does."""

import mujoco
import numpy as np
import pytest
import trimesh

from terrainkit_robots.description.load import load_robot
from terrainkit_robots.description.mjcf import mesh_masses

CORNER = "0 0 0  0.1 0 0  0 0.1 0  0 0 0.1"
"""A tetrahedron with a volume of 0.1^3 / 6 m3."""


def model(tmp_path, asset, geoms, contents=None):
    """Return the robot of a body with geoms, and its path."""
    path = tmp_path / "robot.xml"
    path.write_text(
        f"<mujoco><asset>{asset}</asset><worldbody><body name='a'><freejoint/>{geoms}</body>"
        "</worldbody></mujoco>"
    )
    return load_robot(path, contents=contents and {path: path.read_bytes(), **contents}), path


@pytest.mark.parametrize(
    ("mesh", "geom", "mass"),
    [
        ("", "", 1000 * 0.001 / 6),
        ('scale="2 1 3"', "", 1.0),
        ("", 'density="500"', 500 * 0.001 / 6),
        ("", 'mass="2"', 2.0),
        ("", 'type="box" fitscale="2"', None),
        ('inertia="shell"', "", None),
        ('refpos="1 0 0" refquat="0 1 0 0"', 'pos="1 2 3" euler="10 20 30"', 1000 * 0.001 / 6),
    ],
)
def test_mesh_of_vertices_is_weighed(tmp_path, mesh, geom, mass):
    asset = f'<mesh name="m" vertex="{CORNER}" {mesh}/>'
    kind = "" if "type" in geom else 'type="mesh"'
    shapes = f'<geom mesh="m" {kind} {geom}/><geom size="0.1" pos="0 0 1" density="1"/>'
    robot, path = model(tmp_path, asset, shapes)
    inertial = robot.links[0].inertial
    body = mujoco.MjModel.from_xml_path(str(path)).body("a")
    assert inertial.mass == pytest.approx(body.mass[0], rel=1e-12)
    if mass is not None:
        assert inertial.mass == pytest.approx(mass + 4 / 3 * np.pi * 0.1**3, rel=1e-6)
    assert inertial.origin[:3, 3] == pytest.approx(body.ipos)
    moments = np.linalg.eigvalsh(inertial.inertia)
    assert moments == pytest.approx(np.sort(body.inertia))


def test_mesh_of_a_file_is_weighed(tmp_path):
    box = trimesh.creation.box((0.1, 0.2, 0.3)).export(file_type="stl")
    geom, asset = '<geom type="mesh" mesh="m"/>', '<mesh name="m" file="box.stl"/>'
    robot, _ = model(tmp_path, asset, geom)
    assert np.isnan(robot.links[0].inertial.mass)  # the file is missing
    robot, _ = model(tmp_path, asset, geom, {tmp_path / "box.stl": box})
    assert robot.links[0].inertial.mass == pytest.approx(6.0, rel=1e-5)


def test_mesh_that_mujoco_rejects_is_not_weighed(tmp_path, monkeypatch):
    geom, asset = '<geom type="mesh" mesh="m"/>', '<mesh name="m" file="m.stl"/>'
    (tmp_path / "m.stl").write_bytes(b"no mesh")
    good = f'<mesh name="v" vertex="{CORNER}"/>'
    robot, _ = model(tmp_path, asset + good, geom + '<geom type="mesh" mesh="v"/>')
    assert np.isnan(robot.links[0].inertial.mass)
    assert not robot.problems
    flat = '<mesh name="m" vertex="0 0 0 1 0 0 0 1 0 1 1 0"/>'
    assert np.isnan(model(tmp_path, flat, geom)[0].links[0].inertial.mass)
    trimesh.creation.box((0.1, 0.2, 0.3)).export(tmp_path / "m.stl")
    monkeypatch.setattr(mesh_masses, "MAX_BYTES", 100)
    assert np.isnan(model(tmp_path, asset, geom)[0].links[0].inertial.mass)


def test_mesh_of_a_body_with_an_inertial_is_not_read(tmp_path, monkeypatch):
    monkeypatch.setattr(mesh_masses, "open_regular", None)
    inertial = '<inertial mass="3" pos="0 0 0" diaginertia="1 1 1"/>'
    geom = '<geom type="mesh" mesh="m"/>'
    robot, _ = model(tmp_path, '<mesh name="m" file="m.stl"/>', inertial + geom)
    assert robot.links[0].inertial.mass == 3

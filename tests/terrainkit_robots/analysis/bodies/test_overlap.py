import math
import struct
from pathlib import Path

import mujoco
import numpy as np
import pytest

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot

FILE = Path("/robots/robot.urdf")
BOX = '<box size="0.2 0.2 0.2"/>'


def scene(text, file=FILE):
    return Facts(load_robot(file, contents={file: text.encode()})).overlap_scene


def link(name, *shapes):
    """Return a link with shapes: elements, or pairs of an element and an origin."""
    inner = ""
    for shape in shapes:
        element, origin = shape if isinstance(shape, tuple) else (shape, "")
        inner += f"<collision><origin {origin}/><geometry>{element}</geometry></collision>"
    return f'<link name="{name}">{inner}</link>'


def joint(parent, child, xyz="0 0 0", kind="continuous", axis="0 0 1", rpy="0 0 0"):
    return (
        f'<joint name="{child}_joint" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{child}"/><origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/></joint>'
    )


def apart(first, second, xyz, rpy="0 0 0"):
    """Return a robot of two shapes with an empty body between them, so that they can collide."""
    return (
        f'<robot name="r">{link("a", first)}{link("b")}{link("c", second)}'
        f"{joint('a', 'b')}{joint('b', 'c', xyz, rpy=rpy)}</robot>"
    )


def depth(first, second, xyz, rpy="0 0 0"):
    found = scene(apart(first, second, xyz, rpy)).detect({})
    assert len(found) <= 1
    return found[0].depth if found else 0.0


# Depth


@pytest.mark.parametrize(
    ("first", "second", "xyz", "expected"),
    [
        # Spheres of 0.1 and 0.2 m, 0.25 m apart.
        ('<sphere radius="0.1"/>', '<sphere radius="0.2"/>', "0 0.25 0", 0.05),
        ('<sphere radius="0.1"/>', '<sphere radius="0.2"/>', "0 0.31 0", 0.0),
        # Boxes with half sides of 0.1 m, 0.15 m apart along x; the other sides are aligned.
        (BOX, BOX, "0.15 0 0", 0.05),
        (BOX, BOX, "0.15 0.18 0", 0.02),
        (BOX, BOX, "0.201 0 0", 0.0),
        (BOX, '<sphere radius="0.1"/>', "0 0 0.17", 0.03),
        # A capsule from z = -0.3 to 0.3 with a radius of 0.05 above a box.
        (BOX, '<capsule radius="0.05" length="0.6"/>', "0.13 0 0", 0.02),
        (BOX, '<cylinder radius="0.05" length="0.6"/>', "0 0 0.38", 0.02),
    ],
)
def test_detect_depth_of_primitives(first, second, xyz, expected):
    assert depth(first, second, xyz) == pytest.approx(expected, abs=1e-5)


def test_detect_depth_of_rotated_box():
    # At 45 degrees the edge reaches 0.1 * sqrt(2) toward the other, 0.22 m away.
    found = depth(BOX, BOX, "0.22 0 0", rpy=f"0 0 {math.pi / 4}")
    assert found == pytest.approx(0.1 + 0.1 * math.sqrt(2) - 0.22, abs=1e-5)


def test_detect_applies_shape_origins():
    first, second = (BOX, 'xyz="1 0 0"'), (BOX, 'xyz="0 -1 0"')
    moved = scene(apart(first, second, "1.15 1 0")).detect({})
    assert [o.depth for o in moved] == [pytest.approx(0.05, abs=1e-5)]


def test_detect_sorts_by_depth():
    shapes = [(BOX, f'xyz="0 0 {z}"') for z in (0, 1)]
    balls = [
        ('<sphere radius="0.1"/>', 'xyz="0 0 0.17"'),
        ('<sphere radius="0.1"/>', 'xyz="0 0 0.84"'),
    ]
    found = scene(
        f'<robot name="r">{link("a", *shapes)}{link("b")}{link("c", *balls)}'
        f"{joint('a', 'b')}{joint('b', 'c')}</robot>"
    ).detect({})
    assert [o.depth for o in found] == [pytest.approx(0.04), pytest.approx(0.03)]
    assert {(o.first.link, o.second.link) for o in found} == {("a", "c")}
    assert not found[0].has_mesh


# Pairs


def test_detect_ignores_neighbors():
    text = f'<robot name="r">{link("a", BOX)}{link("b", BOX)}{joint("a", "b")}</robot>'
    assert scene(text).detect({}) == []


def test_detect_ignores_links_fixed_to_neighbors():
    text = (
        f'<robot name="r">{link("a")}{link("b", BOX)}{link("c")}{link("d", BOX)}'
        f"{joint('a', 'b', kind='fixed')}{joint('a', 'c')}{joint('c', 'd', kind='fixed')}</robot>"
    )
    assert scene(text).detect({}) == []


def test_detect_reports_siblings():
    text = (
        f'<robot name="r">{link("a")}{link("b", BOX)}{link("c", BOX)}'
        f"{joint('a', 'b', '0.11 0 0')}{joint('a', 'c')}</robot>"
    )
    # At 0.1, half of a box, mj_geomDistance of MuJoCo 3.16 and 3.17 has the wrong sign.
    assert [o.depth for o in scene(text).detect({})] == [pytest.approx(0.09, abs=1e-5)]


@pytest.mark.parametrize(
    "shape",
    [
        '<sphere radius="0"/>',
        '<sphere radius="-1"/>',
        '<box size="0.2 0.2 0"/>',
        '<box size="1e20 1 1"/>',
        '<mesh filename="lost.stl"/>',
        "<sdf/>",
    ],
)
def test_detect_ignores_shapes_without_volume(shape):
    assert depth(BOX, shape, "0 0 0") == 0


def test_detect_ignores_masses():
    text = apart(BOX, BOX, "0.15 0 0").replace(
        '<link name="a">',
        '<link name="a"><inertial><mass value="-1"/><inertia ixx="0" iyy="-1" izz="0"/></inertial>',
    )
    assert len(scene(text).detect({})) == 1


def mjcf(attributes="", contact="", joints='<joint name="j"/>'):
    return (
        f'<mujoco><worldbody><body name="a"><geom size="0.1"/><body name="b"><joint name="i"/>'
        '<inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/><body name="c" pos="0.15 0 0">'
        f'{joints}<geom size="0.1" {attributes}/></body></body></body></worldbody>'
        f"{contact}</mujoco>"
    )


@pytest.mark.parametrize(
    ("text", "count"),
    [
        (mjcf(), 1),
        (mjcf('contype="0" conaffinity="0"'), 0),
        (mjcf('contype="2" conaffinity="2"'), 0),
        (mjcf('contype="2" conaffinity="1"'), 1),
        (mjcf('contype="0"'), 1),
        (mjcf(contact='<contact><exclude body1="a" body2="c"/></contact>'), 0),
        (mjcf(joints='<joint name="j"/><joint name="k" axis="1 0 0"/>'), 1),
    ],
)
def test_detect_matches_contacts_of_mujoco(text, count):
    found = scene(text, Path("/robots/robot.xml")).detect({})
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert len(found) == data.ncon == count
    if count:
        assert found[0].depth == pytest.approx(-data.contact.dist[0], abs=1e-6)


def test_detect_ignores_neighbors_across_virtual_bodies():
    # b has two joints; a and b are still neighbors.
    text = (
        '<mujoco><worldbody><body name="a"><geom size="0.1"/><body name="b" pos="0.1 0 0">'
        '<joint name="i"/><joint name="j" axis="1 0 0"/><geom size="0.1"/></body></body>'
        "</worldbody></mujoco>"
    )
    assert scene(text, Path("/robots/robot.xml")).detect({}) == []


# Meshes


def stl(path, points, faces):
    data = bytes(80) + struct.pack("<I", len(faces))
    for face in faces:
        data += struct.pack("<12fH", 0, 0, 0, *(x for k in face for x in points[k]), 0)
    path.write_bytes(data)


@pytest.fixture
def cube(tmp_path):
    """Return the file of a cube from 0 to 1 on each axis, whose center is not its origin."""
    points = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    stl(tmp_path / "cube.stl", points, faces)
    return tmp_path / "cube.stl"


def test_detect_places_mesh_by_its_vertices(cube):
    mesh = f'<mesh filename="{cube}" scale="0.2 0.2 0.2"/>'
    assert depth(BOX, mesh, "0.05 -0.1 -0.1") == pytest.approx(0.05, abs=1e-5)
    assert depth(BOX, mesh, "0.11 -0.1 -0.1") == 0


def test_detect_rotates_mesh_with_body(cube):
    # A quarter turn about z: the mesh lies from -0.2 to 0 along x.
    mesh = f'<mesh filename="{cube}" scale="0.2 0.2 0.2"/>'
    turned = scene(apart(BOX, mesh, "0.28 -0.1 -0.1"))
    assert turned.detect({}) == []
    (found,) = turned.detect({"c_joint": math.pi / 2})
    assert found.depth == pytest.approx(0.02, abs=1e-5)
    assert found.has_mesh


def test_detect_ignores_flat_meshes(tmp_path):
    stl(tmp_path / "flat.stl", [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)], [(0, 1, 2), (1, 3, 2)])
    assert depth(BOX, f'<mesh filename="{tmp_path}/flat.stl"/>', "0 0 0") == 0


# Joint positions


def test_detect_depends_on_joint_positions():
    # An arm of 0.3 m: c starts beside a, and rotates into d.
    robot = scene(
        f'<robot name="r">{link("a", BOX)}{link("b")}{link("c", BOX)}{link("d", BOX)}'
        f"{joint('a', 'b')}{joint('b', 'c', '0.3 0 0')}{joint('a', 'd', '0 0.35 0')}</robot>"
    )
    assert robot.detect({}) == []
    (found,) = robot.detect({"b_joint": math.pi / 2})
    assert found.depth == pytest.approx(0.15, abs=1e-5)


def test_sweep_matches_detect():
    robot = scene(apart(BOX, BOX, "0.22 0 0"))
    angles = np.linspace(-3, 3, 7)
    swept = list(robot.sweep({"c_joint": angles}, len(angles)))
    single = [robot.detect({"c_joint": float(q)}) for q in angles]
    assert [[o.depth for o in found] for found in swept] == [
        [pytest.approx(o.depth) for o in found] for found in single
    ]
    assert any(swept)
    assert not all(swept)


def test_detect_without_shapes():
    assert scene('<robot name="r"><link name="a"/></robot>').detect({}) == []
    assert list(scene('<robot name="r"/>').sweep({}, 3)) == [[], [], []]


def test_overlap_scene_rejects_too_many_shapes():
    links = link("a") + "".join(link(f"l{k}", BOX) for k in range(1500))
    joints = "".join(joint("a", f"l{k}") for k in range(1500))
    with pytest.raises(CannotCheckError, match="collision shapes: got 1500"):
        scene(f'<robot name="r">{links}{joints}</robot>')


@pytest.mark.parametrize("name", ["a1/urdf/a1.urdf", "go2/urdf/go2.urdf"])
def test_detect_finds_none_on_standing_robots(name, robot_file):
    facts = Facts(load_robot(robot_file(name)))
    assert facts.stance is not None
    overlaps = facts.overlap_scene.detect(facts.default_pose)
    assert [overlap.depth for overlap in overlaps if overlap.depth > 0.001] == []

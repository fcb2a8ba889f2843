from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.transforms import rpy_to_matrix

FILE = Path("/robots/robot.urdf")


def bodies(inner):
    text = f'<robot name="r">{inner}</robot>'
    return Facts(load_robot(FILE, contents={FILE: text.encode()})).bodies


def link(name, mass=None, xyz="0 0 0", inertia="1 1 1 0 0 0", rpy="0 0 0", shape=""):
    if mass is None:
        return f'<link name="{name}">{shape}</link>'
    names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    six = " ".join(f'{n}="{v}"' for n, v in zip(names, inertia.split(), strict=True))
    return (
        f'<link name="{name}"><inertial><origin xyz="{xyz}" rpy="{rpy}"/>'
        f'<mass value="{mass}"/><inertia {six}/></inertial>{shape}</link>'
    )


def joint(parent, child, kind="fixed", xyz="0 0 0", rpy="0 0 0"):
    return (
        f'<joint name="{parent}_{child}" type="{kind}"><origin xyz="{xyz}" rpy="{rpy}"/>'
        f'<parent link="{parent}"/><child link="{child}"/></joint>'
    )


def names(merged):
    return [[each.name for each in body.links] for body in merged]


# Merging


def test_merge_bodies_without_links():
    assert bodies("") == ()


def test_merge_bodies_merges_fixed_joints():
    merged = bodies(
        "".join(map(link, "abcde"))
        + joint("a", "b")
        + joint("b", "c", "revolute", xyz="0 0 1")
        + joint("c", "d")
        + joint("a", "e")
    )
    assert names(merged) == [["a", "b", "e"], ["c", "d"]]
    trunk, arm = merged
    assert (trunk.index, trunk.parent, trunk.joint) == (0, None, None)
    assert (arm.index, arm.parent, arm.joint.name) == (1, 0, "b_c")
    assert trunk.top.name == "a"


def test_merge_bodies_composes_frames_along_fixed_joints():
    # b is 1 m ahead of a and turned to the left, so c, 2 m ahead of b, is to the left of a.
    quarter = f"0 0 {np.pi / 2}"
    merged = bodies(
        "".join(map(link, "abcd"))
        + joint("a", "b", xyz="1 0 0", rpy=quarter)
        + joint("b", "c", "continuous", xyz="2 0 0")
        + joint("c", "d", xyz="0 0 3", rpy=quarter)
    )
    np.testing.assert_allclose(merged[0].poses[0], np.eye(4))
    np.testing.assert_allclose(merged[0].poses[1][:3, 3], [1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(merged[1].origin[:3, 3], [1, 2, 0], atol=1e-15)
    np.testing.assert_allclose(merged[1].origin[:3, :3], rpy_to_matrix(np.array([0, 0, np.pi / 2])))
    np.testing.assert_allclose(merged[1].poses[1][:3, 3], [0, 0, 3])


@pytest.mark.parametrize("kind", ["revolute", "continuous", "prismatic"])
def test_merge_bodies_separates_at_moving_joints(kind):
    merged = bodies(link("a") + link("b") + joint("a", "b", kind))
    assert names(merged) == [["a"], ["b"]]
    assert merged[1].joint.moves


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_merge_bodies_separates_at_unactuated_joints(kind):
    merged = bodies(link("a", 1) + link("b", 1) + joint("a", "b", kind))
    assert names(merged) == [["a"], ["b"]]
    assert not merged[1].joint.moves


def test_merge_bodies_treats_unknown_joints_as_fixed():
    assert names(bodies(link("a") + link("b") + joint("a", "b", "hinge"))) == [["a", "b"]]


def test_merge_bodies_skips_world_above_floating_joint():
    merged = bodies(
        link("world")
        + link("a", 1)
        + link("b", 1)
        + joint("world", "a", "floating")
        + joint("a", "b", "revolute")
    )
    assert names(merged) == [["a"], ["b"]]
    assert merged[0].joint is None


def test_merge_bodies_excludes_siblings_of_the_trunk():
    merged = bodies(
        link("world")
        + link("a", 1)
        + link("b", 1)
        + joint("world", "a", "fixed")
        + joint("world", "b", "floating")
    )
    assert names(merged)[0] == ["world", "a"]


def test_body_name_is_that_of_heaviest_link():
    merged = bodies(link("a") + link("b", 0.1) + link("c", 2) + joint("a", "b") + joint("b", "c"))
    assert (merged[0].name, merged[0].top.name) == ("c", "a")
    assert bodies(link("a") + link("b") + joint("a", "b"))[0].name == "a"


def test_body_shapes_are_in_body_frame():
    shape = (
        '<collision><origin xyz="0 0 1"/><geometry><sphere radius="1"/></geometry></collision>'
        '<visual><geometry><sphere radius="2"/></geometry></visual>'
    )
    merged = bodies(
        link("a") + link("b", shape=shape) + joint("a", "b", xyz="1 0 0", rpy=f"{np.pi} 0 0")
    )
    (collision,), (visual,) = merged[0].collisions, merged[0].visuals
    assert (collision.link, collision.geometry.size) == ("b", (1,))
    np.testing.assert_allclose(collision.pose[:3, 3], [1, 0, -1], atol=1e-12)
    np.testing.assert_allclose(visual.pose[:3, 3], [1, 0, 0], atol=1e-12)


# Mass and inertia by hand


def test_body_inertia_of_two_point_masses():
    # 1 kg at x = 0 and 3 kg at x = 2: the center is at 1.5, and 1 * 1.5^2 + 3 * 0.5^2 = 3.
    none = "0 0 0 0 0 0"
    (body,) = bodies(
        link("a", 1, inertia=none) + link("b", 3, inertia=none) + joint("a", "b", xyz="2 0 0")
    )
    assert body.mass == 4
    assert body.center.tolist() == [1.5, 0, 0]
    np.testing.assert_allclose(body.inertia, np.diag([0, 3, 3]))
    np.testing.assert_allclose(body.principal, [0, 3, 3])


def test_body_inertia_rotates_with_inertial_frame():
    (body,) = bodies(link("a", 1, inertia="1 2 3 0 0 0", rpy=f"0 0 {np.pi / 2}"))
    np.testing.assert_allclose(body.inertia, np.diag([2, 1, 3]), atol=1e-12)


def test_body_inertia_rotates_with_link():
    (body,) = bodies(
        link("a") + link("b", 1, inertia="1 2 3 0 0 0") + joint("a", "b", rpy=f"{np.pi / 2} 0 0")
    )
    np.testing.assert_allclose(body.inertia, np.diag([1, 3, 2]), atol=1e-12)


def test_body_mass_ignores_placeholder_links():
    (alone,) = bodies(link("a", 2, xyz="1 2 3", inertia="1 2 3 .1 .2 .3"))
    (held, moved) = bodies(
        link("a", 2, xyz="1 2 3", inertia="1 2 3 .1 .2 .3")
        + link("b")
        + link("c")
        + joint("a", "b", xyz="5 5 5")
        + joint("a", "c", "revolute")
    )
    assert held.mass == alone.mass
    np.testing.assert_array_equal(held.center, alone.center)
    np.testing.assert_array_equal(held.inertia, alone.inertia)
    assert moved.mass == 0
    assert moved.center.tolist() == [0, 0, 0]
    assert moved.inertia.tolist() == np.zeros((3, 3)).tolist()


@pytest.mark.parametrize("mass", ["-1", "0", "1e20", "1e29", "nan", "inf", "x"])
def test_body_mass_of_invalid_values_is_finite(mass):
    (body,) = bodies(link("a", mass, inertia="1e29 0 -1 1e29 0 0") + link("b", 1) + joint("a", "b"))
    assert np.isfinite([body.mass, *body.center, *body.inertia.ravel(), *body.principal]).all()


def test_body_mass_includes_negative_masses():
    (body,) = bodies(link("a", -1) + link("b", 3) + joint("a", "b"))
    assert body.mass == 2


# Compared with spatial inertias

NUMBERS = st.floats(-2, 2)
PLACES = st.tuples(*[NUMBERS] * 3)
PARTS = st.tuples(st.floats(0.1, 10), PLACES, PLACES, PLACES, PLACES, PLACES)


def words(values):
    return " ".join(repr(float(value)) for value in values)


def cross(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


@settings(max_examples=50, deadline=None)
@given(st.lists(PARTS, min_size=2, max_size=4))
def test_body_inertia_is_sum_of_spatial_inertias(parts):
    inner, total = link("root"), np.zeros((6, 6))
    for k, (mass, xyz, rpy, moments, place, turn) in enumerate(parts):
        principal = 0.1 + np.abs(moments)
        inner += link(k, mass, words(xyz), words([*principal, 0, 0, 0]), words(rpy))
        inner += joint("root", k, xyz=words(place), rpy=words(turn))
        spin = rpy_to_matrix(np.array(turn)) @ rpy_to_matrix(np.array(rpy))
        c = cross(rpy_to_matrix(np.array(turn)) @ xyz + np.array(place))
        about = spin @ np.diag(principal) @ spin.T - mass * c @ c
        total += np.block([[about, mass * c], [-mass * c, mass * np.eye(3)]])
    (body,) = bodies(inner)
    assert body.mass == pytest.approx(total[3, 3], rel=1e-12)
    c = cross(body.center)
    np.testing.assert_allclose(body.mass * c, total[:3, 3:], atol=1e-10)
    np.testing.assert_allclose(body.inertia - body.mass * c @ c, total[:3, :3], atol=1e-9)


# Compared with MuJoCo


def compiled(path):
    """Compile a URDF with a floating base, without shapes, and with fixed links merged."""
    root = etree.parse(str(path)).getroot()
    for shape in list(root.iter("visual", "collision")):
        shape.getparent().remove(shape)
    children = {child.get("link") for child in root.iter("child")}
    trunk = next(e.get("name") for e in root.findall("link") if e.get("name") not in children)
    for old in root.findall("mujoco"):
        root.remove(old)
    root.append(
        etree.fromstring(
            '<mujoco><compiler fusestatic="true" balanceinertia="false" inertiafromgeom="false"/>'
            "</mujoco>"
        )
    )
    if trunk != "world":
        root.append(etree.fromstring('<link name="world"/>'))
        root.append(
            etree.fromstring(
                '<joint name="floating_by_test" type="floating"><parent link="world"/>'
                f'<child link="{trunk}"/></joint>'
            )
        )
    return mujoco.MjModel.from_xml_string(etree.tostring(root).decode())


@pytest.mark.parametrize(
    "name",
    [
        "a1/urdf/a1.urdf",
        "go2/urdf/go2.urdf",
        "h1/urdf/h1.urdf",
        "g1/g1_29dof.urdf",
        *bundled.robot_names(),
    ],
)
def test_merge_bodies_matches_mujoco(name, robot_file):
    path = bundled.urdf_path(name) if name in bundled.robot_names() else robot_file(name)
    model = compiled(path)
    merged = Facts(load_robot(path)).bodies
    assert len(merged) == model.nbody - 1
    for body in merged:
        theirs = model.body(body.top.name)
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, theirs.iquat)
        turn = turn.reshape(3, 3)
        inertia = turn @ np.diag(theirs.inertia) @ turn.T
        assert body.mass == pytest.approx(float(theirs.mass[0]), rel=1e-9)
        np.testing.assert_allclose(body.center, theirs.ipos, rtol=1e-9, atol=1e-12)
        # MuJoCo 3 computes the principal axes less accurately.
        near = 1e-9 if int(mujoco.__version__.split(".")[0]) >= 4 else 1e-5
        np.testing.assert_allclose(
            body.inertia, inertia, rtol=near, atol=near * theirs.inertia.max()
        )
        np.testing.assert_allclose(body.principal, np.sort(theirs.inertia), rtol=near)

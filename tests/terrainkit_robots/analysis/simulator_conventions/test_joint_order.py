from pathlib import Path

import mujoco
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.quiet_mujoco import quiet_mujoco

SHARED = [
    "a1/urdf/a1.urdf",
    "go2/urdf/go2.urdf",
    "h1/urdf/h1.urdf",
    "cassie/urdf/cassie.urdf",
    "anymal_c/urdf/anymal_c.urdf",
    "g1/g1_29dof.urdf",
]


def orders(facts):
    return {order.simulator: order for order in facts.simulator_orders}


def joints(facts):
    return {name: " ".join(order.joints) for name, order in orders(facts).items()}


def bodies(facts):
    return {name: " ".join(order.bodies) for name, order in orders(facts).items()}


# By hand. b is the parent of c, a and F; F of x3, x1 and G; G of y1.

TREE = (
    "jc: b > c",
    "jz: a > z",
    "jF!: b > F",
    "jx3: F > x3",
    "jG!: F > G",
    "jx1: F > x1",
    "jy1: G > y1",
    "ja: b > a",
    "jk: c > k",
)


def test_simulator_orders_by_hand(urdf):
    facts = urdf(*TREE)
    assert " ".join(facts.file_order) == "jc jz jx3 jx1 jy1 ja jk"
    assert joints(facts) == {
        "MuJoCo": "jc jk jx3 jy1 jx1 ja jz",  # the child of G replaces G, before x1
        "Isaac Gym": "ja jz jc jk jx1 jx3 jy1",
        "Isaac Lab": "ja jc jx1 jx3 jy1 jz jk",
        "Genesis": "jc jk jx3 jx1 jy1 ja jz",  # as genesis-world 1.4.5 lists this tree
    }
    assert bodies(facts) == {
        "MuJoCo": "b c k x3 y1 x1 a z",
        "Isaac Gym": "b a z c k x1 x3 y1",
        "Isaac Lab": "b a c x1 x3 y1 z k",
        "Genesis": "b c k x3 x1 y1 a z",
    }
    assert {name: order.certain for name, order in orders(facts).items()} == {
        "MuJoCo": True,
        "Isaac Gym": False,
        "Isaac Lab": False,
        "Genesis": True,
    }


def test_simulator_order_matches_mujoco_compiler(urdf):
    facts = urdf(*TREE)
    compiled = compile_urdf(facts.model.file.read_text())
    assert compiled == (orders(facts)["MuJoCo"].joints, orders(facts)["MuJoCo"].bodies)


def test_simulator_orders_with_kept_link(urdf):
    facts = urdf("jb: b > a", "jF!*: a > F", "jc: F > c")
    assert bodies(facts) == {
        "MuJoCo": "b a c",
        "Isaac Gym": "b a F c",
        "Isaac Lab": "b a F c",
        "Genesis": "b a c",
    }


def test_simulator_orders_are_certain_if_unique(urdf):
    facts = urdf("ja: b > a", "jc: b > c", "jd: a > d", "je: c > e")
    assert all(order.certain for order in facts.simulator_orders)
    assert joints(facts)["Isaac Lab"] == "ja jc jd je"
    assert joints(facts)["Isaac Gym"] == "ja jd jc je"


def test_simulator_order_with_fixed_joint_is_uncertain(urdf):
    # If merged, c is a sibling of a; otherwise it is one level below, after d.
    facts = urdf("ja: b > a", "jb!: b > bb", "jc: bb > c", "jd: a > d")
    assert joints(facts)["Isaac Lab"] == "ja jc jd"
    assert not orders(facts)["Isaac Lab"].certain
    assert orders(facts)["Isaac Gym"].certain


def test_simulator_orders_sort_usd_names(urdf):
    # In the file, - sorts before 1. In USD it becomes _ and sorts after 1.
    facts = urdf("a1: b > p", "a-z: b > q")
    assert joints(facts)["Isaac Gym"] == "a1 a-z"
    assert not orders(urdf("left_10: b > p", "left_1_: b > q", "left_09: b > r"))[
        "Isaac Gym"
    ].certain


def test_simulator_orders_of_mjcf(mjcf):
    geom = '<geom size="0.1" mass="1"/>'
    facts = mjcf(
        f'<body name="b"><freejoint/>{geom}'
        f'<body name="z"><joint name="jz"/>{geom}'
        f'<body name="fixed">{geom}<body name="y"><joint name="jy"/>{geom}</body></body></body>'
        f'<body name="a"><joint name="ja"/>{geom}</body></body>'
    )
    assert joints(facts) == {
        "MuJoCo": "jz jy ja",
        "Isaac Gym": "jz jy ja",
        "Isaac Lab": "jz ja jy",
        "Genesis": "jz jy ja",
    }
    assert bodies(facts)["MuJoCo"] == "b z fixed y a"
    assert not orders(facts)["Isaac Gym"].certain


def test_simulator_orders_of_multi_joint_bodies(mjcf):
    geom = '<geom size="0.1" mass="1"/>'
    two = '<joint name="j1" axis="1 0 0"/><joint name="j2"/>'
    facts = mjcf(f'<body name="b"><freejoint/>{geom}<body name="a">{two}{geom}</body></body>')
    found = orders(facts)
    assert found["MuJoCo"].joints == ("j1", "j2")
    assert found["MuJoCo"].bodies == ("b", "a")
    assert [name for name, order in found.items() if order.certain] == ["MuJoCo", "Genesis"]


# Published orders. The files list the legs in another order: A1 with FR first, ANYmal C as LF, RF,
# LH, RH.


@pytest.mark.parametrize(
    ("name", "legs", "parts"),
    [
        (
            "a1/urdf/a1.urdf",
            ["FL", "FR", "RL", "RR"],
            ["_hip_joint", "_thigh_joint", "_calf_joint"],
        ),
        ("anymal_c/urdf/anymal_c.urdf", ["LF", "LH", "RF", "RH"], ["_HAA", "_HFE", "_KFE"]),
    ],
)
def test_isaac_orders_match_published_lists(robot_file, name, legs, parts):
    found = orders(Facts(load_robot(robot_file(name))))
    assert found["Isaac Gym"].joints == tuple(leg + part for leg in legs for part in parts)
    assert found["Isaac Lab"].joints == tuple(leg + part for part in parts for leg in legs)
    assert not found["Isaac Lab"].certain  # an importer that keeps the order of the file differs
    assert "robot.joint_names" in found["Isaac Lab"].reason


def test_isaac_lab_order_matches_published_g1(robot_file):
    order = orders(Facts(load_robot(robot_file("g1/g1_29dof.urdf"))))["Isaac Lab"]
    assert order.certain
    assert order.joints[:9] == (
        "left_hip_pitch_joint",
        "right_hip_pitch_joint",
        "waist_yaw_joint",
        "left_hip_roll_joint",
        "right_hip_roll_joint",
        "waist_roll_joint",
        "left_hip_yaw_joint",
        "right_hip_yaw_joint",
        "waist_pitch_joint",
    )


# Compared with MuJoCo


def compile_urdf(text):
    """Return the compiled joints and bodies of a URDF, with the same inertial for all links."""
    root = etree.fromstring(text.encode())
    for link in root.iterchildren("link"):
        for part in list(link):
            link.remove(part)
        inertial = etree.SubElement(link, "inertial")
        etree.SubElement(inertial, "mass", value="1")
        etree.SubElement(inertial, "inertia", ixx="1", iyy="1", izz="1", ixy="0", ixz="0", iyz="0")
    for other in list(root):
        if other.tag not in ("link", "joint"):
            root.remove(other)
    children = {child.get("link") for child in root.iterfind("joint/child")}
    base = next(name for e in root.iterchildren("link") if (name := e.get("name")) not in children)
    etree.SubElement(root, "link", name="tested_world")
    joint = etree.SubElement(root, "joint", name="tested_float", type="floating")
    etree.SubElement(joint, "parent", link="tested_world")
    etree.SubElement(joint, "child", link=base)
    return listed(mujoco.MjModel.from_xml_string(etree.tostring(root).decode()))


def listed(model):
    moving = [int(kind) for kind in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)]
    names = [model.joint(i).name for i in range(model.njnt) if model.jnt_type[i] in moving]
    return tuple(names), tuple(model.body(i).name for i in range(1, model.nbody))


def check(path, compiled):
    order = orders(Facts(load_robot(path)))["MuJoCo"]
    assert (order.joints, order.bodies) == compiled
    assert order.certain


@pytest.mark.parametrize("name", SHARED)
def test_mujoco_order_of_published_robot(robot_file, name):
    path = robot_file(name)
    check(path, compile_urdf(path.read_text()))


@pytest.mark.parametrize("name", ["quadruped", "biped"])
def test_mujoco_order_of_bundled_robot(name):
    path = bundled.urdf_path(name)
    check(path, compile_urdf(path.read_text()))
    model = path.with_suffix(".xml")
    with quiet_mujoco():
        check(model, listed(mujoco.MjModel.from_xml_path(str(model))))


@st.composite
def trees(draw):
    """Return the joints of a tree, shuffled: parent, child and whether it is fixed."""
    count = draw(st.integers(2, 12))
    ends = [
        (draw(st.integers(0, child - 1)), child, draw(st.booleans())) for child in range(1, count)
    ]
    return draw(st.permutations(ends))


@settings(deadline=None, max_examples=50)
@given(trees())
def test_mujoco_order_of_random_tree(tmp_path_factory, ends):
    text = "<robot name='r'>" + "".join(f"<link name='l{k}'/>" for k in range(len(ends) + 1))
    for parent, child, fixed in ends:
        text += (
            f"<joint name='j{child}' type='{'fixed' if fixed else 'continuous'}'>"
            f"<parent link='l{parent}'/><child link='l{child}'/><axis xyz='0 0 1'/></joint>"
        )
    path = tmp_path_factory.getbasetemp() / "any.urdf"
    path.write_text(text + "</robot>")
    check(path, compile_urdf(path.read_text()))


def test_simulator_orders_without_links(tmp_path):
    path = Path(tmp_path / "robot.urdf")
    path.write_text('<robot name="r"/>')
    assert all(
        order.joints == order.bodies == () for order in Facts(load_robot(path)).simulator_orders
    )


def test_simulator_orders_of_broken_tree_are_uncertain(urdf):
    facts = urdf("ja: b > a", "jc: b > c", "jd: a > c")
    assert not any(order.certain for order in facts.simulator_orders)

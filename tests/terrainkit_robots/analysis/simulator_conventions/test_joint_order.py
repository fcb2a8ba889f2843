import re
from itertools import pairwise

import mujoco
import pytest

from terrainkit_robots.analysis.simulator_conventions.joint_order import order_table
from terrainkit_robots.description import bundled
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from tests.small_robots import facts, floating, mjcf, tree_text
from tests.tables import read_table

GEOM = '<geom size="0.1" mass="1"/>'


def urdf(*joints):
    return facts(tree_text(*joints))


def orders(robot):
    return {order.simulator: order for order in robot.simulator_orders}


def joints(robot):
    return {name: " ".join(order.joints) for name, order in orders(robot).items()}


def bodies(robot):
    return {name: " ".join(order.bodies) for name, order in orders(robot).items()}


def certain(robot):
    return [name for name, order in orders(robot).items() if order.certain]


# By hand. b is the parent of c, a and F; F of x3, x1 and G; G of y1.

TREE = ["jc: b > c", "jz: a > z", "jF!: b > F", "jx3: F > x3", "jG!: F > G", "jx1: F > x1"]
TREE += ["jy1: G > y1", "ja: b > a", "jk: c > k"]


def test_simulator_orders_by_hand():
    robot = urdf(*TREE)
    assert " ".join(robot.file_order) == "jc jz jx3 jx1 jy1 ja jk"
    assert joints(robot) == {
        "MuJoCo": "jc jk jx3 jy1 jx1 ja jz",  # the child of G replaces G, before x1
        "Isaac Gym": "ja jz jc jk jx1 jx3 jy1",
        "Isaac Lab": "ja jc jx1 jx3 jy1 jz jk",
        "Genesis": "jc jk jx3 jx1 jy1 ja jz",  # as genesis-world 1.4.5 lists this tree
        "PyBullet": "jc jk jx3 jy1 jx1 ja jz",  # as pybullet 3.2.7 lists this tree
    }
    assert bodies(robot) == {
        "MuJoCo": "b c k x3 y1 x1 a z",
        "Isaac Gym": "b a z c k x1 x3 y1",
        "Isaac Lab": "b a c x1 x3 y1 z k",
        "Genesis": "b c k x3 x1 y1 a z",
        "PyBullet": "b c k F x3 G y1 x1 a z",
    }
    assert certain(robot) == ["MuJoCo", "Genesis", "PyBullet"]
    keys = [order.key for order in robot.simulator_orders]
    assert keys == ["mujoco", "isaac_gym", "isaac_lab", "genesis", "pybullet"]
    reasons = {name: order.reason for name, order in orders(robot).items()}
    assert reasons["MuJoCo"] == "depth first, siblings in the order of their joints in the file"
    assert reasons["Isaac Lab"].endswith("up to Isaac Sim 5.1; compare with robot.joint_names")
    assert "siblings by the name of the joint, as in the lists published" in reasons["Isaac Gym"]


def test_kept_link_is_a_body():
    assert bodies(urdf("jb: b > a", "jF!*: a > F", "jc: F > c")) == {
        "MuJoCo": "b a c",
        "Isaac Gym": "b a F c",
        "Isaac Lab": "b a F c",
        "Genesis": "b a c",
        "PyBullet": "b a F c",
    }


@pytest.mark.parametrize(
    ("tree", "gym", "lab", "uncertain"),
    read_table(__file__, "orders_are_certain_if_all_variants_agree"),
)
def test_orders_are_certain_if_all_variants_agree(tree, gym, lab, uncertain):
    robot = urdf(*tree.split(", "))
    assert (joints(robot)["Isaac Gym"], joints(robot)["Isaac Lab"]) == (gym, lab)
    assert [name for name, order in orders(robot).items() if not order.certain] == uncertain


def test_orders_with_an_unknown_type_of_joint_are_uncertain():
    robot = facts(tree_text("ja: b > a").replace('"revolute"', '"hinge"'))
    assert {order.reason for order in robot.simulator_orders} == {"a joint has an unknown type"}
    assert certain(robot) == []


def test_simulator_orders_of_mjcf():
    robot = mjcf(
        f'<body name="b"><freejoint/>{GEOM}'
        f'<body name="z"><joint name="jz"/>{GEOM}'
        f'<body name="fixed">{GEOM}<body name="y"><joint name="jy"/>{GEOM}</body></body></body>'
        f'<body name="a"><joint name="ja"/>{GEOM}</body></body>'
    )
    assert joints(robot) == {
        "MuJoCo": "jz jy ja",
        "Isaac Gym": "jz jy ja",
        "Isaac Lab": "jz ja jy",
        "Genesis": "jz jy ja",
    }
    assert bodies(robot)["MuJoCo"] == "b z fixed y a"
    assert certain(robot) == ["MuJoCo", "Genesis"]
    assert "siblings as in the file; compare" in orders(robot)["Isaac Lab"].reason


def test_simulator_orders_of_multi_joint_bodies():
    two = '<joint name="j1" axis="1 0 0"/><joint name="j2"/>'
    robot = mjcf(f'<body name="b"><freejoint/>{GEOM}<body name="a">{two}{GEOM}</body></body>')
    assert (joints(robot)["MuJoCo"], bodies(robot)["MuJoCo"]) == ("j1 j2", "b a")
    assert certain(robot) == ["MuJoCo", "Genesis"]


def test_simulator_orders_without_links():
    assert {(o.joints, o.bodies) for o in facts("").simulator_orders} == {((), ())}


# Published orders. The file of A1 lists its legs in another order, with FR first.


def test_isaac_orders_match_published_lists_of_a1():
    parts = ("hip", "thigh", "calf")
    tree = []
    for leg in ("FR", "FL", "RR", "RL"):
        links = ["trunk", *(f"{leg}_{part}" for part in parts)]
        tree += [f"{child}_joint: {parent} > {child}" for parent, child in pairwise(links)]
    robot = urdf(*tree)
    legs = ("FL", "FR", "RL", "RR")
    assert orders(robot)["Isaac Gym"].joints == tuple(
        f"{leg}_{part}_joint" for leg in legs for part in parts
    )
    assert orders(robot)["Isaac Lab"].joints == tuple(
        f"{leg}_{part}_joint" for part in parts for leg in legs
    )
    assert certain(robot) == ["MuJoCo", "Genesis", "PyBullet"]


def check(robot, model):
    moving = [int(kind) for kind in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)]
    joints = [model.joint(i).name for i in range(model.njnt) if model.jnt_type[i] in moving]
    order = orders(robot)["MuJoCo"]
    assert list(order.joints) == joints
    assert list(order.bodies) == [model.body(i).name for i in range(1, model.nbody)]
    assert order.certain


def check_urdf(text):
    text = re.sub("<mujoco>.*?</mujoco>", "", text, flags=re.DOTALL)
    robot = facts(text)
    check(robot, mujoco.MjModel.from_xml_string(floating(text, robot.bodies[0].top.name)))


def test_mujoco_order_of_a_tree():
    check_urdf(tree_text(*TREE))
    check_urdf(tree_text("j1: a > b", "j2!: a > c", "j3: c > d", "j4!: c > e", "j5: e > f"))


@pytest.mark.parametrize("name", ["quadruped", "biped"])
def test_mujoco_order_of_bundled_robot(name):
    path = bundled.urdf_path(name)
    check_urdf(path.read_text())
    model = path.with_suffix(".xml")
    with quiet_mujoco():
        check(facts(model.read_text()), mujoco.MjModel.from_xml_path(str(model)))


def test_order_table_has_a_row_for_each_joint():
    robot = facts(tree_text("jc: b > c", "ja: b > a", "jk: c > k"))
    assert order_table(robot.file_order, robot.simulator_orders) == (
        ("joint", "file", "MuJoCo", "Isaac Gym", "Isaac Lab", "Genesis", "PyBullet"),
        ("jc", "0", "0", "1", "1", "0", "0"),
        ("ja", "1", "2", "0", "0", "2", "2"),
        ("jk", "2", "1", "2", "2", "1", "1"),
        ("", "", "certain", "to be verified", "to be verified", "certain", "certain"),
    )

import mujoco
import numpy as np
import pytest
import yourdfpy

from terrainkit_robots.analysis.bodies.kinematics import ancestors, body_poses, joint_axis
from terrainkit_robots.analysis.bodies.link_poses import link_poses, random_positions
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from tests.robots import ROBOTS
from tests.small_robots import facts, joint, link

COUNT = 5
TRUNK = link("a") + link("b") + joint("a", "b", "0 0 1", "0 0 1", "continuous") + link("c")


def bodies(slide="", axis="2 0 0"):
    """Return a trunk, a turning body 1 m above it, and one that slides along an axis."""
    return facts(TRUNK, joint("b", "c", "2 0 0", axis, "prismatic", more=slide)).bodies


def place(*xyz):
    pose = np.eye(4)
    pose[:3, 3] = xyz
    return pose


def test_body_poses_of_hinge_and_slide():
    arm = bodies()
    trunk, turned, slid = body_poses(arm, {"b_joint": np.pi / 2, "c_joint": 0.5})
    np.testing.assert_array_equal(trunk, np.eye(4))
    np.testing.assert_allclose(turned[:3, 3], [0, 0, 1])
    np.testing.assert_allclose(turned[:3, 0], [0, 1, 0], atol=1e-15)
    # The axis is not of unit length, but the joint still moves half a meter.
    np.testing.assert_allclose(slid[:3, 3], [0, 2.5, 1], atol=1e-15)
    point, axis = joint_axis(arm[2], slid)
    np.testing.assert_allclose([point, axis], [[0, 2.5, 1], [0, 1, 0]], atol=1e-15)
    for positions in ({}, {"x": 1.0}, {"b_joint": 0.0, "c_joint": 0.0}):
        np.testing.assert_array_equal(body_poses(arm, positions)[2], place(2, 0, 1))


def test_body_poses_include_mimic_joints():
    arm = bodies('<mimic joint="b_joint" multiplier="2" offset="0.1"/>')
    turned = body_poses(arm, {"b_joint": 0.5, "c_joint": 77.0})[2]
    expected = [3.1 * np.cos(0.5), 3.1 * np.sin(0.5), 1]  # 2 + 2 * 0.5 + 0.1
    np.testing.assert_allclose(turned[:3, 3], expected, atol=1e-12)
    np.testing.assert_allclose(body_poses(arm, {})[2], place(2.1, 0, 1))


def test_body_poses_broadcast_positions():
    arm, turns, slides = bodies(), np.linspace(-3, 3, 5), np.linspace(0, 1, 5)
    many = body_poses(arm, {"b_joint": turns, "c_joint": slides})[2]
    assert many.shape == (5, 4, 4)
    for pose, turn, slide in zip(many, turns, slides, strict=True):
        one = body_poses(arm, {"b_joint": turn, "c_joint": slide})[2]
        np.testing.assert_allclose(pose, one, atol=1e-15)


def test_kinematics_of_a_long_chain():
    count = 3_000
    chain = [joint(f"l{k - 1}", f"l{k}", "0 0 0.001") for k in range(1, count)]
    long = facts(*(link(f"l{k}", mass=None) for k in range(count)), *chain).bodies
    assert body_poses(long, {})[-1][2, 3] == pytest.approx(0.001 * (count - 1))
    assert ancestors(long, count - 1) == list(range(1, count))
    assert ancestors(bodies(), 0) == []


def test_joint_turns_about_its_anchor_from_its_reference():
    arm = facts(
        '<mujoco><compiler angle="radian"/><worldbody><body name="a"><body name="b" pos="1 0 0">'
        '<joint name="j" axis="0 0 1" pos="-1 0 0" ref="0.5"/><geom size="1"/></body></body>'
        "</worldbody></mujoco>"
    ).bodies
    np.testing.assert_allclose(body_poses(arm, {"j": 0.5})[1], place(1, 0, 0), atol=1e-15)
    # After a quarter turn it has rotated about its anchor, the origin of a.
    swung = body_poses(arm, {"j": 0.5 + np.pi / 2})[1]
    np.testing.assert_allclose(swung[:3, 3], [0, 1, 0], atol=1e-15)


# Compared with MuJoCo


def body(name, inner, attributes=""):
    geom = f'<geom name="{name}" size="0.1" mass="1"/>'
    return f'<body name="{name}" {attributes}>{geom}{inner}</body>'


HAND_MADE = {
    "a slide with a reference": body(
        "b",
        '<joint name="j" type="slide" axis="1 2 0" pos="1 0 0" ref="0.3"/>',
        'pos="1 0 0" euler="10 20 30"',
    ),
    "three joints in one body": body(
        "b",
        '<joint name="x" axis="1 0 0" pos="0 0.1 0"/>'
        '<joint name="y" axis="0 1 0" pos="0 0 0.1" ref="15"/>'
        '<joint name="s" type="slide" axis="0 0 1"/>'
        + body("c", '<joint name="z" axis="0 0 1"/>', 'pos="0 0 1"'),
        'pos="1 0 0" axisangle="1 1 0 50"',
    ),
    "a trunk that floats and is turned": "<freejoint/>"
    + body("b", '<joint name="j" axis="0 3 4"/>', 'xyaxes="0 1 0 -1 0 0"'),
    "bodies that are fixed between joints": body(
        "b",
        body("c", '<joint name="j" axis="1 1 1" pos="0 1 0"/>', 'pos="0 0 1" euler="90 0 0"'),
        'pos="0 1 0" euler="0 45 0"',
    ),
    "a ball joint": body(
        "b",
        '<joint name="j" axis="0 0 1"/>'
        + body("c", '<joint name="k" type="ball"/>', 'pos="0 0 1"'),
        'pos="0 1 0"',
    ),
}


def assert_same_in_mujoco(robot, model):
    """Compare every link, relative to the trunk, at random positions."""
    data = mujoco.MjData(model)
    ranges = {each.name: each.range or (-3.0, 3.0) for each in robot.joints}
    positions = random_positions(ranges, robot.joints, count=COUNT, seed=0)
    ours = link_poses(robot.bodies, positions, count=COUNT)
    names = [each.name for each in robot.model.links if not each.virtual]
    assert len(names) == model.nbody - 1
    for k in range(COUNT):
        for name, values in positions.items():
            data.joint(name).qpos = values[k]
        mujoco.mj_kinematics(model, data)
        theirs = np.tile(np.eye(4), (model.nbody, 1, 1))
        theirs[:, :3, :3], theirs[:, :3, 3] = data.xmat.reshape(-1, 3, 3), data.xpos
        trunk = theirs[1 + names.index(robot.bodies[0].top.name)]
        for name, expected in zip(names, theirs[1:], strict=True):
            np.testing.assert_allclose(trunk @ ours[name][k], expected, atol=1e-9, err_msg=name)


@pytest.mark.parametrize("name", bundled.robot_names())
def test_body_poses_match_mujoco(name):
    path = bundled.urdf_path(name).with_suffix(".xml")
    assert_same_in_mujoco(Facts(load_robot(path)), mujoco.MjModel.from_xml_path(str(path)))


@pytest.mark.parametrize("inner", HAND_MADE.values(), ids=HAND_MADE)
@pytest.mark.parametrize("angle", ["degree", "radian"])
def test_body_poses_with_anchor_match_mujoco(inner, angle):
    trunk = body("a", inner, 'pos="1 2 3" quat="1 2 3 4"')
    text = f'<mujoco><compiler angle="{angle}"/><worldbody>{trunk}</worldbody></mujoco>'
    assert_same_in_mujoco(facts(text), mujoco.MjModel.from_xml_string(text))


def test_random_positions_follow_mimics():
    follows = '<mimic joint="b_joint" multiplier="2" offset="0.1"/>'
    joints = [each.joint for each in bodies(follows)[1:]]
    positions = random_positions({"b_joint": (0.1, 0.4)}, joints, count=20, seed=0)
    turns = np.random.default_rng(0).uniform(0.1, 0.4, 20)
    np.testing.assert_array_equal(positions["b_joint"], turns)
    np.testing.assert_allclose(positions["c_joint"], 2 * turns + 0.1)


def test_link_poses_of_other_joints_are_at_zero():
    poses = link_poses(bodies(), {}, count=3)
    expected = {"a": place(0, 0, 0), "b": place(0, 0, 1), "c": place(2, 0, 1)}
    assert list(poses) == list(expected)
    for name, pose in expected.items():
        np.testing.assert_array_equal(poses[name], [pose] * 3)


# Compared with yourdfpy


@pytest.mark.parametrize("name", [name for name in ROBOTS if name.endswith(".urdf")])
def test_link_poses_match_yourdfpy(robot_file, name):
    path = robot_file(name)
    robot = Facts(load_robot(path))
    model = yourdfpy.URDF.load(str(path), load_meshes=False)
    ranges = {each.name: each.range or (-3.0, 3.0) for each in robot.joints}
    positions = random_positions(ranges, robot.joints, count=COUNT, seed=0)
    ours = link_poses(robot.bodies, positions, count=COUNT)
    top = robot.bodies[0].top.name
    for k in range(COUNT):
        model.update_cfg({each: values[k] for each, values in positions.items()})
        for link_name, poses in ours.items():
            expected = model.get_transform(link_name, top)
            np.testing.assert_allclose(poses[k], expected, atol=1e-9, err_msg=link_name)

import warnings
from pathlib import Path

import mujoco
import numpy as np
import pytest

from terrainkit_robots.analysis.bodies.kinematics import ancestors, body_poses, joint_axis
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from tests.robots import BUNDLED

URDFS = [
    "a1/urdf/a1.urdf",
    "go2/urdf/go2.urdf",
    "h1/urdf/h1.urdf",
    "g1/g1_29dof.urdf",
    "anymal_c/urdf/anymal_c.urdf",
    "cassie/urdf/cassie.urdf",
    *(name for name in BUNDLED if name.endswith(".urdf")),
]
MJCFS = [
    "go2_mjcf/go2.xml",
    "h1/h1.xml",
    "g1/g1_29dof.xml",
    *(name for name in BUNDLED if name.endswith(".xml")),
]


def facts(text, name="robot.urdf"):
    file = Path("/robots") / name
    return Facts(load_robot(file, contents={file: text.encode()}))


def random_positions(joints, rng):
    """Return random positions within the limits, or within half a turn without limits."""
    positions = {}
    for joint in joints:
        limit = joint.limit
        lower, upper = (-np.pi, np.pi) if limit is None else (limit.lower, limit.upper)
        if lower is None or upper is None or not lower < upper:
            lower, upper = -np.pi, np.pi
        positions[joint.name] = rng.uniform(lower, upper)
    return positions


def at(*place):
    pose = np.eye(4)
    pose[:3, 3] = place
    return pose


# By hand

ARM = """
<robot name="arm">
  <link name="a"/><link name="b"/><link name="c"/>
  <joint name="turn" type="continuous">
    <parent link="a"/><child link="b"/><origin xyz="0 0 1"/><axis xyz="0 0 1"/>
  </joint>
  <joint name="slide" type="prismatic">
    <parent link="b"/><child link="c"/><origin xyz="2 0 0"/><axis xyz="2 0 0"/>
  </joint>
</robot>
"""


def test_body_poses_of_hinge_and_slide():
    trunk, turned, slid = body_poses(facts(ARM).bodies, {"turn": np.pi / 2, "slide": 0.5})
    np.testing.assert_array_equal(trunk, np.eye(4))
    np.testing.assert_allclose(turned[:3, 3], [0, 0, 1])
    np.testing.assert_allclose(turned[:3, 0], [0, 1, 0], atol=1e-15)
    # The axis is not of unit length, but the joint still moves half a meter.
    np.testing.assert_allclose(slid[:3, 3], [0, 2.5, 1], atol=1e-15)


def test_body_poses_default_to_zero_positions():
    bodies = facts(ARM).bodies
    for ours, zero in zip(
        body_poses(bodies, {}), body_poses(bodies, {"turn": 0.0, "slide": 0.0}), strict=True
    ):
        np.testing.assert_array_equal(ours, zero)
    np.testing.assert_allclose(body_poses(bodies, {})[2], at(2, 0, 1))


def test_body_poses_include_mimic_joints():
    follows = '<mimic joint="turn" multiplier="2" offset="0.1"/><axis xyz="2 0 0"/>'
    bodies = facts(ARM.replace('<axis xyz="2 0 0"/>', follows)).bodies
    turned = body_poses(bodies, {"turn": 0.5, "slide": 77.0})[2]
    reach = 2 + 2 * 0.5 + 0.1
    np.testing.assert_allclose(
        turned[:3, 3], [reach * np.cos(0.5), reach * np.sin(0.5), 1], atol=1e-12
    )
    np.testing.assert_allclose(body_poses(bodies, {})[2], at(2.1, 0, 1))


def test_body_poses_broadcast_positions():
    bodies = facts(ARM).bodies
    turns, slides = np.linspace(-3, 3, 5), np.linspace(0, 1, 5)
    many = body_poses(bodies, {"turn": turns, "slide": slides})[2]
    assert many.shape == (5, 4, 4)
    for pose, turn, slide in zip(many, turns, slides, strict=True):
        one = body_poses(bodies, {"turn": float(turn), "slide": float(slide)})[2]
        np.testing.assert_allclose(pose, one, atol=1e-15)


def test_body_poses_ignore_unknown_names():
    np.testing.assert_allclose(body_poses(facts(ARM).bodies, {"x": 1.0})[2], at(2, 0, 1))


def test_body_poses_default_axis_is_x():
    bodies = facts(ARM.replace('<axis xyz="0 0 1"/>', "")).bodies
    np.testing.assert_allclose(
        body_poses(bodies, {"turn": np.pi / 2})[1][:3, 1], [0, 0, 1], atol=1e-15
    )


def test_joint_axis_of_moved_body():
    bodies = facts(ARM).bodies
    poses = body_poses(bodies, {"turn": np.pi / 2, "slide": 0.5})
    point, axis = joint_axis(bodies[2], poses[2])
    np.testing.assert_allclose(point, [0, 2.5, 1], atol=1e-15)
    np.testing.assert_allclose(axis, [0, 1, 0], atol=1e-15)


def test_ancestors_lead_from_trunk_to_body():
    bodies = facts(ARM).bodies
    assert [ancestors(bodies, k) for k in range(3)] == [[], [1], [1, 2]]


def test_body_poses_of_long_chain():
    count = 3_000
    links = "".join(f'<link name="l{k}"/>' for k in range(count))
    joints = "".join(
        f'<joint name="j{k}" type="continuous"><parent link="l{k - 1}"/><child link="l{k}"/>'
        '<origin xyz="0 0 0.001"/></joint>'
        for k in range(1, count)
    )
    bodies = facts(f'<robot name="r">{links}{joints}</robot>').bodies
    assert body_poses(bodies, {})[-1][2, 3] == pytest.approx(0.001 * (count - 1))
    assert len(ancestors(bodies, count - 1)) == count - 1


# Compared with yourdfpy


@pytest.mark.parametrize("name", URDFS)
def test_body_poses_match_yourdfpy(name, robot_file):
    yourdfpy = pytest.importorskip("yourdfpy")
    path = robot_file(name)
    robot = Facts(load_robot(path))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        other = yourdfpy.URDF.load(path, load_meshes=False, build_scene_graph=True)
    rng = np.random.default_rng(0)
    for _ in range(5):
        positions = random_positions(robot.joints, rng)
        other.update_cfg(positions)
        poses = body_poses(robot.bodies, positions)
        for body, pose in zip(robot.bodies, poses, strict=True):
            for link, local in zip(body.links, body.poses, strict=True):
                expected = other.get_transform(link.name, robot.bodies[0].top.name)
                np.testing.assert_allclose(pose @ local, expected, atol=1e-9, err_msg=link.name)


# Compared with MuJoCo


def same_as_mujoco(robot, model, rng):
    """Compare every body, relative to the trunk, at random positions."""
    data = mujoco.MjData(model)
    positions = random_positions(robot.joints, rng)
    for joint, position in positions.items():
        data.joint(joint).qpos = position
    mujoco.mj_kinematics(model, data)

    def place(name):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = data.body(name).xmat.reshape(3, 3), data.body(name).xpos
        return pose

    trunk = np.linalg.inv(place(robot.bodies[0].top.name))
    compared = 0
    for body, pose in zip(robot.bodies, body_poses(robot.bodies, positions), strict=True):
        for link, local in zip(body.links, body.poses, strict=True):
            if not link.virtual:
                expected = trunk @ place(link.name)
                np.testing.assert_allclose(pose @ local, expected, atol=1e-9, err_msg=link.name)
                compared += 1
    return compared


def without_meshes(path):
    """Compile a file without its meshes, which are not needed and may be missing."""
    spec = mujoco.MjSpec.from_file(str(path))
    for geom in [g for g in spec.geoms if g.type == mujoco.mjtGeom.mjGEOM_MESH]:
        spec.delete(geom)
    for mesh in list(spec.meshes):
        spec.delete(mesh)
    return spec.compile()


@pytest.mark.parametrize("name", MJCFS)
def test_body_poses_match_mujoco(name, robot_file):
    path = robot_file(name)
    robot, model = Facts(load_robot(path)), without_meshes(path)
    rng = np.random.default_rng(0)
    for _ in range(5):
        assert same_as_mujoco(robot, model, rng) >= 11


def body(name, inner, attributes=""):
    return (
        f'<body name="{name}" {attributes}><geom name="{name}" size="0.1" mass="1"/>{inner}</body>'
    )


HAND_MADE = {
    "an anchor beside the origin": body(
        "a",
        body("b", '<joint name="j" axis="0 1 0" pos="0.1 0.2 -0.3"/>', 'pos="1 2 3"'),
    ),
    "a reference that is not zero": body(
        "a",
        body("b", '<joint name="j" axis="0 1 0" pos="0.1 0 0" ref="40"/>', 'pos="1 0 0"'),
    ),
    "a slide with a reference": body(
        "a",
        body(
            "b",
            '<joint name="j" type="slide" axis="1 2 0" pos="1 0 0" ref="0.3"/>',
            'pos="1 0 0" euler="10 20 30"',
        ),
    ),
    "three joints in one body": body(
        "a",
        body(
            "b",
            '<joint name="x" axis="1 0 0" pos="0 0.1 0"/>'
            '<joint name="y" axis="0 1 0" pos="0 0 0.1" ref="15"/>'
            '<joint name="s" type="slide" axis="0 0 1"/>'
            + body("c", '<joint name="z" axis="0 0 1"/>', 'pos="0 0 1"'),
            'pos="1 0 0" axisangle="1 1 0 50"',
        ),
    ),
    "a trunk that floats and is turned": body(
        "a",
        "<freejoint/>" + body("b", '<joint name="j" axis="0 3 4"/>', 'xyaxes="0 1 0 -1 0 0"'),
        'pos="1 2 3" quat="1 2 3 4"',
    ),
    "bodies that are fixed between joints": body(
        "a",
        body(
            "b",
            body("c", '<joint name="j" axis="1 1 1" pos="0 1 0"/>', 'pos="0 0 1" euler="90 0 0"'),
            'pos="0 1 0" euler="0 45 0"',
        ),
    ),
    "frames around bodies": body(
        "a",
        '<frame pos="1 0 0" euler="0 0 90"><frame euler="30 0 0">'
        + body("b", '<joint name="j" axis="0 1 0" pos="0.1 0 0"/>', 'pos="0 2 0"')
        + "</frame></frame>",
    ),
    "an axis that is not of unit length": body(
        "a", body("b", '<joint name="j" type="slide" axis="0 0 5"/>', 'pos="0 0 1"')
    ),
}


@pytest.mark.parametrize("inner", HAND_MADE.values(), ids=HAND_MADE)
@pytest.mark.parametrize("angle", ["degree", "radian"])
def test_body_poses_with_anchor_match_mujoco(inner, angle):
    text = f'<mujoco model="m"><compiler angle="{angle}"/><worldbody>{inner}</worldbody></mujoco>'
    robot, model = facts(text, "robot.xml"), mujoco.MjModel.from_xml_string(text)
    assert len(robot.joints) == model.njnt - text.count("freejoint")
    rng = np.random.default_rng(0)
    for _ in range(3):
        assert same_as_mujoco(robot, model, rng) == model.nbody - 1


def test_body_poses_at_reference_equal_origin():
    text = (
        '<mujoco><compiler angle="radian"/><worldbody><body name="a"><body name="b" pos="1 0 0">'
        '<joint name="j" axis="0 0 1" pos="-1 0 0" ref="0.5"/><geom size="1"/></body></body>'
        "</worldbody></mujoco>"
    )
    bodies = facts(text, "robot.xml").bodies
    np.testing.assert_allclose(body_poses(bodies, {"j": 0.5})[1], at(1, 0, 0), atol=1e-15)
    # After a quarter turn it has rotated about its anchor, the origin of a.
    swung = body_poses(bodies, {"j": 0.5 + np.pi / 2})[1]
    np.testing.assert_allclose(swung[:3, 3], [0, 1, 0], atol=1e-15)

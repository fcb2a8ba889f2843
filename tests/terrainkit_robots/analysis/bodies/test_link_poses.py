"""Link poses are compared with MuJoCo's kinematics of the same file."""

import mujoco
import numpy as np
import pytest

from terrainkit_robots.analysis.bodies.link_poses import link_poses, random_positions
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from tests.robots import BUNDLED, REAL_ROBOTS

COUNT = 5

REFERENCE = """<mujoco><compiler angle="radian"/><worldbody><body name="a"><freejoint/>
  <geom size="0.1"/><body name="b" pos="1 0 0"><geom size="0.1"/>
    <joint name="turn" axis="0 0 1" pos="0.1 0 0" ref="0.5"/>
    <body name="c" pos="0 1 0"><geom size="0.1"/>
      <joint name="slide" type="slide" axis="1 0 0" ref="0.2"/>
      <body name="d" pos="0 0 1"><geom size="0.1"/><joint name="spin" type="ball"/></body>
    </body></body></body></worldbody></mujoco>"""

UNNAMED = """<mujoco><worldbody><body><freejoint/><geom size="0.1"/>
  <body pos="0 1 0"><joint axis="1 0 0"/><geom size="0.1"/>
    <body name="b" pos="0.1 0 0"><joint name="j" axis="0 0 1"/><geom size="0.1"/></body>
  </body></body></worldbody></mujoco>"""


def compile_without_meshes(file):
    spec = mujoco.MjSpec.from_file(str(file))
    for geom in [geom for geom in spec.geoms if geom.meshname]:
        spec.delete(geom)
    for mesh in list(spec.meshes):
        spec.delete(mesh)
    with quiet_mujoco():
        return spec.compile()


def assert_poses_match(file):
    robot, model = Facts(load_robot(file)), compile_without_meshes(file)
    ranges = {joint.name: joint.range or (-3.0, 3.0) for joint in robot.joints}
    positions = random_positions(ranges, robot.joints, count=COUNT, seed=1)
    ours = link_poses(robot.bodies, positions, count=COUNT)
    names = [link.name for link in robot.model.links if not link.virtual]
    joints = [joint for joint in robot.model.joints if joint.kind != "fixed"]
    assert (model.nbody, model.njnt) == (len(names) + 1, len(joints))
    data = mujoco.MjData(model)
    for k in range(COUNT):
        for index, joint in enumerate(joints):
            if joint.moves:
                data.qpos[model.jnt_qposadr[index]] = positions[joint.name][k]
        mujoco.mj_kinematics(model, data)
        theirs = np.tile(np.eye(4), (model.nbody, 1, 1))
        theirs[:, :3, :3] = data.xmat.reshape(-1, 3, 3)
        theirs[:, :3, 3] = data.xpos
        top = theirs[1 + names.index(robot.bodies[0].top.name)]
        for name, poses in ours.items():
            if name in names:
                expected = theirs[1 + names.index(name)]
                np.testing.assert_allclose(top @ poses[k], expected, atol=1e-9)


@pytest.mark.parametrize(
    "name", [name for name in (*BUNDLED, *REAL_ROBOTS) if name.endswith(".xml")]
)
def test_link_poses_match_mujoco(robot_file, name):
    assert_poses_match(robot_file(name))


@pytest.mark.parametrize("text", [REFERENCE, UNNAMED])
def test_link_poses_with_reference_and_without_names(tmp_path, text):
    file = tmp_path / "robot.xml"
    file.write_text(text)
    assert_poses_match(file)


def test_other_joints_are_at_zero(tmp_path):
    file = tmp_path / "robot.xml"
    file.write_text(REFERENCE)
    robot = Facts(load_robot(file))
    zero = {"turn": np.zeros(3), "slide": np.zeros(3)}
    expected = link_poses(robot.bodies, zero, count=3)
    for name, poses in link_poses(robot.bodies, {}, count=3).items():
        np.testing.assert_allclose(poses, expected[name])


def test_random_positions_follow_mimics(tmp_path):
    file = tmp_path / "robot.xml"
    mimic = '<equality><joint joint1="turn" joint2="slide" polycoef="0 2"/></equality>'
    file.write_text(REFERENCE.replace("</mujoco>", f"{mimic}</mujoco>"))
    joints = Facts(load_robot(file)).joints
    positions = random_positions({"slide": (0.1, 0.4)}, joints, count=20, seed=0)
    assert positions["slide"].min() >= 0.1
    assert positions["slide"].max() <= 0.4
    np.testing.assert_allclose(positions["turn"] - 0.5, 2 * (positions["slide"] - 0.2))

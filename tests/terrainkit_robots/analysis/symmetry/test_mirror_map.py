import numpy as np
import pytest

from terrainkit_robots.analysis.bodies.kinematics import body_poses
from terrainkit_robots.spec.robot_spec import MirrorJoint

WAIST = """
<robot name="r">
  <link name="base"><inertial><mass value="1"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  {links}
</robot>"""
LINK = """
  <link name="{name}_link"><inertial><mass value="1"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="{name}" type="{kind}"><parent link="base"/><child link="{name}_link"/>
    <origin xyz="0 {y} 0.5"/><axis xyz="{axis}"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>"""


def waist(robot, axis, kind="revolute", y=0):
    return robot(WAIST.format(links=LINK.format(name="w", kind=kind, axis=axis, y=y))).mirror_map


@pytest.mark.parametrize(
    ("axis", "kind", "sign"),
    [
        ("0 0 1", "revolute", -1),
        ("1 0 0", "revolute", -1),
        ("0 1 0", "revolute", 1),
        ("0 -1 0", "revolute", 1),
        ("0 0 1", "prismatic", 1),
        ("0 1 0", "prismatic", -1),
    ],
)
def test_mirror_map_of_joint_in_the_plane(robot, axis, kind, sign):
    assert waist(robot, axis, kind) == {"w": MirrorJoint(joint="w", sign=sign)}


def test_mirror_map_excludes_single_arm(robot):
    assert waist(robot, "0 1 0", y=0.3) == {}


def test_mirror_map_excludes_skewed_axis(robot):
    assert waist(robot, "0 1 1") == {}


@pytest.mark.parametrize("name", ["quadruped.urdf", "biped.urdf", "biped.xml"])
def test_mirror_map_gives_mirrored_poses(bundled, name):
    facts = bundled(name)
    twins = facts.mirror_map
    assert list(twins) == [joint.name for joint in facts.actuated]
    random = np.random.default_rng(0)
    positions = {name: float(random.uniform(-1, 1)) for name in twins}
    mirrored = {twin.joint: twin.sign * positions[name] for name, twin in twins.items()}
    here, there = (body_poses(facts.bodies, p) for p in (positions, mirrored))
    flip = np.diag([1.0, -1.0, 1.0])
    for pair in facts.mirror.pairs:
        for one, other in ((pair.left, pair.right), (pair.right, pair.left)):
            np.testing.assert_allclose(flip @ here[one][:3, 3], there[other][:3, 3], atol=1e-3)


def test_mirror_map_excludes_unactuated_joints(robot):
    links = "".join(
        LINK.format(name=n, kind="revolute", axis="0 1 0", y=y)
        for n, y in (("left", 0.3), ("right", -0.3))
    )
    text = WAIST.format(links=links)
    assert set(robot(text).mirror_map) == {"left", "right"}
    followed = text.replace('velocity="1"/></joint>', 'velocity="1"/><mimic joint="left"/></joint>')
    first = followed.index('<mimic joint="left"/>')
    followed = followed[:first] + followed[first + len('<mimic joint="left"/>') :]
    assert robot(followed).mirror_map == {}

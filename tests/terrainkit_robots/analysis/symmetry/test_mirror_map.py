import numpy as np
import pytest

from terrainkit_robots.analysis.bodies.kinematics import body_poses
from terrainkit_robots.spec.robot_spec import MirrorJoint
from tests.small_robots import facts, joint, link
from tests.tables import read_table


def mirror_map(*joints):
    """Return the mirror map of joints (child, y, axis, kind) on a trunk."""
    links = [link(name) for name in ("trunk", *(name for name, *_ in joints))]
    made = [joint("trunk", name, f"0 {y} 0.5", *rest) for name, y, *rest in joints]
    return facts(*links, *made).mirror_map


@pytest.mark.parametrize(
    ("axis", "kind", "y", "sign"),
    [
        *read_table(__file__, "joint_in_the_plane_mirrors_itself"),
        ("0 1 1", "revolute", 0, None),  # skewed
        ("0 1 0", "revolute", 0.0101, None),
        ("0 1 0", "revolute", -0.0101, None),
    ],
)
def test_joint_in_the_plane_mirrors_itself(axis, kind, y, sign):
    expected = {"w_joint": MirrorJoint(joint="w_joint", sign=sign)} if sign else {}
    assert mirror_map(("w", y, axis, kind)) == expected


def test_mirrored_joints_are_in_the_order_of_the_joints():
    found = mirror_map(("right", -0.3, "0 0 1"), ("left", 0.3, "0 0 1"), ("neck", 0, "0 0 1"))
    assert [(name, twin.joint, twin.sign) for name, twin in found.items()] == [
        ("right_joint", "left_joint", -1),
        ("left_joint", "right_joint", -1),
        ("neck_joint", "neck_joint", -1),
    ]


@pytest.mark.parametrize("name", ["quadruped.urdf", "biped.urdf", "biped.xml"])
def test_mirror_map_gives_mirrored_poses(bundled, name):
    robot = bundled(name)
    twins = robot.mirror_map
    assert list(twins) == [each.name for each in robot.actuated]
    random = np.random.default_rng(0)
    positions = {name: float(random.uniform(-1, 1)) for name in twins}
    mirrored = {twin.joint: twin.sign * positions[name] for name, twin in twins.items()}
    here, there = (body_poses(robot.bodies, p) for p in (positions, mirrored))
    flip = np.diag([1.0, -1.0, 1.0])
    for one, other in robot.mirror.image_index.items():
        np.testing.assert_allclose(flip @ here[one][:3, 3], there[other][:3, 3], atol=1e-3)


def test_mirror_map_excludes_unactuated_joints():
    links = [link(name) for name in ("trunk", "left", "right")]
    left = joint("trunk", "left", "0 0.3 0")
    right = joint("trunk", "right", "0 -0.3 0")
    assert list(facts(*links, left, right).mirror_map) == ["left_joint", "right_joint"]
    follows = joint("trunk", "right", "0 -0.3 0", more='<mimic joint="left_joint"/>')
    assert facts(*links, left, follows).mirror_map == {}

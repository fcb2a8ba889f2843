from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terrainkit_robots.analysis.bodies.kinematics import body_poses
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.symmetry.mirror import Mirror, swap_sides
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from tests.robots import BUNDLED

FILE = Path("/robots/robot.urdf")
PAIRS = {
    "a1/urdf/a1.urdf": 6,
    "go2/urdf/go2.urdf": 6,
    "go2_mjcf/go2.xml": 6,
    "h1/urdf/h1.urdf": 5,
    "h1/h1.xml": 5,
    "g1/g1_29dof.urdf": 13,
    "g1/g1_29dof.xml": 13,
    "anymal_c/urdf/anymal_c.urdf": 6,
    "cassie/urdf/cassie.urdf": 6,
    **dict.fromkeys(BUNDLED, 6),
}
every_robot = pytest.mark.parametrize("name", PAIRS)


def load(name, robot_file):
    return Facts(load_robot(robot_file(name)))


def facts(*joints):
    """Return a robot of joints (parent, child, xyz, axis, kind); the trunk is called `trunk`."""
    links = ["trunk", *(child for _, child, *_ in joints)]
    text = "".join(f'<link name="{name}"/>' for name in links)
    for number, (parent, child, xyz, axis, *kind) in enumerate(joints):
        text += (
            f'<joint name="j{number}" type="{kind[0] if kind else "continuous"}">'
            f'<parent link="{parent}"/><child link="{child}"/><origin xyz="{xyz}"/>'
            f'<axis xyz="{axis}"/></joint>'
        )
    return Facts(load_robot(FILE, contents={FILE: f'<robot name="r">{text}</robot>'.encode()}))


def pairs(robot):
    return [
        (robot.bodies[p.left].name, robot.bodies[p.right].name, p.sign) for p in robot.mirror.pairs
    ]


# Names


def test_link_of_a_chain_is_no_mirror_image():
    chain = facts(
        ("trunk", "link_s", "0 0.1 0.1", "0 0 1"),
        ("link_s", "link_l", "0 0.2 0.1", "0 1 0"),
        ("link_l", "link_u", "0 0 0.3", "0 1 0"),
        ("link_u", "link_r", "0 -0.1 0.1", "1 0 0"),
    )
    assert pairs(chain) == []


@pytest.mark.parametrize(
    ("kind", "sign"), [("continuous", 1), ("prismatic", 0), ("fixed", None), ("planar", 0)]
)
def test_joints_of_two_kinds_do_not_mirror_each_other(kind, sign):
    arms = facts(
        ("trunk", "left_arm", "0 0.2 0", "0 1 0"), ("trunk", "right_arm", "0 -0.2 0", "0 1 0", kind)
    )
    expected = [] if sign is None else [("left_arm", "right_arm", sign)]
    assert pairs(arms) == expected


def test_side_without_a_counterpart_has_no_mirror_image():
    one_arm = facts(
        ("trunk", "left_arm", "0 0.2 0", "0 1 0"), ("trunk", "neck", "0 0 0.3", "0 0 1")
    )
    assert pairs(one_arm) == []


def test_lone_letter_is_a_side_at_the_same_depth():
    arms = facts(
        ("trunk", "link_l", "0 0.1 0.1", "0 0 1"), ("trunk", "link_r", "0.1 -0.2 0.1", "0 0 1")
    )
    assert pairs(arms) == [("link_l", "link_r", -1)]
    chain = facts(
        ("trunk", "link_l", "0 0.1 0.1", "0 0 1"),
        ("trunk", "link_t", "0 0 0.3", "0 1 0"),
        ("link_t", "link_r", "0 -0.2 0.1", "1 0 0"),
    )
    assert pairs(chain) == []


@pytest.mark.parametrize(
    ("name", "other"),
    [
        ("left_knee", "right_knee"),
        ("LeftKnee", "RightKnee"),
        ("LEFT_KNEE", "RIGHT_KNEE"),
        ("knee_left", "knee_right"),
        ("FL_calf", "FR_calf"),
        ("RL_calf", "RR_calf"),
        ("LF_KFE", "RF_KFE"),
        ("LH_KFE", "RH_KFE"),
        ("lf_foot", "rf_foot"),
        ("hl.hx", "hr.hx"),
        ("l_knee", "r_knee"),
        ("knee_l", "knee_r"),
        ("leg_left_6_link", "leg_right_6_link"),
        ("L_hip", "R_hip"),
        ("FLHip", "FRHip"),
        ("LLeg_knee", "RLeg_knee"),
        ("fl1", "fr1"),
        ("left/hip", "right/hip"),
    ],
)
def test_swap_sides_exchanges_left_and_right(name, other):
    assert swap_sides(name) == other
    assert swap_sides(other) == name


@pytest.mark.parametrize(
    "name",
    [
        "trunk",
        "",
        "calf",
        "roll",
        "pelvis",
        "leftover",
        "upright",
        "bright",
        "link_3",
        "shelf",
        "4",
    ],
)
def test_swap_sides_keeps_names_without_side(name):
    assert swap_sides(name) == name


@given(st.text(max_size=20))
def test_swap_sides_is_an_involution(name):
    assert swap_sides(swap_sides(name)) == name


# Planes


def test_image_of_vectors():
    mirror = Mirror(normal=np.array([0.0, 1.0, 0.0]), pairs=())
    assert mirror.image(np.array([1.0, 2.0, 3.0])).tolist() == [1, -2, 3]
    both = np.array([[1.0, 2.0, 3.0], [0.0, -1.0, 0.0]])
    assert mirror.image(both).tolist() == [[1, -2, 3], [0, 1, 0]]
    assert mirror.image(mirror.image(both)).tolist() == both.tolist()


@every_robot
def test_mirror_of_published_robots(name, robot_file):
    robot = load(name, robot_file)
    assert robot.mirror.normal.tolist() == [0, 1, 0]
    assert len(robot.mirror.pairs) == PAIRS[name]
    for pair in robot.mirror.pairs:
        assert robot.bodies[pair.left].zero_pose[1, 3] > robot.bodies[pair.right].zero_pose[1, 3]
        assert swap_sides(robot.bodies[pair.left].name) == robot.bodies[pair.right].name


@every_robot
def test_mirror_signs_give_mirrored_poses(name, robot_file):
    # Each pair has equal or opposite positions, according to its sign; all others are at zero.
    robot = load(name, robot_file)
    rng = np.random.default_rng(0)
    for _ in range(5):
        positions = {}
        for pair in robot.mirror.pairs:
            left, right = (robot.bodies[i].joint for i in (pair.left, pair.right))
            assert pair.sign in (1, -1)
            positions[left.name] = rng.uniform(-0.5, 0.5)
            positions[right.name] = pair.sign * positions[left.name]
        poses = body_poses(robot.bodies, positions)
        for pair in robot.mirror.pairs:
            image = robot.mirror.image(poses[pair.left][:3, 3])
            np.testing.assert_allclose(image, poses[pair.right][:3, 3], atol=2e-3)


def test_image_body_returns_index_and_sign(robot_file):
    robot = load("go2/urdf/go2.urdf", robot_file)
    index = {body.top.name: body.index for body in robot.bodies}
    assert robot.mirror.image_body(index["FL_hip"]) == (index["FR_hip"], -1)
    assert robot.mirror.image_body(index["FR_hip"]) == (index["FL_hip"], -1)
    assert robot.mirror.image_body(index["RL_calf"]) == (index["RR_calf"], 1)
    assert robot.mirror.image_body(0) is None


# Pairs, by hand


@pytest.mark.parametrize(
    ("axis", "other", "sign"),
    [
        # Roll and yaw are negated by the reflection, pitch is not.
        ("0 1 0", "0 1 0", 1),
        ("0 1 0", "0 -1 0", -1),
        ("1 0 0", "1 0 0", -1),
        ("1 0 0", "-1 0 0", 1),
        ("0 0 1", "0 0 1", -1),
        ("0 0 1", "0 0 -1", 1),
        ("1 0 0", "0 1 0", 0),
        ("1 1 0", "-1 1 0", 1),
    ],
)
def test_mirror_sign_of_hinges(axis, other, sign):
    robot = facts(("trunk", "left", "0 1 0", axis), ("trunk", "right", "0 -1 0", other))
    assert pairs(robot) == [("left", "right", sign)]


@pytest.mark.parametrize(
    ("axis", "other", "sign"),
    [
        ("0 1 0", "0 -1 0", 1),
        ("0 1 0", "0 1 0", -1),
        ("1 0 0", "1 0 0", 1),
        ("0 0 1", "0 0 -1", -1),
    ],
)
def test_mirror_sign_of_slides(axis, other, sign):
    robot = facts(
        ("trunk", "left", "0 1 0", axis, "prismatic"),
        ("trunk", "right", "0 -1 0", other, "prismatic"),
    )
    assert pairs(robot) == [("left", "right", sign)]


def test_mirror_pairs_by_position():
    robot = facts(("trunk", "x", "0.1 1 0", "0 1 0"), ("trunk", "q", "0.1 -1 0", "0 1 0"))
    assert pairs(robot) == [("x", "q", 1)]


def test_mirror_pairs_by_name():
    robot = facts(("trunk", "l_a", "0.1 1 0", "0 1 0"), ("trunk", "r_a", "0.5 -1 0", "0 1 0"))
    assert pairs(robot) == [("l_a", "r_a", 1)]


def test_mirror_prefers_position_over_name():
    # The names confuse left and right; the positions are decisive.
    robot = facts(
        ("trunk", "l_a", "1 1 0", "0 1 0"),
        ("trunk", "r_a", "-1 -1 0", "0 1 0"),
        ("trunk", "x", "1 -1 0", "0 1 0"),
        ("trunk", "y", "-1 1 0", "0 1 0"),
    )
    assert pairs(robot) == [("l_a", "x", 1), ("y", "r_a", 1)]


def test_mirror_resolves_ties_by_name():
    robot = facts(
        ("trunk", "left_a", "0 1 0", "0 1 0"),
        ("trunk", "left_b", "0 1 0", "0 1 0"),
        ("trunk", "right_b", "0 -1 0", "0 1 0"),
        ("trunk", "right_a", "0 -1 0", "0 1 0"),
    )
    assert {(left, right) for left, right, _ in pairs(robot)} == {
        ("left_a", "right_a"),
        ("left_b", "right_b"),
    }


def test_mirror_excludes_bodies_in_the_plane():
    assert (
        pairs(facts(("trunk", "head", "1 0 0", "0 1 0"), ("trunk", "tail", "-1 0 0", "0 1 0")))
        == []
    )


def test_mirror_excludes_single_body():
    assert pairs(facts(("trunk", "arm", "0 1 0", "0 1 0"))) == []


def test_mirror_excludes_bodies_on_one_side():
    assert (
        pairs(facts(("trunk", "l_a", "0 1 0", "0 1 0"), ("trunk", "r_a", "0 2 0", "0 1 0"))) == []
    )


def test_mirror_excludes_other_joint_types():
    robot = facts(("trunk", "a", "0 1 0", "0 1 0"), ("trunk", "b", "0 -1 0", "0 1 0", "prismatic"))
    assert pairs(robot) == []


def test_mirror_pairs_each_body_once():
    robot = facts(
        *(("trunk", f"l{k}", "0 1 0", "0 1 0") for k in range(3)),
        *(("trunk", f"r{k}", "0 -1 0", "0 1 0") for k in range(2)),
    )
    used = [name for pair in pairs(robot) for name in pair[:2]]
    assert len(used) == len(set(used)) == 4


def test_mirror_of_robot_along_y_is_x():
    legs = []
    for name, x, y in (("fl", -0.2, 0.3), ("fr", 0.2, 0.3), ("hl", -0.2, -0.3), ("hr", 0.2, -0.3)):
        legs += [
            ("trunk", f"{name}_thigh_leg", f"{x} {y} 0", "1 0 0", "revolute"),
            (f"{name}_thigh_leg", f"{name}_foot", "0 0 -0.3", "1 0 0", "revolute"),
            (f"{name}_foot", f"{name}_tip", "0 0 -0.3", "1 0 0", "fixed"),
        ]
    robot = facts(*legs)
    assert len(robot.legs) == 4
    assert robot.mirror.normal.tolist() == [1, 0, 0]
    assert len(robot.mirror.pairs) == 4


def test_mirror_offset_of_lateral_trunk_frame():
    # The frame of the trunk is at a sensor on its side.
    path = bundled.urdf_path("quadruped")
    plain = Facts(load_robot(path))
    trunk = plain.bodies[0].top.name
    text = path.read_text().replace(
        "</robot>",
        '<link name="sensor"/><joint name="mounted" type="fixed"><parent link="sensor"/>'
        f'<child link="{trunk}"/><origin xyz="0 0.1 0"/></joint></robot>',
    )
    robot = Facts(load_robot(FILE, contents={FILE: text.encode()}))
    assert robot.bodies[0].top.name == "sensor"
    assert robot.mirror.offset == pytest.approx(0.1)
    assert plain.mirror.offset == 0
    assert pairs(robot) == pairs(plain)
    assert robot.stance.positions == pytest.approx(plain.stance.positions, abs=1e-6)


def test_mirror_without_joints():
    assert facts().mirror.pairs == ()
    assert Facts(load_robot(FILE, contents={FILE: b'<robot name="r"/>'})).mirror.pairs == ()


def test_mirror_of_thousands_of_bodies():
    joints = [
        ("trunk", f"{side}{k}", f"{k * 1e-3} {y} 0", "0 1 0")
        for k in range(1000)
        for side, y in (("l", 1), ("r", -1))
    ]
    robot = facts(*joints)
    assert robot.limbs == ()
    assert len(robot.mirror.pairs) == 1000

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terrainkit_robots.analysis.bodies.kinematics import body_poses
from terrainkit_robots.analysis.symmetry.mirror import (
    Mirror,
    _plane_normal,
    _plane_offset,
    side_words,
    swap_sides,
)
from terrainkit_robots.description import bundled
from tests import small_robots
from tests.robots import BUNDLED
from tests.small_robots import chain, facts, joint, link
from tests.tables import read_table

Y = "0 1 0"


def robot(*joints):
    """Return a robot of joints (parent, child, xyz, axis, kind); the trunk is called `trunk`."""
    links = [link(name, mass=None) for name in ("trunk", *(child for _, child, *_ in joints))]
    made = [joint(*each[:4], *(each[4:] or ("continuous",))) for each in joints]
    return facts(*links, *made)


def on_trunk(text):
    """Return a robot of bodies on the trunk, such as `left 0 1 0; right 0 -1 0 prismatic`."""
    bodies = [each.split() for each in text.split(";")]
    return robot(*(("trunk", name, f"{x} {y} {z}", Y, *kind) for name, x, y, z, *kind in bodies))


def pairs(robot):
    bodies = robot.bodies
    found = [(bodies[p.left].name, bodies[p.right].name, p.sign) for p in robot.mirror.pairs]
    return "; ".join(f"{left} {right} {sign}" for left, right, sign in found)


@pytest.mark.parametrize(
    ("name", "other"),
    read_table(__file__, "swap_sides_exchanges_left_and_right")
)  # fmt: skip
def test_swap_sides_exchanges_left_and_right(name, other):
    assert (swap_sides(name), swap_sides(other)) == (other, name)


@pytest.mark.parametrize(
    "name",
    [
        "trunk", "", "calf", "roll", "pelvis", "leftover", "upright", "bright", "link_3", "shelf",
        "4",
    ],
)  # fmt: skip
def test_swap_sides_keeps_names_without_side(name):
    assert swap_sides(name) == name
    assert side_words(name) == []


def test_side_words_are_as_written():
    assert side_words("FL_calf_Left_2r") == ["FL", "Left", "r"]


@given(st.text(max_size=20))
def test_swap_sides_is_an_involution(name):
    assert swap_sides(swap_sides(name)) == name


def test_image_of_vectors():
    mirror = Mirror(normal=np.array([0.0, 1.0, 0.0]), pairs=())
    both = np.array([[1.0, 2.0, 3.0], [0.0, -1.0, 0.0]])
    assert mirror.image(both).tolist() == [[1, -2, 3], [0, 1, 0]]
    assert mirror.image(both[0]).tolist() == (mirror.reflection @ both[0]).tolist() == [1, -2, 3]


@pytest.mark.parametrize("name", BUNDLED)
def test_mirror_of_bundled_robots(name, bundled):
    # Each pair has equal or opposite positions, according to its sign; all others are at zero.
    robot = bundled(name)
    mirror, bodies = robot.mirror, robot.bodies
    assert (mirror.normal.tolist(), len(mirror.pairs), mirror.offset) == ([0, 1, 0], 6, 0)
    rng = np.random.default_rng(0)
    positions = {}
    for pair in mirror.pairs:
        left, right = bodies[pair.left], bodies[pair.right]
        assert left.zero_pose[1, 3] > right.zero_pose[1, 3]
        assert swap_sides(left.name) == right.name
        assert mirror.image_body(pair.left) == (pair.right, pair.sign)
        assert mirror.image_body(pair.right) == (pair.left, pair.sign)
        assert mirror.image_index[pair.left] == pair.right
        positions[left.joint.name] = rng.uniform(-0.5, 0.5)
        positions[right.joint.name] = pair.sign * positions[left.joint.name]
    assert mirror.image_body(0) is None
    poses = body_poses(bodies, positions)
    for pair in mirror.pairs:
        image = mirror.image(poses[pair.left][:3, 3])
        np.testing.assert_allclose(image, poses[pair.right][:3, 3], atol=2e-3)


@pytest.mark.parametrize(
    ("axis", "other", "kind", "sign"), read_table(__file__, "sign_of_mirrored_joints")
)
def test_sign_of_mirrored_joints(axis, other, kind, sign):
    left, right = ("trunk", "left", "0 1 0"), ("trunk", "right", "0 -1 0")
    assert pairs(robot((*left, axis, kind), (*right, other, kind))) == f"left right {sign}"


@pytest.mark.parametrize(("bodies", "expected"), read_table(__file__, "pairs_of_bodies"))
def test_pairs_of_bodies_on_the_trunk(bodies, expected):
    assert pairs(on_trunk(bodies)) == expected


L_ARM = ("trunk", "link_l", "0 0.1 0.1", "0 0 1")


@pytest.mark.parametrize(
    ("joints", "expected"),
    [
        ([L_ARM, ("trunk", "link_r", "0.1 -0.2 0.1", "0 0 1")], "link_l link_r -1"),
        # At other depths.
        ([L_ARM, ("trunk", "t", "0 0 0.3", Y), ("t", "link_r", "0 -0.2 0.1", "1 0 0")], ""),
        # Links L and R of one chain.
        ([L_ARM, ("link_l", "u", "0 0 0.3", Y), ("u", "link_r", "0 -0.3 0.1", "1 0 0")], ""),
        ([L_ARM, ("link_l", "link_r", "0 -0.3 0.1", "1 0 0")], ""),
    ],
)
def test_lone_letter_is_a_side_at_the_same_depth(joints, expected):
    assert pairs(robot(*joints)) == expected


def test_mirror_of_robot_along_y_is_x():
    axes = ["1 0 0"] * 2
    legs = [
        chain(name, f"{x} {y} 0", (0.3, 0.3), axes=axes)
        for name, x, y in (("a", -0.2, 0.3), ("b", 0.2, 0.3), ("c", -0.2, -0.3), ("d", 0.2, -0.3))
    ]
    found = facts(link("trunk"), *legs)
    assert len(found.legs) == 4
    assert found.mirror.normal.tolist() == [1, 0, 0]
    assert pairs(found) == "b0 a0 1; b1 a1 1; d0 c0 1; d1 c1 1"


X = np.array([1.0, 0, 0])
STRAIGHT = SimpleNamespace(points=np.zeros((0, 3)), tip=np.zeros(3))


@pytest.mark.parametrize(("pitches", "normal"), read_table(__file__, "plane_is_across"))
def test_plane_is_across_most_legs(pitches, normal):
    legs = [SimpleNamespace(pitch=np.array([*p, 0]), roles=(), limb=STRAIGHT) for p in pitches]
    assert _plane_normal(legs).tolist() == normal


# The legs have 0.4 m; those of an insect reach more than a quarter of it to the side.
@pytest.mark.parametrize(("reach", "normal"), [(0.11, [0, 1, 0]), (0.09, [1, 0, 0])])
def test_legs_that_a_yaw_joint_swings_step_along_their_pitch_axis(reach, normal):
    limb = SimpleNamespace(points=np.array([[0, 0.2, 0]] * 3), tip=np.array([0, 0.2 + reach, -0.3]))
    leg = SimpleNamespace(pitch=X, roles=("yaw", "hip", "knee"), limb=limb, length=0.4)
    assert _plane_normal([leg] * 6).tolist() == normal


@pytest.mark.parametrize(
    ("starts", "trunk", "offset"),
    [
        *read_table(__file__, "plane_is_amid_the_legs_if_the_trunk_is_too"),
        ((5.0, 0.2, 0.0, 0.1), 0.15, pytest.approx(0.15)),  # one leg is misplaced
    ],
)
def test_plane_is_amid_the_legs_if_the_trunk_is_too(starts, trunk, offset):
    points = [np.array([1, y, 2]) for y in starts]
    bodies = [SimpleNamespace(center=np.array([3, trunk, 4]))]
    assert _plane_offset(points, bodies, np.array([0.0, 1.0, 0.0])) == offset


def test_mirror_of_a_trunk_whose_frame_is_at_its_side():
    text = bundled.urdf_path("quadruped").read_text()
    plain = facts(text)
    sensor = '<link name="sensor"/>' + joint("sensor", "base", "0 0.1 0", kind="fixed")
    moved = small_robots.facts(text.replace("</robot>", f"{sensor}</robot>"))
    assert (plain.mirror.offset, moved.mirror.offset) == (0, pytest.approx(0.1))
    assert pairs(moved) == pairs(plain)
    assert moved.stance.positions == pytest.approx(plain.stance.positions, abs=1e-6)


def test_mirror_of_none_and_of_thousands_of_bodies():
    assert robot().mirror.pairs == facts("").mirror.pairs == ()
    many = [f"l{k} {k * 1e-3} 1 0; r{k} {k * 1e-3} -1 0" for k in range(1000)]
    assert pairs(on_trunk("; ".join(many))) == "; ".join(f"l{k} r{k} 1" for k in range(1000))

import re

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terrainkit_robots.analysis.bodies.bodies import center_of_mass, physical_parent
from terrainkit_robots.analysis.bodies.kinematics import body_poses
from terrainkit_robots.description import bundled
from terrainkit_robots.transforms import rpy_to_matrix
from tests.small_robots import ball, facts, floating, joint, link

QUARTER = f"0 0 {np.pi / 2}"


def bodies(*parts):
    return facts(*parts).bodies


def frames(names):
    """Return links without an inertial."""
    return "".join(link(name, mass=None) for name in names)


def fixed(parent, child, xyz="0 0 0", rpy="0 0 0"):
    return joint(parent, child, xyz, kind="fixed", rpy=rpy)


def names(merged):
    return [" ".join(each.name for each in body.links) for body in merged]


def test_fixed_joints_merge_links():
    joints = [fixed("a", "b"), joint("b", "c", "0 0 1"), fixed("c", "d"), fixed("a", "e")]
    merged = bodies(frames("abcde"), *joints)
    assert names(merged) == ["a b e", "c d"]
    trunk, arm = merged
    assert (trunk.index, trunk.parent, trunk.joint, trunk.top.name) == (0, None, None, "a")
    assert (arm.index, arm.parent, arm.joint.name) == (1, 0, "c_joint")
    assert bodies("") == ()


def test_frames_compose_along_fixed_joints():
    # b is 1 m ahead of a and turned to the left, so c, 2 m ahead of b, is to the left of a.
    joints = [fixed("a", "b", "1 0 0", QUARTER), joint("b", "c", "2 0 0")]
    trunk, arm = bodies(frames("abcd"), *joints, fixed("c", "d", "0 0 3", QUARTER))
    np.testing.assert_allclose(trunk.poses[0], np.eye(4))
    np.testing.assert_allclose(trunk.poses[1][:3, 3], [1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(arm.origin[:3, 3], [1, 2, 0], atol=1e-15)
    np.testing.assert_allclose(arm.origin[:3, :3], rpy_to_matrix(np.array([0, 0, np.pi / 2])))
    np.testing.assert_allclose(arm.poses[1][:3, 3], [0, 0, 3])


@pytest.mark.parametrize(
    ("kind", "merged", "moves"),
    [
        ("revolute", ["a", "b"], True),
        ("continuous", ["a", "b"], True),
        ("prismatic", ["a", "b"], True),
        ("floating", ["a", "b"], False),
        ("planar", ["a", "b"], False),
        ("hinge", ["a b"], None),  # unknown
    ],
)
def test_kind_of_joint_decides_about_merging(kind, merged, moves):
    found = bodies(link("a"), link("b"), joint("a", "b", kind=kind))
    assert names(found) == merged
    assert moves is None or found[1].joint.moves == moves


@pytest.mark.parametrize(
    ("world", "joints", "expected"),
    [
        ("", [joint("w", "a", kind="floating"), joint("a", "b")], ["a", "b"]),
        ("", [fixed("w", "a"), joint("w", "b", kind="floating")], ["w a", "b"]),
        ("", [joint("w", "a", kind="planar"), joint("a", "b")], ["w", "a", "b"]),
        (ball(1), [joint("w", "a", kind="floating"), joint("a", "b")], ["w", "a", "b"]),
    ],
)
def test_empty_link_above_a_floating_joint_is_the_world(world, joints, expected):
    found = bodies(link("w", world, mass=None), link("a"), link("b"), *joints)
    assert names(found) == expected
    assert found[0].joint is None


def test_body_has_the_name_of_its_heaviest_link():
    parts = [link("a", mass=None), link("b", mass=0.1), link("c", mass=2)]
    (body,) = bodies(*parts, fixed("a", "b"), fixed("b", "c"))
    assert (body.name, body.top.name) == ("c", "a")
    assert bodies(frames("ab"), fixed("a", "b"))[0].name == "a"


def test_body_shapes_are_in_body_frame():
    shapes = ball(1, "0 0 1") + ball(2, kind="visual")
    (body,) = bodies(link("a"), link("b", shapes), fixed("a", "b", "1 0 0", f"{np.pi} 0 0"))
    (collision,), (visual,) = body.collisions, body.visuals
    assert (collision.link, collision.geometry.size, body.has_contacts) == ("b", (1,), True)
    np.testing.assert_allclose(collision.pose[:3, 3], [1, 0, -1], atol=1e-12)
    np.testing.assert_allclose(visual.pose[:3, 3], [1, 0, 0], atol=1e-12)
    assert not bodies(link("a", ball(2, kind="visual")))[0].has_contacts


def test_physical_parent_is_not_virtual():
    two = '<joint name="i" axis="1 0 0"/><joint name="j" axis="0 1 0"/><geom size="1"/>'
    found = facts(
        '<mujoco><worldbody><body name="a"><geom size="1"/><body name="b">'
        f"{two}</body></body></worldbody></mujoco>"
    ).bodies
    assert [body.virtual for body in found] == [False, True, False]
    assert [physical_parent(found, body) for body in found] == [None, found[0], found[0]]


def test_inertia_of_two_point_masses():
    # 1 kg at x = 0 and 3 kg at x = 2: the center is at 1.5, and 1 * 1.5^2 + 3 * 0.5^2 = 3.
    points = [link(name, mass=mass, inertia="0 0 0 0 0 0") for name, mass in (("a", 1), ("b", 3))]
    (body,) = bodies(*points, fixed("a", "b", "2 0 0"))
    assert (body.mass, body.center.tolist()) == (4, [1.5, 0, 0])
    np.testing.assert_allclose(body.inertia, np.diag([0, 3, 3]))
    np.testing.assert_allclose(body.principal, [0, 3, 3])


def test_links_without_mass_change_nothing():
    heavy = link("a", mass=2, center="1 2 3", inertia="1 2 3 .1 .2 .3")
    (alone,) = bodies(heavy)
    held, moved = bodies(heavy, frames("bc"), fixed("a", "b", "5 5 5"), joint("a", "c"))
    assert held.mass == alone.mass
    np.testing.assert_array_equal(held.center, alone.center)
    np.testing.assert_array_equal(held.inertia, alone.inertia)
    assert (moved.mass, moved.center.tolist(), moved.inertia.any()) == (0, [0, 0, 0], False)


@pytest.mark.parametrize(
    ("mass", "total"),
    [("-1", 0), ("-3", -2), ("0", 1), ("1e20", 1), ("nan", 1), ("inf", 1), ("x", 1)],
)
def test_mass_of_invalid_values_is_finite(mass, total):
    first = link("a", mass=mass, center="1 0 0", inertia="1e29 0 -1 1e29 0 0")
    (body,) = bodies(first, link("b"), fixed("a", "b"))
    assert body.mass == total
    assert np.isfinite([*body.center, *body.inertia.ravel(), *body.principal]).all()


def test_center_of_mass_of_bodies():
    parts = [link("a", mass=3), link("b", mass=1, center="0 0 -2")]
    found = bodies(*parts, joint("a", "b", "0 0 -2"))
    assert center_of_mass(found, body_poses(found, {})).tolist() == [0, 0, -1]
    moved = [np.eye(4) + np.diag([1.0] * 3, 1)] * 2  # from the origin to (0, 0, 1)
    empty = bodies(frames("ab"), joint("a", "b"))
    assert center_of_mass(empty, moved).tolist() == [0, 0, 1]


SKEWED = (
    '<robot name="r"><mujoco><compiler/></mujoco>',
    link("a", mass=2, center=".1 .2 .3", inertia="2 3 4 .1 .2 .3", rpy=".4 .5 .6"),
    link("b", mass=3, center="-.3 .1 .2", inertia="4 3 2 -.3 .2 .1", rpy="1 -2 3"),
    link("c", center="0 .5 0", inertia="1 1.5 2 0 .3 0", rpy="-1 .1 .2"),
    fixed("a", "b", "1 2 3", "-.7 .8 .9"),
    joint("b", "c", "0 0 1", rpy=".1 .2 .3"),
    "</robot>",
)


@pytest.mark.parametrize("name", ["", *bundled.robot_names()])
def test_bodies_match_mujoco(name):
    text = bundled.urdf_path(name).read_text() if name else "".join(SKEWED)
    merged = facts(text).bodies
    text = re.sub("<(visual|collision).*?</\\1>", "", text, flags=re.DOTALL)
    compiler = 'fusestatic="true" balanceinertia="false" inertiafromgeom="false"'
    text = re.sub("<compiler.*?/>", f"<compiler {compiler}/>", text)
    model = mujoco.MjModel.from_xml_string(floating(text, merged[0].top.name))
    assert len(merged) == model.nbody - 1
    # MuJoCo 3 computes the principal axes less accurately.
    near = 1e-9 if int(mujoco.__version__.split(".")[0]) >= 4 else 1e-5
    for body in merged:
        theirs, turn = model.body(body.top.name), np.zeros(9)
        mujoco.mju_quat2Mat(turn, theirs.iquat)
        turn = turn.reshape(3, 3)
        inertia = turn @ np.diag(theirs.inertia) @ turn.T
        assert body.mass == pytest.approx(float(theirs.mass[0]), rel=1e-9)
        np.testing.assert_allclose(body.center, theirs.ipos, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(body.inertia, inertia, atol=near * theirs.inertia.max())
        np.testing.assert_allclose(body.principal, np.sort(theirs.inertia), rtol=near)


TRIPLE = st.tuples(*[st.floats(-2, 2)] * 3)


@given(st.lists(st.tuples(st.floats(0.1, 9), *[TRIPLE] * 5), min_size=1, max_size=4))
def test_body_has_the_inertia_of_the_point_masses_of_its_links(parts):
    """Each link has the inertia of six points on its principal axes, so the body has, too."""
    text, weights, points = link("root", mass=None), [], []
    for number, (mass, center, rpy, arms, xyz, turn) in enumerate(parts):
        arms = np.abs(arms) + 0.1
        moments = mass / 3 * (np.sum(arms**2) - arms**2)
        inertia, places = [*moments, 0, 0, 0], (center, rpy, xyz, turn)
        words = [" ".join(map(repr, map(float, values))) for values in (inertia, *places)]
        name = f"part{number}"
        text += link(name, mass=mass, center=words[1], inertia=words[0], rpy=words[2])
        text += fixed("root", name, words[3], words[4])
        axes = rpy_to_matrix(np.array(rpy)) * arms
        local = np.hstack([axes, -axes]).T + center
        points.append(local @ rpy_to_matrix(np.array(turn)).T + xyz)
        weights += 6 * [mass / 6]
    (body,) = bodies(text)
    masses, points = np.array(weights), np.concatenate(points)
    assert body.mass == pytest.approx(masses.sum())
    assert body.center == pytest.approx(masses @ points / masses.sum(), abs=1e-9)
    arms = points - body.center
    products = (masses[:, None] * arms).T @ arms
    wanted = np.trace(products) * np.eye(3) - products
    np.testing.assert_allclose(body.inertia, wanted, atol=1e-8)

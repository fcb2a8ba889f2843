from types import SimpleNamespace

import numpy as np
import pytest

from terrainkit_robots.analysis.legs.limbs import Chain, is_branch
from tests.small_robots import ball, chain, facts, joint, link

LENGTHS = (0.3, 0.3)
TRUNK = link("trunk", mass=10)


def robot(*parts, trunk=TRUNK):
    return facts(trunk, *parts)


def scores(robot):
    return {robot.bodies[limb.chain[-1]].name: limb.score for limb in robot.limbs}


def at_corners(*names, lengths=LENGTHS, z=0):
    """Return limbs at the corners of a rectangle: front left, front right, rear left and right."""
    places = ["0.3 0.2", "0.3 -0.2", "-0.3 0.2", "-0.3 -0.2"]
    return [chain(n, f"{at} {z}", lengths) for n, at in zip(names, places, strict=False)]


def test_limb_of_two_joints():
    (found,) = robot(chain("a", "1 2 0", (0.3, 0.2))).limbs
    assert found.chain == (1, 2)
    assert [each.name for each in found.joints] == ["a0_joint", "a1_joint"]
    np.testing.assert_allclose(found.points, [[1, 2, 0], [1, 2, -0.3]])
    np.testing.assert_allclose(found.tip, [1, 2, -0.52])
    assert not found.has_leg_names


@pytest.mark.parametrize(
    ("ball_of_shank", "tip", "place", "end"),
    [
        (ball(0.02, "0 0 -0.3"), ball(0.02), "0 0 -0.4", [0, 0, -0.72]),
        ("", "", "0.1 0 -0.3", [0.1, 0, -0.6]),  # without shapes, at the lowest frame
    ],
)
def test_limb_includes_fixed_links(ball_of_shank, tip, place, end):
    parts = chain("a", "0 0 0", LENGTHS).replace(ball(0.02, "0 0 -0.3"), ball_of_shank)
    (found,) = robot(parts, link("tip", tip), joint("a1", "tip", place, kind="fixed")).limbs
    assert len(found.chain) == 2
    np.testing.assert_allclose(found.tip, end)


@pytest.mark.parametrize(("joints", "count"), [(0, 0), (1, 0), (2, 1), (32, 1), (33, 0)])
def test_limb_has_2_to_32_joints(joints, count):
    assert len(robot(chain("a", "0 0 0", (0.1,) * joints)).limbs) == count


def test_limbs_are_the_64_lowest_chains():
    found = robot(*(chain(f"l{k}", f"{k * 0.01} 0 {k}", LENGTHS) for k in range(70)))
    assert len(found.bodies) == 141
    assert list(scores(found)) == [f"l{k}1" for k in range(64)]
    assert facts("").limbs == ()


def test_limb_ignores_mimic_joints():
    parts = [link("a"), link("b", ball(0.02, "0 0 -0.3")), joint("trunk", "a")]
    follows = '<mimic joint="a_joint"/>'
    assert len(robot(*parts, joint("a", "b", "0 0 -0.3")).limbs) == 1
    assert robot(*parts, joint("a", "b", "0 0 -0.3", more=follows)).limbs == ()


@pytest.mark.parametrize(
    ("actuators", "count"),
    [
        ('<motor joint="i"/>', 0),
        ('<motor joint="i"/><motor joint="j"/>', 1),
        ("", 1),
        ('<motor joint="i"/><motor tendon="t"/>', 1),
    ],
)
def test_limb_counts_joints_with_motor_or_tendon(actuators, count):
    found = facts(
        '<mujoco><worldbody><body name="a"><freejoint/><geom size="0.1"/><body name="b">'
        '<joint name="i" axis="0 1 0"/><geom size="0.1"/><body name="c" pos="0 0 -1">'
        '<joint name="j" axis="0 1 0"/><geom size="0.1" pos="0 0 -1"/></body></body></body>'
        '</worldbody><tendon><fixed name="t"><joint joint="i" coef="1"/>'
        '<joint joint="j" coef="1"/></fixed>'
        f"</tendon><actuator>{actuators}</actuator></mujoco>"
    )
    assert len(found.limbs) == count


def test_wheel_may_have_no_mass_or_end_a_leg():
    wheel = link("w", ball(0.02), mass=None)
    column = link("a") + joint("trunk", "a", axis="0 0 1")
    assert robot(column, wheel, joint("a", "w", "0 0 -0.3", kind="continuous")).limbs == ()
    leg = chain("leg", "0 0 0", LENGTHS) + joint("leg1", "w", "0 0 -0.3", kind="continuous")
    (limb,) = robot(leg, wheel).limbs
    assert len(limb.joints) == 3
    assert len(robot(chain("a", "0 0 0", LENGTHS, kind="continuous")).limbs) == 1


ARMS = at_corners("x_leg", "y_leg", "z_arm", "w_arm")
# The mass is above four legs, and arms between them carry nothing.
SPARE = [*at_corners("x", "y", "z", "w"), chain("arm_l", "0 0.2 0", LENGTHS)]
LEFT = chain("a", "0 0.2 0", LENGTHS)


@pytest.mark.parametrize(
    ("parts", "expected"),
    [
        ([LEFT], {"a1": 1.0}),
        ([chain("leg", "0 0 0", LENGTHS)], {"leg1": 1.5}),
        (at_corners("x", "y"), {"x1": 1.5, "y1": 1.5}),
        (at_corners("x", "-", "z")[::2], {"x1": 1.5, "z1": 1.5}),
        (ARMS, {"x_leg1": 2.0, "y_leg1": 2.0, "z_arm1": 1.5, "w_arm1": 1.5}),
        (SPARE, dict.fromkeys(("x1", "y1", "z1", "w1"), 1.5) | {"arm_l1": 0.5}),
        (ARMS[2:], {"z_arm1": 0.5, "w_arm1": 0.5}),
        ([LEFT, chain("b", "0 -0.2 0", (0.2,) * 3)], {"a1": 1.5, "b2": 1.5}),
        ([LEFT, chain("b", "0 -0.2 0", (0.15,) * 4)], {"a1": 1.0, "b3": 1.0}),
    ],
    ids=[
        "one",
        "leg",
        "mirrored",
        "front and rear",
        "arms that carry",
        "spare arm",
        "arms",
        "one more joint",
        "two more joints",
    ],
)
def test_score(parts, expected):
    assert scores(robot(*parts)) == expected


@pytest.mark.parametrize(("error", "score"), [(0.0390, 1.5), (0.0395, 1.0)])
def test_mirror_image_is_within_a_share_of_the_size(error, score):
    # The robot is 0.04 m x (0.44 m + error) x 0.62 m, 0.785 m across. 5 % are 0.0392 m.
    sides = [chain("a", "0 0.2 0", LENGTHS), chain("b", f"0 {-0.2 - error} 0", LENGTHS)]
    assert scores(robot(*sides)) == {"a1": score, "b1": score}


@pytest.mark.parametrize(
    ("height", "score"), [(0.119, 1.5), (0.121, 1.0), (0.249, 1.0), (0.251, 0.5)]
)
def test_score_depends_on_height_of_foot(height, score):
    # The robot is 1 m high.
    low = at_corners("x", "y", lengths=(0.3, 0.28))
    raised = at_corners("-", "-", "z", "w", lengths=(0.3, 0.28), z=height)[2:]
    found = robot(*low, *raised, trunk=link("trunk", ball(0.02, "0 0 0.38")))
    assert scores(found) == {"x1": 1.5, "y1": 1.5, "z1": score, "w1": score}


@pytest.mark.parametrize(("z", "score"), [(-1.219, 1.5), (-1.221, 0.5)])
def test_arms_end_half_of_the_height_above_the_pedestal(z, score):
    # The limbs end at -0.62 m, and the pedestal 0.02 m below z.
    head = link("head", ball(0.02)) + joint("trunk", "head", "0 0 -0.3")  # above it
    found = robot(*at_corners("x", "y"), head, trunk=link("trunk", ball(0.02, f"0 0 {z}")))
    assert scores(found) == {"x1": score, "y1": score}


def test_score_of_gripper_jaws_is_not_mirrored():
    jaws = [
        link(name, ball(0.02, "0 0 -0.1")) + joint("a1", name, f"0 {y} -0.4")
        for name, y in (("p", 0.04), ("q", -0.04))
    ]
    assert scores(robot(chain("a", "0 0 0", (0.4, 0.4)), *jaws)) == {"p": 1.0, "q": 1.0}


def test_score_of_fixed_base_is_lower():
    held = link("world", mass=None) + joint("world", "trunk", "0 0 1", kind="fixed") + TRUNK
    assert scores(robot(*at_corners("x", "y"), trunk=held)) == {"x1": 1.0, "y1": 1.0}


def test_score_of_fingers_is_lower():
    hand = link("Palm") + joint("trunk", "Palm", kind="fixed")
    assert scores(robot(*at_corners("x", "y"), hand)) == {"x1": 0.5, "y1": 0.5}
    assert scores(robot(*at_corners("x_toe", "y_toe"), hand)) == {"x_toe1": 2.0, "y_toe1": 2.0}


LEG_NAMES = "FL_thigh left_hip_yaw LF_KFE RightKnee l_foot toe_fr Leg1 lower_leg shank LLeg tibia "
LEG_NAMES += "coxa_rf left_sole hind_leg_shoulder_leg"
OTHER_NAMES = "left_elbow link_3 allegro_thumb TorsoLeft chip ship console wrist finger_mcp "
OTHER_NAMES += "wheel_mount front_shoulder allegro"


@pytest.mark.parametrize(("is_leg", "names"), [(True, LEG_NAMES), (False, OTHER_NAMES)])
def test_has_leg_names(is_leg, names):
    for name in names.split():
        (limb,) = robot(chain(name, "0 0 0", LENGTHS)).limbs
        assert limb.has_leg_names == is_leg, name


@pytest.mark.parametrize("name", ["armature", "handle", "proprioception"])
def test_score_ignores_words_within_words(name):
    assert scores(robot(chain(name, "0 0 0", LENGTHS))) == {f"{name}1": 1.0}


@pytest.mark.parametrize(
    ("first", "second", "is_leg", "score"),
    [("hip", "elbow", False, 0.0), ("shoulder", "foot", True, 1.5), ("hip", "part", True, 1.5)],
)
def test_names_of_a_limb_take_the_majority(first, second, is_leg, score):
    above = link(first) + joint("trunk", first)
    (limb,) = robot(above, chain(second, "0 0 -0.1", LENGTHS, first)).limbs
    assert (limb.has_leg_names, limb.score) == (is_leg, score)


def branches(robot):
    one, other = robot.limbs
    assert is_branch(one, other, 1.0) == is_branch(other, one, 1.0)
    return is_branch(one, other, 1.0)


def test_legs_below_a_waist_are_no_branches():
    waist = link("w") + joint("trunk", "w", "0 0 -0.1", axis="0 0 1")
    legs = [chain(n, f"0 {y} 0", LENGTHS, "w") for n, y in (("a", 0.1), ("b", -0.1))]
    found = robot(waist, *legs)
    assert not branches(found)
    assert scores(found) == {"a1": 1.5, "b1": 1.5}


def test_legs_behind_a_spine_are_no_branches():
    spine = chain("s", "0 0 0", (0.05,) * 8, axes=["0 0 1"] * 8)
    legs = [chain(n, f"0 {y} 0", (0.3, 0.3, 0.1), "s7") for n, y in (("a", 0.1), ("b", -0.1))]
    assert not branches(robot(spine, *legs))


def test_rod_of_a_closed_loop_is_a_branch():
    # It is beside the knee, below two of the four joints of the leg.
    rod = link("rod") + link("rod1", ball(0.02, "0 0 -0.6"))
    rod += joint("a1", "rod", "0.05 0 -0.05") + joint("rod", "rod1", "0 0 -0.05")
    assert branches(robot(chain("a", "0 0 0", (0.05, 0.05, 0.4, 0.4)), rod))


HINGES = [SimpleNamespace(kind="revolute") for _ in range(6)]


def limb(*joints, y=0.0, shared=0.4):
    """Return a limb of 1 m whose second joint is `shared` below the first one."""
    points = np.array([[0, 0, 0], *[[0, 0, -shared]] * (len(joints) - 1)])
    parts = tuple(HINGES[k] for k in joints)
    return Chain(chain=(), joints=parts, points=points, tip=np.array([0, y, -1.0]), has_wheel=False)


def sliding(*joints, shared):
    """Return a limb that ends in a slide beside it, which has no length."""
    made = limb(*joints, shared=shared)
    parts, points = (*made.joints, SimpleNamespace(kind="prismatic")), [*made.points, [9, 9, 9]]
    return Chain(chain=(), joints=parts, points=np.array(points), tip=made.tip, has_wheel=False)


@pytest.mark.parametrize(
    ("one", "other", "expected"),
    [
        (limb(0, 1, y=0.1), limb(2, 3, y=0.1), False),  # no shared joint
        (limb(0, 1, y=0.1), limb(0, 2, y=-0.1), False),  # mirrored
        (limb(0, 1, y=0.1), limb(0, 2, y=0.2), True),
        (limb(0, 1, 2, y=0.1), limb(0, 3, 4, y=0.2), False),  # one of three joints
        (limb(0, 1, 2, y=0.1), limb(0, 3, y=0.2), True),
        (sliding(0, 1, shared=0.49), sliding(0, 2, shared=0.49), False),  # of the length
        (sliding(0, 1, shared=0.49), sliding(0, 2, shared=0.51), True),
    ],
)
def test_is_branch(one, other, expected):
    assert is_branch(one, other, 1.0) == expected

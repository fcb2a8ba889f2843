from pathlib import Path

import numpy as np
import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.limbs import is_branch
from terrainkit_robots.description.load import load_robot

FILE = Path("/robots/robot.urdf")


def link(name, ball=None, mass=1.0, center="0 0 0"):
    """Return a link, with a sphere of 0.02 m at `ball`."""
    shape = ""
    if ball is not None:
        shape = (
            f'<collision><origin xyz="{ball}"/><geometry><sphere radius="0.02"/></geometry>'
            "</collision>"
        )
    return (
        f'<link name="{name}"><inertial><origin xyz="{center}"/><mass value="{mass}"/>'
        f'<inertia ixx="0.01" iyy="0.01" izz="0.01"/></inertial>{shape}</link>'
    )


def joint(parent, child, xyz, kind="revolute", axis="0 1 0", more=""):
    limit = '<limit lower="-1" upper="1" effort="9" velocity="9"/>' if kind != "continuous" else ""
    return (
        f'<joint name="{child}_joint" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{child}"/><origin xyz="{xyz}"/><axis xyz="{axis}"/>{limit}{more}</joint>'
    )


def limb(name, root, lengths=(0.3, 0.3), parent="trunk", kind="revolute"):
    """Return a vertical limb at `root` with one joint for each length."""
    parts, at = "", parent
    for number, length in enumerate(lengths):
        child = f"{name}{number}"
        xyz = root if number == 0 else f"0 0 {-lengths[number - 1]}"
        last = number == len(lengths) - 1
        parts += link(child, f"0 0 {-length}" if last else None, center=f"0 0 {-length / 2}")
        parts += joint(at, child, xyz, kind)
        at = child
    return parts


def facts(*parts, trunk=None):
    inner = (link("trunk", mass=10) if trunk is None else trunk) + "".join(parts)
    text = f'<robot name="r">{inner}</robot>'
    return Facts(load_robot(FILE, contents={FILE: text.encode()}))


def scores(robot):
    return {robot.bodies[limb.chain[-1]].name: limb.score for limb in robot.limbs}


# Detection


def test_limb_of_two_joints():
    (found,) = facts(limb("a", "1 2 0", (0.3, 0.2))).limbs
    assert found.chain == (1, 2)
    assert [each.name for each in found.joints] == ["a0_joint", "a1_joint"]
    np.testing.assert_allclose(found.points, [[1, 2, 0], [1, 2, -0.3]])
    np.testing.assert_allclose(found.tip, [1, 2, -0.52])
    assert not found.has_leg_names


def test_limb_includes_fixed_links():
    (found,) = facts(
        limb("a", "0 0 0"), link("tip", "0 0 0"), joint("a1", "tip", "0 0 -0.4", "fixed")
    ).limbs
    assert len(found.chain) == 2
    np.testing.assert_allclose(found.tip, [0, 0, -0.72])


def test_limb_without_shapes_ends_at_lowest_frame():
    (found,) = facts(
        link("a"),
        link("b"),
        link("tip"),
        joint("trunk", "a", "0 0 0"),
        joint("a", "b", "0 0 -0.3"),
        joint("b", "tip", "0.1 0 -0.3", "fixed"),
    ).limbs
    np.testing.assert_allclose(found.tip, [0.1, 0, -0.6])


def test_limb_needs_two_joints():
    assert facts(limb("a", "0 0 0", (0.3,))).limbs == ()


def test_limbs_of_trunk_are_empty():
    assert facts().limbs == ()
    assert Facts(load_robot(FILE, contents={FILE: b'<robot name="r"/>'})).limbs == ()


def test_limb_ignores_mimic_joints():
    follows = '<mimic joint="a_joint"/>'
    parts = [link("a"), link("b", "0 0 -0.3"), joint("trunk", "a", "0 0 0")]
    assert len(facts(*parts, joint("a", "b", "0 0 -0.3")).limbs) == 1
    assert facts(*parts, joint("a", "b", "0 0 -0.3", more=follows)).limbs == ()


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
    text = (
        '<mujoco><worldbody><body name="a"><freejoint/><geom size="0.1"/><body name="b">'
        '<joint name="i" axis="0 1 0"/><geom size="0.1"/><body name="c" pos="0 0 -1">'
        '<joint name="j" axis="0 1 0"/><geom size="0.1" pos="0 0 -1"/></body></body></body>'
        '</worldbody><tendon><fixed name="t"><joint joint="i" coef="1"/>'
        '<joint joint="j" coef="1"/></fixed>'
        f"</tendon><actuator>{actuators}</actuator></mujoco>"
    )
    file = Path("/robots/robot.xml")
    assert len(Facts(load_robot(file, contents={file: text.encode()})).limbs) == count


def test_limb_does_not_bend_at_wheel():
    # A turret and a steering column, each with a wheel below it.
    parts = [link("a"), joint("trunk", "a", "0 0 0", axis="0 0 1"), link("b", "0 0 0")]
    assert facts(*parts, joint("a", "b", "0 0 -0.3", "continuous")).limbs == ()
    assert len(facts(*parts, joint("a", "b", "0 0 -0.3")).limbs) == 1


def test_continuous_shank_is_no_wheel():
    parts = limb("a", "0 0 0", kind="continuous")
    assert len(facts(parts).limbs) == 1


def test_limb_may_end_in_wheel():
    robot = facts(
        limb("leg", "0 0 0"),
        link("wheel", "0 0 0"),
        joint("leg1", "wheel", "0 0 -0.3", "continuous"),
    )
    assert len(robot.limbs[0].joints) == 3


# Score

FOUR = [("x", "0.3 0.2 0"), ("y", "0.3 -0.2 0"), ("z", "-0.3 0.2 0"), ("w", "-0.3 -0.2 0")]


def test_score_of_mirrored_limbs_on_ground():
    robot = facts(*(limb(name, root) for name, root in FOUR))
    assert set(scores(robot).values()) == {1.5}


def test_score_of_leg_names_adds_half():
    robot = facts(*(limb(f"{name}_thigh", root) for name, root in FOUR))
    assert set(scores(robot).values()) == {2.0}
    assert all(each.has_leg_names for each in robot.limbs)


def test_score_of_single_limb():
    assert scores(facts(limb("a", "0 0 0"))) == {"a1": 1.0}
    assert scores(facts(limb("leg", "0 0 0"))) == {"leg1": 1.5}


def test_score_of_arms_is_low():
    # Shorter than the legs and mirrored as well.
    legs = [limb(name, root) for name, root in FOUR[:2]]
    arms = [
        limb(name, root, (0.2, 0.15)) for name, root in (("p", "0 0.3 0.4"), ("q", "0 -0.3 0.4"))
    ]
    found = scores(facts(*legs, *arms, trunk=link("trunk", "0 0 0.5")))
    assert found == {"x1": 1.5, "y1": 1.5, "p1": 0.5, "q1": 0.5}


def test_score_of_arms_on_ground_depends_on_names():
    legs = [limb(f"{name}_leg", root) for name, root in FOUR[:2]]
    arms = [limb(f"{name}_arm", root) for name, root in FOUR[2:]]
    found = scores(facts(*legs, *arms))
    assert found == {"x_leg1": 2.0, "y_leg1": 2.0, "z_arm1": 0.5, "w_arm1": 0.5}


def test_score_of_arms_above_wheels_is_low():
    # The lowest limbs, but half a meter above the pedestal of the robot.
    arms = [limb(name, root) for name, root in FOUR[:2]]
    base = link("trunk", "0 0 -1.4")
    assert set(scores(facts(*arms, trunk=base)).values()) == {0.5}


def test_score_of_folded_legs_is_high():
    # The belly is lower than the feet, but by less than half of the height.
    legs = [limb(f"{name}_leg", root, (0.2, 0.1)) for name, root in FOUR]
    belly = link("trunk", "0 0 -0.4")
    assert set(scores(facts(*legs, trunk=belly)).values()) == {2.0}


@pytest.mark.parametrize(("height", "score"), [(0.0, 1.5), (0.05, 1.5), (0.15, 1.0), (0.3, 0.5)])
def test_score_depends_on_height_of_foot(height, score):
    # The robot is 1 m high.
    legs = [limb(name, root, (0.3, 0.28)) for name, root in FOUR[:2]]
    short = [limb(name, f"{root[:-1]} {height}", (0.3, 0.28)) for name, root in FOUR[2:]]
    robot = facts(*legs, *short, trunk=link("trunk", "0 0 0.38"))
    assert scores(robot)["z1"] == score


def test_score_allows_one_missing_joint():
    robot = facts(limb("a", "0 0.2 0", (0.3, 0.3)), limb("b", "0 -0.2 0", (0.2, 0.2, 0.2)))
    assert scores(robot) == {"a1": 1.5, "b2": 1.5}


def test_score_counts_front_and_rear_as_mirrored():
    robot = facts(limb("a", "0.3 0 0"), limb("b", "-0.3 0 0"))
    assert scores(robot) == {"a1": 1.5, "b1": 1.5}


def test_score_of_gripper_jaws_is_not_mirrored():
    arm = limb("a", "0 0 0", (0.4, 0.4))
    jaws = [
        link(name, "0 0 -0.1") + joint("a1", name, f"0 {y} -0.4")
        for name, y in (("p", 0.04), ("q", -0.04))
    ]
    assert set(scores(facts(arm, *jaws)).values()) == {1.0}


def test_score_of_fixed_base_is_lower():
    world = '<link name="world"/>' + link("trunk", mass=10)
    robot = facts(
        joint("world", "trunk", "0 0 1", "fixed"),
        *(limb(name, root) for name, root in FOUR),
        trunk=world,
    )
    assert set(scores(robot).values()) == {1.0}


# Names


@pytest.mark.parametrize(
    "name",
    [
        "FL_thigh", "left_hip_yaw", "LF_KFE", "RightKnee", "l_foot", "toe_fr", "Leg1", "lower_leg",
        "shank", "LLeg", "tibia", "coxa_rf", "left_sole", "hind_leg_shoulder_leg",
    ],
)  # fmt: skip
def test_has_leg_names(name):
    assert facts(limb(name, "0 0 0")).limbs[0].has_leg_names


@pytest.mark.parametrize(
    "name",
    [
        "left_elbow", "link_3", "allegro_thumb", "TorsoLeft", "chip", "ship", "console", "wrist",
        "finger_mcp", "wheel_mount", "front_shoulder", "allegro",
    ],
)  # fmt: skip
def test_has_leg_names_is_false_for_others(name):
    assert not facts(limb(name, "0 0 0")).limbs[0].has_leg_names


@pytest.mark.parametrize("name", ["armature", "handle", "proprioception"])
def test_score_ignores_words_within_words(name):
    assert scores(facts(limb(name, "0 0 0"))) == {f"{name}1": 1.0}


def test_has_leg_names_takes_majority():
    # An arm on a link named hip is an arm, and a leg on a shoulder is a leg.
    def chain(first, second):
        return facts(
            link(first), joint("trunk", first, "0 0 0"), limb(second, "0 0 -0.1", parent=first)
        ).limbs[0]

    assert not chain("hip", "elbow").has_leg_names
    assert chain("shoulder", "foot").has_leg_names


def test_shank_without_center_of_mass_is_no_wheel():
    robot = facts(
        link("thigh", center="0 0 -0.1"),
        joint("trunk", "thigh", "0 0 0"),
        link("shank", "0 0 -0.2"),
        joint("thigh", "shank", "0 0 -0.2", "continuous"),
    )
    assert [len(limb.joints) for limb in robot.limbs] == [2]


def test_score_of_fingers_is_lower():
    fingers = [limb(name, root) for name, root in FOUR]
    trunk = link("trunk", mass=10)
    assert set(scores(facts(*fingers, trunk=trunk)).values()) == {1.5}
    hand = '<joint name="j" type="fixed"><parent link="trunk"/><child link="palm"/></joint>'
    assert set(scores(facts(*fingers, link("palm"), hand, trunk=trunk)).values()) == {0.5}


# Limbs that share joints


def test_is_branch_of_toes():
    robot = facts(
        limb("a", "0 0 0", (0.4, 0.4)),
        *(
            link(t, "0 0 -0.02") + joint("a1", t, f"{x} 0 -0.4")
            for t, x in (("p", 0.1), ("q", -0.05))
        ),
    )
    one, other = robot.limbs
    assert is_branch(one, other, 1.0)
    assert is_branch(other, one, 1.0)


def test_is_branch_is_false_below_waist():
    waist = link("w") + joint("trunk", "w", "0 0 -0.1", axis="0 0 1")
    robot = facts(waist, limb("a", "0 0.1 0", parent="w"), limb("b", "0 -0.1 0", parent="w"))
    one, other = robot.limbs
    assert not is_branch(one, other, 1.0)
    assert scores(robot) == {"a1": 1.5, "b1": 1.5}


def test_is_branch_is_false_behind_spine():
    spine, at = "", "trunk"
    for k in range(8):
        spine += link(f"s{k}") + joint(at, f"s{k}", "-0.05 0 0", axis="0 0 1")
        at = f"s{k}"
    robot = facts(
        spine, limb("a", "0 0.1 0", (0.3, 0.3, 0.1), at), limb("b", "0 -0.1 0", (0.3, 0.3, 0.1), at)
    )
    one, other = robot.limbs
    assert not is_branch(one, other, 1.0)


def test_is_branch_of_closed_loop_rod():
    # It is beside the knee, below two of the four joints of the leg.
    robot = facts(
        limb("a", "0 0 0", (0.05, 0.05, 0.4, 0.4)),
        link("rod"),
        link("rod1", "0 0 -0.6"),
        joint("a1", "rod", "0.05 0 -0.05"),
        joint("rod", "rod1", "0 0 -0.05"),
    )
    one, other = robot.limbs
    assert is_branch(one, other, 1.0)


def test_is_branch_needs_shared_joints():
    one, other = facts(limb("a", "0 0 0"), limb("b", "0 0.01 0")).limbs
    assert not is_branch(one, other, 1.0)


# Size


def test_limbs_of_snake_are_empty():
    assert facts(limb("a", "0 0 0", (0.01,) * 40)).limbs == ()


def test_limbs_of_many_chains_are_limited():
    parts = [limb(f"l{k}", f"{k * 0.01} 0 0") for k in range(600)]
    robot = facts(*parts)
    assert len(robot.bodies) == 1201
    assert len(robot.limbs) == 64


def test_limbs_of_long_chain_are_empty():
    robot = facts(limb("a", "0 0 0", (0.001,) * 3000))
    assert len(robot.bodies) == 3001
    assert robot.limbs == ()

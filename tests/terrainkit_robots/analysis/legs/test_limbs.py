from pathlib import Path

import numpy as np
import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.limbs import is_branch
from terrainkit_robots.description.load import load_robot

FILE = Path("/robots/robot.urdf")


def link(name, ball=None, mass=1.0, center="0 0 0"):
    """Return a link; `ball` is where a sphere of 0.02 m is."""
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
    """Return a limb of one hinge more than it has lengths, hanging down from `root`."""
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


# What a limb is


def test_a_limb_by_hand():
    (found,) = facts(limb("a", "1 2 0", (0.3, 0.2))).limbs
    assert found.chain == (1, 2)
    assert [each.name for each in found.joints] == ["a0_joint", "a1_joint"]
    np.testing.assert_allclose(found.points, [[1, 2, 0], [1, 2, -0.3]])
    np.testing.assert_allclose(found.tip, [1, 2, -0.52])
    assert not found.has_leg_names


def test_fixed_links_belong_to_what_they_are_fixed_to():
    (found,) = facts(
        limb("a", "0 0 0"), link("tip", "0 0 0"), joint("a1", "tip", "0 0 -0.4", "fixed")
    ).limbs
    assert len(found.chain) == 2
    np.testing.assert_allclose(found.tip, [0, 0, -0.72])


def test_without_shapes_a_limb_ends_at_its_lowest_frame():
    (found,) = facts(
        link("a"),
        link("b"),
        link("tip"),
        joint("trunk", "a", "0 0 0"),
        joint("a", "b", "0 0 -0.3"),
        joint("b", "tip", "0.1 0 -0.3", "fixed"),
    ).limbs
    np.testing.assert_allclose(found.tip, [0.1, 0, -0.6])


def test_one_joint_is_no_limb():
    assert facts(limb("a", "0 0 0", (0.3,))).limbs == ()


def test_a_trunk_alone_has_no_limbs():
    assert facts().limbs == ()
    assert Facts(load_robot(FILE, contents={FILE: b'<robot name="r"/>'})).limbs == ()


def test_joints_that_follow_others_do_not_count():
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
def test_joints_count_that_a_motor_or_a_tendon_drives(actuators, count):
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


def test_a_wheel_does_not_bend_a_limb():
    # A turret and a steering column, each with a wheel below that spins about its middle.
    parts = [link("a"), joint("trunk", "a", "0 0 0", axis="0 0 1"), link("b", "0 0 0")]
    assert facts(*parts, joint("a", "b", "0 0 -0.3", "continuous")).limbs == ()
    assert len(facts(*parts, joint("a", "b", "0 0 -0.3")).limbs) == 1


def test_a_shank_that_turns_without_end_is_no_wheel():
    parts = limb("a", "0 0 0", kind="continuous")
    assert len(facts(parts).limbs) == 1


def test_a_wheel_at_the_end_of_a_leg():
    robot = facts(
        limb("leg", "0 0 0"),
        link("wheel", "0 0 0"),
        joint("leg1", "wheel", "0 0 -0.3", "continuous"),
    )
    assert len(robot.limbs[0].joints) == 3


# How much it looks like a leg

FOUR = [("x", "0.3 0.2 0"), ("y", "0.3 -0.2 0"), ("z", "-0.3 0.2 0"), ("w", "-0.3 -0.2 0")]


def test_what_stands_and_is_mirrored_is_a_leg_whatever_its_name():
    robot = facts(*(limb(name, root) for name, root in FOUR))
    assert set(scores(robot).values()) == {1.5}


def test_a_name_is_worth_half_a_point():
    robot = facts(*(limb(f"{name}_thigh", root) for name, root in FOUR))
    assert set(scores(robot).values()) == {2.0}
    assert all(each.has_leg_names for each in robot.limbs)


def test_one_limb_alone_is_not_mirrored():
    assert scores(facts(limb("a", "0 0 0"))) == {"a1": 1.0}
    assert scores(facts(limb("leg", "0 0 0"))) == {"leg1": 1.5}


def test_arms_are_not_legs():
    # Shorter than the legs and mirrored as well.
    legs = [limb(name, root) for name, root in FOUR[:2]]
    arms = [
        limb(name, root, (0.2, 0.15)) for name, root in (("p", "0 0.3 0.4"), ("q", "0 -0.3 0.4"))
    ]
    found = scores(facts(*legs, *arms, trunk=link("trunk", "0 0 0.5")))
    assert found == {"x1": 1.5, "y1": 1.5, "p1": 0.5, "q1": 0.5}


def test_arms_that_reach_the_ground_are_told_by_name():
    legs = [limb(f"{name}_leg", root) for name, root in FOUR[:2]]
    arms = [limb(f"{name}_arm", root) for name, root in FOUR[2:]]
    found = scores(facts(*legs, *arms))
    assert found == {"x_leg1": 2.0, "y_leg1": 2.0, "z_arm1": 0.5, "w_arm1": 0.5}


def test_arms_above_wheels_are_not_legs():
    # The lowest of all limbs, but half a metre above what the robot stands on.
    arms = [limb(name, root) for name, root in FOUR[:2]]
    base = link("trunk", "0 0 -1.4")
    assert set(scores(facts(*arms, trunk=base)).values()) == {0.5}


def test_legs_that_are_folded_at_zero_are_legs():
    # The belly is lower than the feet, but by less than half of the height.
    legs = [limb(f"{name}_leg", root, (0.2, 0.1)) for name, root in FOUR]
    belly = link("trunk", "0 0 -0.4")
    assert set(scores(facts(*legs, trunk=belly)).values()) == {2.0}


@pytest.mark.parametrize(("height", "score"), [(0.0, 1.5), (0.05, 1.5), (0.15, 1.0), (0.3, 0.5)])
def test_how_close_to_the_ground_a_foot_ends(height, score):
    # The robot is 1 m high.
    legs = [limb(name, root, (0.3, 0.28)) for name, root in FOUR[:2]]
    short = [limb(name, f"{root[:-1]} {height}", (0.3, 0.28)) for name, root in FOUR[2:]]
    robot = facts(*legs, *short, trunk=link("trunk", "0 0 0.38"))
    assert scores(robot)["z1"] == score


def test_one_joint_more_or_less_is_still_a_twin():
    robot = facts(limb("a", "0 0.2 0", (0.3, 0.3)), limb("b", "0 -0.2 0", (0.2, 0.2, 0.2)))
    assert scores(robot) == {"a1": 1.5, "b2": 1.5}


def test_front_and_rear_are_twins_too():
    robot = facts(limb("a", "0.3 0 0"), limb("b", "-0.3 0 0"))
    assert scores(robot) == {"a1": 1.5, "b1": 1.5}


def test_the_jaws_of_a_gripper_are_not_twins():
    arm = limb("a", "0 0 0", (0.4, 0.4))
    jaws = [
        link(name, "0 0 -0.1") + joint("a1", name, f"0 {y} -0.4")
        for name, y in (("p", 0.04), ("q", -0.04))
    ]
    assert set(scores(facts(arm, *jaws)).values()) == {1.0}


def test_a_robot_on_a_world_is_less_likely_to_walk():
    world = '<link name="world"/>' + link("trunk", mass=10)
    robot = facts(
        joint("world", "trunk", "0 0 1", "fixed"),
        *(limb(name, root) for name, root in FOUR),
        trunk=world,
    )
    assert set(scores(robot).values()) == {1.0}


# Words


@pytest.mark.parametrize(
    "name",
    [
        "FL_thigh", "left_hip_yaw", "LF_KFE", "RightKnee", "l_foot", "toe_fr", "Leg1", "lower_leg",
        "shank", "LLeg", "tibia", "coxa_rf", "left_sole", "hind_leg_shoulder_leg",
    ],
)  # fmt: skip
def test_names_of_legs(name):
    assert facts(limb(name, "0 0 0")).limbs[0].has_leg_names


@pytest.mark.parametrize(
    "name",
    [
        "left_elbow", "link_3", "allegro_thumb", "TorsoLeft", "chip", "ship", "console", "wrist",
        "finger_mcp", "wheel_mount", "front_shoulder", "allegro",
    ],
)  # fmt: skip
def test_names_of_others(name):
    assert not facts(limb(name, "0 0 0")).limbs[0].has_leg_names


@pytest.mark.parametrize("name", ["armature", "handle", "proprioception"])
def test_words_in_other_words_count_for_nothing(name):
    assert scores(facts(limb(name, "0 0 0"))) == {f"{name}1": 1.0}


def test_the_names_of_most_parts_decide():
    # An arm on a part that is called hip is an arm, a leg that begins at a shoulder a leg.
    def chain(first, second):
        return facts(
            link(first), joint("trunk", first, "0 0 0"), limb(second, "0 0 -0.1", parent=first)
        ).limbs[0]

    assert not chain("hip", "elbow").has_leg_names
    assert chain("shoulder", "foot").has_leg_names


# Limbs that share joints


def test_toes_are_one_leg():
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


def test_legs_below_a_waist_are_two():
    waist = link("w") + joint("trunk", "w", "0 0 -0.1", axis="0 0 1")
    robot = facts(waist, limb("a", "0 0.1 0", parent="w"), limb("b", "0 -0.1 0", parent="w"))
    one, other = robot.limbs
    assert not is_branch(one, other, 1.0)
    assert scores(robot) == {"a1": 1.5, "b1": 1.5}


def test_legs_behind_a_long_spine_are_two():
    spine, at = "", "trunk"
    for k in range(8):
        spine += link(f"s{k}") + joint(at, f"s{k}", "-0.05 0 0", axis="0 0 1")
        at = f"s{k}"
    robot = facts(
        spine, limb("a", "0 0.1 0", (0.3, 0.3, 0.1), at), limb("b", "0 -0.1 0", (0.3, 0.3, 0.1), at)
    )
    one, other = robot.limbs
    assert not is_branch(one, other, 1.0)


def test_a_rod_of_a_closed_loop_is_no_leg_of_its_own():
    # It hangs beside the knee, below two of the four joints of the leg.
    robot = facts(
        limb("a", "0 0 0", (0.05, 0.05, 0.4, 0.4)),
        link("rod"),
        link("rod1", "0 0 -0.6"),
        joint("a1", "rod", "0.05 0 -0.05"),
        joint("rod", "rod1", "0 0 -0.05"),
    )
    one, other = robot.limbs
    assert is_branch(one, other, 1.0)


def test_limbs_that_share_nothing_are_two():
    one, other = facts(limb("a", "0 0 0"), limb("b", "0 0.01 0")).limbs
    assert not is_branch(one, other, 1.0)


# Size


def test_a_snake_has_no_legs():
    assert facts(limb("a", "0 0 0", (0.01,) * 40)).limbs == ()


def test_thousands_of_limbs_are_no_trouble():
    parts = [limb(f"l{k}", f"{k * 0.01} 0 0") for k in range(600)]
    robot = facts(*parts)
    assert len(robot.bodies) == 1201
    assert len(robot.limbs) == 64


def test_a_chain_of_thousands_is_no_trouble():
    robot = facts(limb("a", "0 0 0", (0.001,) * 3000))
    assert len(robot.bodies) == 3001
    assert robot.limbs == ()

import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.legs import _pitch_axis, _roles, mean_length
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from tests.small_robots import ball, box, chain, facts, joint, link, shape
from tests.tables import read_table

DOG = ("roll", "hip", "knee")
HUMAN = ("hip", "roll", "yaw", "knee", "ankle", "roll")
LOOPED = ("yaw", "roll", "hip", "knee", "ankle")

QUADRUPED = ("FL_foot FR_foot RL_foot RR_foot", DOG, 0.448, 6)
BIPED = ("left_ankle_roll_link right_ankle_roll_link", HUMAN, 0.6998, 6)
TILTED = "left_front_foot right_front_foot left_rear_foot right_rear_foot"

# Feet, joints of each leg, leg length [m]: the declared distances from hip over knee and ankle to
# the contact, and the number of mirrored pairs.
KNOWN = {
    "tilted.urdf": (TILTED, DOG, 0.25 + 0.25 + 0.02, 6),
    "looped.xml": ("left_foot right_foot", LOOPED, 0.38 + 0.38 + math.hypot(0.03, 0.05), 6),
    "quadruped.urdf": QUADRUPED,
    "quadruped.xml": QUADRUPED,
    "biped.urdf": BIPED,
    "biped.xml": BIPED,
}


@pytest.mark.parametrize("name", KNOWN)
def test_legs_of_robots(name, robot_file):
    feet, roles, length, pairs = KNOWN[name]
    robot = Facts(load_robot(robot_file(name)))
    assert " ".join(leg.foot for leg in robot.legs) == feet
    assert {leg.roles for leg in robot.legs} == {roles}
    for leg in robot.legs:
        assert leg.length == pytest.approx(length, abs=0.002)
        np.testing.assert_allclose(leg.pitch, [0, 1, 0], atol=0.3)
        assert leg.limb.has_leg_names
        assert len(leg.joints) == len(roles)
    assert (robot.mirror.normal.tolist(), len(robot.mirror.pairs)) == ([0, 1, 0], pairs)
    assert robot.stance.margin > 0.02


def scaled(text, factor):
    powers = {"value": 3} | dict.fromkeys(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), 5)

    def scale(match):
        factors = [float(x) * factor ** powers.get(match[1], 1) for x in match[2].split()]
        return f'{match[1]}="{" ".join(map(repr, factors))}"'

    return re.sub(r'\b(xyz|size|radius|length|value|i[x-z]{2})="([^"]*)"', scale, text)


def renamed(text, word):
    names = re.findall(r'<(?:link|joint) name="(\w+)"', text)
    numbers = {name: f'"{word}_{k}"' for k, name in enumerate(names)}
    return re.sub(r'"(\w+)"', lambda match: numbers.get(match[1], match[0]), text)


def turned(text, yaw):
    (trunk,) = re.findall(r'<link name="(base|pelvis)"', text)
    turn = link("turned", mass=None) + joint("turned", trunk, kind="fixed", rpy=f"0 0 {yaw}")
    return text.replace("</robot>", f"{turn}</robot>")


@pytest.mark.parametrize("name", ["quadruped", "biped"])
@pytest.mark.parametrize(
    ("change", "value", "factor"),
    [
        (renamed, "part", 1),
        (turned, math.pi / 2, 1),
        (turned, math.pi, 1),
        (scaled, 0.2, 0.2),
        (scaled, 5.0, 5.0),
    ],
)
def test_legs_do_not_depend_on_names_heading_and_size(name, change, value, factor):
    text = bundled.urdf_path(name).read_text()
    before, after = facts(text), facts(change(text, value))
    assert [leg.roles for leg in after.legs] == [leg.roles for leg in before.legs]
    ours, theirs = ({frozenset((p.left, p.right)) for p in f.mirror.pairs} for f in (after, before))
    assert ours == theirs
    is_sideways = value == math.pi / 2
    assert after.mirror.normal.tolist() == ([1, 0, 0] if is_sideways else [0, 1, 0])
    # The size of the sole of a rounded foot depends on the scale.
    assert mean_length(after.legs) == pytest.approx(factor * mean_length(before.legs), rel=0.03)
    assert after.stance.height == pytest.approx(factor * before.stance.height, rel=0.03)
    assert after.stance.margin == pytest.approx(factor * before.stance.margin, abs=0.02 * factor)
    assert after.legs[0].limb.has_leg_names == (change is not renamed)


def test_limbs_that_carry_a_quadruped_are_legs_whatever_their_names_are():
    text = bundled.urdf_path("quadruped").read_text()
    for word in ("part", "arm", "shoulder", "wheel_head"):
        assert len(facts(renamed(text, word)).legs) == 4, word


BASE = link("base", box("0.5 0.3 0.1"))
COLUMN = link("base", box("0.3 0.3 1", "0 0 -0.5"))
SIGNS = [(1, 1), (1, -1), (-1, 1), (-1, -1)]


def arm(name, root):
    parts = link(f"{name}0", ball(0.05)) + joint("base", f"{name}0", root, "0 0 1")
    for k in range(1, 6):
        parts += link(f"{name}{k}", ball(0.05)) + joint(f"{name}{k - 1}", f"{name}{k}", "0.1 0 0.1")
    return parts


def jaw(name, y):
    return link(name, box("0.01 0.01 0.1")) + joint("arm5", name, f"0 {y} 0.05", kind="prismatic")


def steered_wheel(name, x, y):
    wheel = link(name, shape('cylinder radius="0.1" length="0.05"', rpy="1.5708 0 0"))
    column = link(f"c_{name}") + joint("base", f"c_{name}", f"{x * 0.3} {y * 0.2} -0.1", "0 0 1")
    return column + wheel + joint(f"c_{name}", name, kind="continuous")


def finger(name, x):
    return chain(name, f"{x} 0.02 -0.05", (0.05, 0.05), "palm")


@pytest.mark.parametrize(
    "parts",
    [
        [BASE, arm("arm", "0 0 0.1"), jaw("p", 0.03), jaw("q", -0.03)],
        [COLUMN, arm("a", "0 0.2 0"), arm("b", "0 -0.2 0")],
        [BASE, *(steered_wheel(f"p{x}{y}", x, y) for x, y in SIGNS)],
        [link("palm"), *(finger(f"f{x}", x) for x in (-0.03, 0, 0.03))],
    ],
    ids=["arm", "two arms", "car", "hand"],
)
def test_robot_without_legs(parts):
    assert facts(*parts).legs == ()


TRUNK = link("trunk", box("0.5 0.3 0.1"))
ROOTS = {name: f"{x * 0.3} {y * 0.2} 0" for name, (x, y) in zip("pqrs", SIGNS, strict=True)}


def table(leg=lambda name, root: chain(name, root, (0.25, 0.2)), **other):
    """Return a robot of four legs, some of which are other ones."""
    legs = {name: leg(name, root) for name, root in ROOTS.items()} | other
    return facts(TRUNK, *legs.values())


def feet(robot):
    return [leg.foot for leg in robot.legs]


def test_leg_of_two_joints():
    found = table().legs
    assert [leg.foot for leg in found] == ["p1", "q1", "r1", "s1"]
    assert [leg.roles for leg in found] == [("hip", "knee")] * 4
    assert [leg.length for leg in found] == pytest.approx([0.25 + 0.22] * 4)
    assert found[0].pitch.tolist() == [0, 1, 0]
    assert [found[0].joint(role) for role in ("knee", "ankle")] == [found[0].joints[1], None]


@pytest.mark.parametrize(
    ("lengths", "counts"), [((0.25, 0.2), [2, 2, 2]), ((0.2, 0.2, 0.1), [3, 3, 3, 2])]
)
def test_one_joint_of_a_leg_may_be_fixed_if_two_are_left(lengths, counts):
    last = f's{len(lengths) - 1}_joint" type='
    stiff = chain("s", ROOTS["s"], lengths).replace(f'{last}"revolute"', f'{last}"fixed"')
    found = table(lambda name, root: chain(name, root, lengths), s=stiff).legs
    assert [len(leg.joints) for leg in found] == counts


@pytest.mark.parametrize(
    ("name", "z", "expected"),
    [("p_back", -0.21, "p_back"), ("p_back", -0.19, "p_front"), ("toe", -0.19, "toe")],
)
def test_leg_with_toes_ends_at_the_lowest_or_best_named_one(name, z, expected):
    toes = chain("p", ROOTS["p"], (0.25, 0.2)).replace(ball(0.02, "0 0 -0.2"), "")
    for toe, place in (("p_front", "-0.03 0 -0.2"), (name, f"0.03 0 {z}")):
        toes += link(toe, ball(0.01)) + joint("p1", toe, place)
    assert feet(table(p=toes)) == [expected, "q1", "r1", "s1"]


@pytest.mark.parametrize("heights", [(0.2, 0.2), (0.2, 0.21), (0.21, 0.2)])
def test_parts_of_split_soles_are_the_same_on_both_sides(heights):
    parts = [TRUNK]
    for name, order in zip("abcd", ((0, 1), (1, 0), (0, 1), (1, 0)), strict=True):
        x, y, _ = map(float, dict(zip("abcd", ROOTS.values(), strict=True))[name].split())
        parts += [chain(name, f"{x} {y} 0", (0.25, 0.2)).replace(ball(0.02, "0 0 -0.2"), "")]
        for k in order:
            place = f"{x / 10 * (1 - 2 * k)} 0 {-heights[k]}"
            sole = f"{name}_{('front', 'rear')[k]}"
            parts += [link(sole, ball(0.01)), joint(f"{name}1", sole, place, kind="fixed")]
    end = "rear" if heights[1] > heights[0] else "front"
    assert feet(facts(*parts)) == [f"{name}_{end}" for name in "abcd"]


BALL, DRAWN, SHANK = ball(0.02), ball(0.02, kind="visual"), box("0.04 0.04 0.1", "0 0 -0.1")


@pytest.mark.parametrize(
    ("shank", "ends", "foot"),
    [
        # The link that touches, not the frame of a sensor in its sole.
        (SHANK, [("ball", -0.2, BALL), ("foot_imu", -0.22, "")], "ball"),
        ("", [("pad", -0.2, BALL), ("sole", -0.2, BALL)], "sole"),  # the name of a foot
        ("", [("drawn", -0.2, DRAWN), ("pad", -0.2, BALL)], "pad"),
        ("", [("end", -0.2, "")], "end"),
        (SHANK, [("foot", -0.15, DRAWN)], "foot"),
        (SHANK, [("x", -0.15, DRAWN)], "b"),
    ],
)
def test_foot_of_a_leg(shank, ends, foot):
    parts = [TRUNK]
    for name, root in ROOTS.items():
        a, b = f"{name}_a", f"{name}_b"
        parts += [link(a, mass=None), joint("trunk", a, root)]
        parts += [link(b, shank, mass=None), joint(a, b, "0 0 -0.25")]
        for end, z, part in ends:
            parts += [link(f"{name}_{end}", part, mass=None)]
            parts += [joint(b, f"{name}_{end}", f"0 0 {z}", kind="fixed")]
    assert feet(facts(*parts)) == [f"{name}_{foot}" for name in "pqrs"]


@pytest.mark.parametrize("by_spec", [False, True])
def test_named_feet_end_legs(by_spec):
    # A limb that ends far above the ground is found only if its foot is named.
    robot = facts(TRUNK, chain("a", "0 0 1", (0.2, 0.2)), chain("b", "0 0 0", (0.1,)))
    assert robot.legs == ()
    named = ("a1",)
    model = robot.model if by_spec else replace(robot.model, feet=named)
    spec = SimpleNamespace(feet=named) if by_spec else None
    assert feet(Facts(model, spec=spec)) == ["a1"]


def pair(lengths=(0.25, 0.2), parent="trunk", axes=()):
    """Return the text of a left and a right leg."""
    sides = (("a", 0.1), ("b", -0.1))
    return "".join(chain(n, f"0 {y} 0", lengths, parent, axes=axes) for n, y in sides)


def test_waist_is_no_leg_joint():
    waist = link("pelvis") + joint("trunk", "pelvis", "0 0 -0.1")
    found = facts(TRUNK, waist, pair(parent="pelvis")).legs
    assert [leg.roles for leg in found] == [("waist", "hip", "knee")] * 2
    assert [leg.joint("hip").name for leg in found] == ["a0_joint", "b0_joint"]
    assert [leg.length for leg in found] == pytest.approx([0.47] * 2)


# The bodies are at y = 0.1 to -0.1117 and z = 0 to -0.1: 5 % of their diagonal are 0.0117 m.
@pytest.mark.parametrize(("error", "count"), [(0.0115, 2), (0.0119, 1)])
def test_legs_below_a_waist_are_mirrored_within_a_share_of_the_size(error, count):
    waist = link("pelvis") + joint("trunk", "pelvis", "0 0 -0.1")
    legs = pair((0.4,), "pelvis").replace("0 -0.1 0", f"0 {-0.1 - error} 0")
    assert len(facts(TRUNK, waist, legs).legs) == count


def test_leg_with_prismatic_joint():
    text = pair((0.2, 0.2)).replace('1_joint" type="revolute"', '1_joint" type="prismatic"')
    robot = facts(TRUNK, text)
    assert [leg.roles for leg in robot.legs] == [("hip", "slide")] * 2
    assert [leg.length for leg in robot.legs] == pytest.approx([0.42] * 2)
    assert set(robot.stance.positions.values()) == {0.0}  # nothing to bend


def test_radial_legs_may_be_copies_that_are_no_mirror_images():
    # Each leg is turned by 20 degrees from the radius, and its foot is above the belly.
    parts = [link("trunk", box("0.2 0.2 0.1"), mass=5)]
    for k in range(6):
        x, y = 0.1 * math.cos(math.pi * k / 3), 0.1 * math.sin(math.pi * k / 3)
        turn = math.pi * k / 3 + 0.35
        parts += [link(f"a{k}"), link(f"b{k}"), link(f"c{k}", ball(0.01, "0.1 0 0.02"))]
        parts += [joint("trunk", f"a{k}", f"{x} {y} 0", "0 0 1", rpy=f"0 0 {turn}")]
        parts += [joint(f"a{k}", f"b{k}"), joint(f"b{k}", f"c{k}", "0.1 0 0")]
    assert [leg.foot for leg in facts(*parts).legs] == [f"c{k}" for k in range(6)]
    # Of three such limbs, one is an arm as likely as a leg.
    assert facts(*parts[:1], *parts[1:7], *parts[13:19], *parts[25:31]).legs == ()


def test_foot_that_carries_rods_ends_the_leg():
    rods = [
        link(f"{n}_{k}", ball(0.01, "0 0 0.1")) + joint(f"{n}1", f"{n}_{k}", f"{x} 0 -0.2")
        for n in "ab"
        for k, x in (("front", 0.05), ("rear", -0.05))
    ]
    legs = [chain("a", "0 0.2 0", (0.3, 0.3)), chain("b", "0 -0.2 0", (0.3, 0.3))]
    robot = facts(TRUNK, *legs, *rods)
    assert [leg.foot for leg in robot.legs] == ["a1", "b1"]
    assert {robot.bodies[limb.chain[-1]].name for limb in robot.limbs} == {"a1", "b1"}


def test_legs_of_eight_legged_spider():
    # Radial legs, each of which bends about its own horizontal axis.
    parts = [TRUNK]
    for k in range(8):
        angle = 2 * math.pi * (k + 0.5) / 8
        x, y = 0.1 * math.cos(angle), 0.1 * math.sin(angle)
        parts += [link(f"a{k}"), joint("trunk", f"a{k}", f"{x} {y} 0", f"{-y} {x} 0")]
        parts += [link(f"b{k}", ball(0.01, f"{x} {y} -0.2"))]
        parts += [joint(f"a{k}", f"b{k}", f"{x} {y} 0", f"{-y} {x} 0")]
    robot = facts(*parts)
    assert [leg.roles for leg in robot.legs] == [("hip", "knee")] * 8
    assert robot.stance.margin > 0.09


# Legs of 0.2 m, stretched sideways at zero: they reach as far below the hips.
@pytest.mark.parametrize(("belly", "count"), [(0.199, 4), (0.201, 0)])
def test_legs_that_are_stretched_sideways_at_zero(belly, count):
    parts = [link("trunk", box("0.4 0.2 0.02", f"0 0 {0.01 - belly}"), mass=5)]
    for name, x, y in (("a", 0.2, 1), ("b", 0.2, -1), ("c", -0.2, 1), ("d", -0.2, -1)):
        parts += [link(f"{name}_coxa"), joint("trunk", f"{name}_coxa", f"{x} {0.1 * y} 0", "0 0 1")]
        parts += [link(f"{name}_femur")]
        parts += [joint(f"{name}_coxa", f"{name}_femur", "0 0 0", "1 0 0")]
        parts += [link(f"{name}_tibia", ball(1e-6, f"0 {0.1 * y} 0"))]
        parts += [joint(f"{name}_femur", f"{name}_tibia", f"0 {0.1 * y} 0", "1 0 0")]
    legs = facts(*parts).legs
    assert [leg.roles for leg in legs] == [("yaw", "hip", "knee")] * count


X, Y, Z = np.eye(3)


def tilted(degrees, axis=Y, other=Z):
    angle = math.radians(degrees)
    return math.cos(angle) * axis + math.sin(angle) * other


@pytest.mark.parametrize(("axes", "roles"), read_table(__file__, "roles_follow_axes"))
def test_roles_follow_axes(axes, roles):
    # The last two links have 0.2 and 0.1 m; the other joints are at one point.
    lengths = (*[1e-9] * (len(axes) - 3), 0.2, 0.2, 0.1)[-len(axes) :]
    found = facts(TRUNK, pair(lengths, axes=axes)).legs
    assert [" ".join(leg.roles) for leg in found] == [roles] * 2


@pytest.mark.parametrize(("heights", "roles"), read_table(__file__, "knee_is_the_joint_closest"))
def test_knee_is_the_joint_closest_to_the_middle(heights, roles):
    path = [np.array([0, 0, -height]) for height in heights]
    bending = range(len(path) - 1)
    assert " ".join(_roles([Y] * len(bending), bending, path, [""] * len(bending))) == roles


# The third joint halves the leg of 0.5 m: 0.26 and 0.24 m, and the second one 0.22 and 0.28 m, so
# that the gap is 0.04 m; with 0.205 and 0.295 m it is 0.07 m.
@pytest.mark.parametrize(("height", "roles"), [(0.22, "hip knee ankle"), (0.205, "hip hip knee")])
def test_name_decides_between_knees_up_to_a_tenth_of_the_leg(height, roles):
    path = [np.array([0, 0, -height]) for height in (0, height, 0.26, 0.5)]
    assert " ".join(_roles([Y] * 3, range(3), path, ["a", "left_knee", "b"])) == roles


def test_picture_of_a_linkage_is_no_leg():
    # Rods beside each leg, with visuals only.
    rods = chain("c", "0 0.12 0", (0.2, 0.2)) + chain("d", "0 -0.12 0", (0.2, 0.2))
    rods = re.sub(r"<(inertial|collision)>.*?</\1>", "", rods, flags=re.S)
    assert [leg.foot for leg in facts(TRUNK, pair((0.2, 0.2)), rods).legs] == ["a1", "b1"]


@pytest.mark.parametrize(
    ("axes", "expected"),
    [
        ([X, Y, Y], Y),
        ([X, X, Y], X),
        ([X, Y], Y),  # the more lateral one of two
        ([-X], X),
        ([-Y], Y),
        ([Z], Y),  # no horizontal one
        # Each counts by the square of its cosine.
        ([X, tilted(44), tilted(44)], Y),
        ([X, tilted(46), tilted(46)], X),
        ([X, tilted(59)], X),
        ([X, tilted(25, X, -Y), tilted(25, X, Y)], X),
    ],
)
def test_pitch_axis(axes, expected):
    np.testing.assert_allclose(_pitch_axis(axes), expected, atol=1e-12)


def test_mean_length():
    assert mean_length([SimpleNamespace(length=x) for x in (0.2, 0.5)]) == 0.35

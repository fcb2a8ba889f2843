import copy
import math
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot

FILE = Path("/robots/robot.urdf")

DOG = ("roll", "hip", "knee")
HUMAN = ("hip", "roll", "yaw", "knee", "ankle", "roll")

# Feet, joints of each leg, and leg length [m]: the declared distances from hip over knee
# and ankle to the contact.
KNOWN = {
    "a1/urdf/a1.urdf": (["FR_foot", "FL_foot", "RR_foot", "RL_foot"], DOG, 0.2 + 0.2 + 0.02),
    "go2/urdf/go2.urdf": (["FL_foot", "FR_foot", "RL_foot", "RR_foot"], DOG, 2 * 0.213 + 0.022),
    "go2_mjcf/go2.xml": (["FL_calf", "FR_calf", "RL_calf", "RR_calf"], DOG, 2 * 0.213 + 0.022),
    "anymal_c/urdf/anymal_c.urdf": (["LF_FOOT", "RF_FOOT", "LH_FOOT", "RH_FOOT"], DOG, 0.6415),
    "h1/urdf/h1.urdf": (
        ["left_ankle_link", "right_ankle_link"],
        ("yaw", "roll", "hip", "knee", "ankle"),
        0.4 + 0.4 + 0.074,
    ),
    "h1/h1.xml": (
        ["left_ankle_link", "right_ankle_link"],
        ("yaw", "roll", "hip", "knee", "ankle"),
        0.4 + 0.4 + 0.074,
    ),
    "g1/g1_29dof.urdf": (["left_ankle_roll_link", "right_ankle_roll_link"], HUMAN, 0.6998),
    "g1/g1_29dof.xml": (["left_ankle_roll_link", "right_ankle_roll_link"], HUMAN, 0.6998),
    "cassie/urdf/cassie.urdf": (
        ["left_toe", "right_toe"],
        ("roll", "yaw", "hip", "hip", "knee", "ankle"),
        1.0517,
    ),
    "quadruped.urdf": (["FL_foot", "FR_foot", "RL_foot", "RR_foot"], DOG, 0.448),
    "quadruped.xml": (["FL_foot", "FR_foot", "RL_foot", "RR_foot"], DOG, 0.448),
    "biped.urdf": (["left_ankle_roll_link", "right_ankle_roll_link"], HUMAN, 0.6998),
    "biped.xml": (["left_ankle_roll_link", "right_ankle_roll_link"], HUMAN, 0.6998),
}
URDFS = [name for name in KNOWN if name.endswith(".urdf")]


def facts(text, file=FILE):
    return Facts(
        load_robot(file, contents={file: text if isinstance(text, bytes) else text.encode()})
    )


@pytest.mark.parametrize("name", KNOWN)
def test_legs_of_published_robots(name, robot_file):
    feet, roles, length = KNOWN[name]
    legs = Facts(load_robot(robot_file(name))).legs
    assert [leg.foot for leg in legs] == feet
    assert {leg.roles for leg in legs} == {roles}
    for leg in legs:
        assert leg.length == pytest.approx(length, abs=0.002)
        np.testing.assert_allclose(leg.pitch, [0, 1, 0], atol=0.3)
        assert leg.limb.has_leg_names
        assert len(leg.joints) == len(roles)


def test_leg_joint_by_role(robot_file):
    leg = Facts(load_robot(robot_file("h1/urdf/h1.urdf"))).legs[0]
    assert leg.joint("yaw").name == "left_hip_yaw_joint"
    assert leg.joint("hip").name == "left_hip_pitch_joint"
    assert leg.joint("knee").name == "left_knee_joint"
    assert leg.joint("ankle").name == "left_ankle_joint"
    assert leg.joint("slide") is None


# Invariance


def scaled(root, factor):
    for element in root.iter():
        names = {"origin": ["xyz"], "box": ["size"], "sphere": ["radius"], "mesh": ["scale"]}
        names |= {"cylinder": ["radius", "length"], "mass": ["value"], "inertia": element.keys()}
        power = {"mass": 3, "inertia": 5}.get(element.tag, 1)
        if element.tag == "mesh":
            element.set("scale", element.get("scale", "1 1 1"))
        for name in names.get(element.tag, []):
            values = [repr(float(x) * factor**power) for x in element.get(name, "0 0 0").split()]
            element.set(name, " ".join(values))


def renamed(root):
    """Replace all names by numbers."""
    links = {e.get("name"): f"link_{k}" for k, e in enumerate(root.findall("link"))}
    for element in root.findall("link"):
        element.set("name", links[element.get("name")])
    for number, element in enumerate(root.findall("joint")):
        element.set("name", f"joint_{number}")
        for end in (element.find("parent"), element.find("child")):
            end.set("link", links[end.get("link")])


def turned(root, yaw):
    children = {child.get("link") for child in root.iter("child")}
    (trunk,) = [e.get("name") for e in root.findall("link") if e.get("name") not in children]
    root.insert(0, etree.fromstring('<link name="turned"/>'))
    root.append(
        etree.fromstring(
            f'<joint name="turn" type="fixed"><origin rpy="0 0 {yaw}"/><parent link="turned"/>'
            f'<child link="{trunk}"/></joint>'
        )
    )


@pytest.fixture(scope="module")
def original(robot_file):
    """Return facts of a URDF before and after a change. Files are parsed once."""
    read = {}

    def parsed(name):
        if name not in read:
            path = robot_file(name)
            root = etree.parse(str(path)).getroot()
            for visual in list(root.iter("visual")):
                visual.getparent().remove(visual)
            read[name] = path, root, Facts(load_robot(path, contents={path: etree.tostring(root)}))
        return read[name]

    def changed(name, change, *arguments):
        path, root, before = parsed(name)
        root = copy.deepcopy(root)
        change(root, *arguments)
        return before, facts(etree.tostring(root), path)

    return changed


@pytest.mark.parametrize("name", URDFS)
def test_legs_do_not_depend_on_names(name, original):
    before, after = original(name, renamed)
    assert [leg.limb.chain for leg in after.legs] == [leg.limb.chain for leg in before.legs]
    assert [leg.roles for leg in after.legs] == [leg.roles for leg in before.legs]
    assert [leg.length for leg in after.legs] == pytest.approx([leg.length for leg in before.legs])
    ours, theirs = ([(p.left, p.right, p.sign) for p in f.mirror.pairs] for f in (after, before))
    assert ours == theirs
    assert after.stance.height == pytest.approx(before.stance.height)


@pytest.mark.parametrize("name", URDFS)
@pytest.mark.parametrize("yaw", [math.pi / 2, math.pi])
def test_legs_do_not_depend_on_heading(name, yaw, original):
    before, after = original(name, turned, yaw)
    assert [leg.foot for leg in after.legs] == [leg.foot for leg in before.legs]
    assert [leg.roles for leg in after.legs] == [leg.roles for leg in before.legs]
    assert [leg.length for leg in after.legs] == pytest.approx([leg.length for leg in before.legs])
    ours, theirs = ([{p.left, p.right} for p in f.mirror.pairs] for f in (after, before))
    assert sorted(map(sorted, ours)) == sorted(map(sorted, theirs))
    sideways = abs(math.sin(yaw)) > 0.5
    assert after.mirror.normal.tolist() == ([1, 0, 0] if sideways else [0, 1, 0])
    assert after.stance.height == pytest.approx(before.stance.height, abs=0.01)
    assert after.stance.margin == pytest.approx(before.stance.margin, abs=0.01)


@pytest.mark.parametrize("name", ["a1/urdf/a1.urdf", "cassie/urdf/cassie.urdf", "quadruped.urdf"])
@pytest.mark.parametrize("factor", [0.2, 5.0])
def test_legs_do_not_depend_on_size(name, factor, original):
    before, after = original(name, scaled, factor)
    assert [leg.foot for leg in after.legs] == [leg.foot for leg in before.legs]
    assert [leg.roles for leg in after.legs] == [leg.roles for leg in before.legs]
    # The size of the sole of a rounded foot depends on the scale.
    for ours, theirs in zip(after.legs, before.legs, strict=True):
        assert ours.length == pytest.approx(factor * theirs.length, rel=0.03)
    assert after.stance.height == pytest.approx(factor * before.stance.height, rel=0.03)


# Robots without legs


def link(name, shape="", origin=""):
    geometry = f"<collision><origin {origin}/><geometry>{shape}</geometry></collision>"
    inertial = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
    return f'<link name="{name}">{inertial}{geometry if shape else ""}</link>'


def joint(parent, child, xyz, axis="0 1 0", kind="revolute"):
    return (
        f'<joint name="{child}_joint" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{child}"/><origin xyz="{xyz}"/><axis xyz="{axis}"/></joint>'
    )


def robot(*parts):
    return facts(f'<robot name="r">{"".join(parts)}</robot>')


def arm(prefix, parent, root, joints=6):
    parts, at = [], parent
    for k in range(joints):
        child = f"{prefix}{k}"
        xyz, axis = (root, "0 0 1") if k == 0 else ("0.1 0 0.1", "0 1 0")
        parts += [link(child, '<sphere radius="0.05"/>'), joint(at, child, xyz, axis)]
        at = child
    return "".join(parts)


BOX = '<box size="0.5 0.3 0.1"/>'


def test_legs_of_arm_are_empty():
    assert robot(link("base", BOX), arm("link_", "base", "0 0 0.1")).legs == ()


def test_legs_of_arm_with_gripper_are_empty():
    jaws = "".join(
        link(f"jaw{k}", '<box size="0.01 0.01 0.1"/>')
        + joint("link_5", f"jaw{k}", f"0 {y} 0.05", "0 1 0", "prismatic")
        for k, y in enumerate((0.03, -0.03))
    )
    assert robot(link("base", BOX), arm("link_", "base", "0 0 0.1"), jaws).legs == ()


def test_legs_of_two_arms_are_empty():
    base = link("base", '<cylinder radius="0.2" length="1"/>', 'xyz="0 0 -0.5"')
    arms = arm("a", "base", "0 0.2 0") + arm("b", "base", "0 -0.2 0")
    assert robot(base, arms).legs == ()


def test_legs_of_drone_are_empty():
    rotors = "".join(
        link(f"rotor{k}", '<cylinder radius="0.1" length="0.01"/>')
        + joint("base", f"rotor{k}", f"{x} {y} 0", "0 0 1", "continuous")
        for k, (x, y) in enumerate([(1, 1), (1, -1), (-1, 1), (-1, -1)])
    )
    assert robot(link("base", BOX), rotors).legs == ()


@pytest.mark.parametrize("name", ["wheel", "part"])
def test_legs_of_steered_car_are_empty(name):
    wheels = "".join(
        link(f"column{k}")
        + joint("base", f"column{k}", f"{x} {y} -0.1", "0 0 1")
        + link(f"{name}{k}", '<cylinder radius="0.1" length="0.05"/>', 'rpy="1.5708 0 0"')
        + joint(f"column{k}", f"{name}{k}", "0 0 0", "0 1 0", "continuous")
        for k, (x, y) in enumerate([(0.3, 0.2), (0.3, -0.2), (-0.3, 0.2), (-0.3, -0.2)])
    )
    assert robot(link("base", BOX), wheels).legs == ()


def test_legs_of_hand_are_empty():
    fingers = "".join(
        link(f"finger{k}_a")
        + joint("palm", f"finger{k}_a", f"{x} 0.02 -0.05")
        + link(f"finger{k}_b", '<box size="0.01 0.01 0.05"/>', 'xyz="0 0 -0.02"')
        + joint(f"finger{k}_a", f"finger{k}_b", "0 0 -0.05")
        for k, x in enumerate((-0.03, 0, 0.03))
    )
    assert robot(link("palm", '<box size="0.1 0.1 0.03"/>'), fingers).legs == ()


# Parts of legs


def leg(name, root, parent="trunk", foot='<sphere radius="0.02"/>'):
    """Return a leg of a hip and a knee, 0.25 m and 0.2 m long, without the foot's shape."""
    return (
        link(f"{name}_a", '<box size="0.04 0.04 0.1"/>')
        + link(f"{name}_b", foot, 'xyz="0 0 -0.2"')
        + joint(parent, f"{name}_a", root)
        + joint(f"{name}_a", f"{name}_b", "0 0 -0.25")
    )


CORNERS = {"p": "0.3 0.2 0", "q": "0.3 -0.2 0", "r": "-0.3 0.2 0", "s": "-0.3 -0.2 0"}


def table(**other):
    legs = {name: leg(name, root) for name, root in CORNERS.items()} | other
    return robot(link("trunk", BOX), *legs.values())


def test_leg_of_two_joints():
    found = table().legs
    assert [each.foot for each in found] == ["p_b", "q_b", "r_b", "s_b"]
    assert {each.roles for each in found} == {("hip", "knee")}
    assert [each.length for each in found] == pytest.approx([0.25 + 0.22] * 4)
    assert found[0].pitch.tolist() == [0, 1, 0]


def test_legs_with_a_fixed_joint():
    stiff = leg("s", CORNERS["s"]).replace(
        '<joint name="s_b_joint" type="revolute">', '<joint name="s_b_joint" type="fixed">'
    )
    # One joint is too few for a limb.
    assert len(table(s=stiff).legs) == 3
    longer = {
        name: leg(name, root)
        + link(f"{name}_c", '<sphere radius="0.02"/>')
        + joint(f"{name}_b", f"{name}_c", "0 0 -0.21")
        for name, root in CORNERS.items()
    }
    longer["s"] = longer["s"].replace(
        '<joint name="s_c_joint" type="revolute">', '<joint name="s_c_joint" type="fixed">'
    )
    assert sorted(len(each.joints) for each in table(**longer).legs) == [2, 3, 3, 3]


def test_leg_with_toes_is_one_leg():
    toes = leg("p", CORNERS["p"]) + "".join(
        link(f"p_{side}", '<sphere radius="0.01"/>') + joint("p_b", f"p_{side}", f"{x} 0 -0.21")
        for side, x in (("front", 0.03), ("back", -0.03))
    )
    found = table(p=toes).legs
    assert len(found) == 4
    assert {"p_front", "p_back"} & {each.foot for each in found}


def test_foot_is_the_link_that_touches():
    # A separate foot link, and the frame of a sensor in its sole.
    parts = {}
    for name, root in CORNERS.items():
        ankle = f"{name}_b"
        parts[name] = (
            link(f"{name}_a")
            + link(ankle, '<box size="0.04 0.04 0.1"/>', 'xyz="0 0 -0.1"')
            + joint("trunk", f"{name}_a", root)
            + joint(f"{name}_a", ankle, "0 0 -0.25")
            + link(f"{name}_ball", '<sphere radius="0.02"/>')
            + joint(ankle, f"{name}_ball", "0 0 -0.2", kind="fixed")
            + f'<link name="{name}_foot_imu"/>'
            + joint(f"{name}_ball", f"{name}_foot_imu", "0 0 -0.02", kind="fixed")
        )
    found = table(**parts).legs
    assert [each.foot for each in found] == ["p_ball", "q_ball", "r_ball", "s_ball"]


def test_foot_without_collision_shape_is_kept():
    drawn = '<visual><geometry><sphere radius="0.02"/></geometry></visual>'
    parts = {
        name: link(f"{name}_a")
        + link(f"{name}_b", '<box size="0.04 0.04 0.1"/>', 'xyz="0 0 -0.1"')
        + joint("trunk", f"{name}_a", root)
        + joint(f"{name}_a", f"{name}_b", "0 0 -0.25")
        + f'<link name="{name}_foot">{drawn}</link>'
        + joint(f"{name}_b", f"{name}_foot", "0 0 -0.15", kind="fixed")
        for name, root in CORNERS.items()
    }
    assert [each.foot for each in table(**parts).legs] == ["p_foot", "q_foot", "r_foot", "s_foot"]


def test_foot_without_shapes_is_a_frame():
    parts = {
        name: f'<link name="{name}_a"/><link name="{name}_b"/><link name="{name}_end"/>'
        + joint("trunk", f"{name}_a", root)
        + joint(f"{name}_a", f"{name}_b", "0 0 -0.25")
        + joint(f"{name}_b", f"{name}_end", "0 0 -0.2", kind="fixed")
        for name, root in CORNERS.items()
    }
    assert [each.foot for each in table(**parts).legs] == ["p_end", "q_end", "r_end", "s_end"]


def test_waist_is_no_leg_joint():
    found = robot(
        link("trunk", BOX),
        link("pelvis"),
        joint("trunk", "pelvis", "0 0 -0.1", "0 1 0"),
        *(leg(name, f"0 {y} -0.05", "pelvis") for name, y in (("p", 0.1), ("q", -0.1))),
    ).legs
    assert [each.roles for each in found] == [("waist", "hip", "knee")] * 2
    assert [each.joint("hip").name for each in found] == ["p_a_joint", "q_a_joint"]
    assert [each.length for each in found] == pytest.approx([0.47] * 2)


def test_leg_with_prismatic_joint():
    found = robot(
        link("trunk", BOX),
        *(
            link(f"{n}_a")
            + link(f"{n}_b", '<sphere radius="0.02"/>', 'xyz="0 0 -0.2"')
            + joint("trunk", f"{n}_a", f"0 {y} 0")
            + joint(f"{n}_a", f"{n}_b", "0 0 -0.2", "0 0 1", "prismatic")
            for n, y in (("p", 0.1), ("q", -0.1))
        ),
    ).legs
    assert [each.roles for each in found] == [("hip", "slide")] * 2
    assert [each.length for each in found] == pytest.approx([0.42] * 2)


@pytest.mark.parametrize(
    ("axes", "roles"),
    [
        (("1 0 0", "0 1 0", "0 1 0"), ("roll", "hip", "knee")),
        (("0 0 1", "0 1 0", "0 1 0"), ("yaw", "hip", "knee")),
        (("0 0 1", "1 0 0", "0 1 0", "0 1 0", "0 1 0"), ("yaw", "roll", "hip", "knee", "ankle")),
        (("0 1 0", "1 0 0", "0 1 0"), ("hip", "roll", "knee")),
        (("0 -1 0", "0 1 0"), ("hip", "knee")),
        (
            ("0 0.866 0.5", "1 0 0", "0 0 1", "0 1 0", "0 1 0"),
            ("hip", "roll", "yaw", "knee", "ankle"),
        ),
    ],
)
def test_roles_follow_axes(axes, roles):
    # The last three joints are 0.2 m apart, the others are at one point.
    def chain(name, y):
        parts, at = [], "trunk"
        for k, axis in enumerate(axes):
            xyz = f"0 {y} 0" if k == 0 else "0 0 -0.2" if k >= len(axes) - 2 else "0 0 0"
            parts += [link(f"{name}{k}"), joint(at, f"{name}{k}", xyz, axis)]
            at = f"{name}{k}"
        foot = link(f"{name}_foot", '<sphere radius="0.02"/>')
        return "".join(parts) + foot + joint(at, f"{name}_foot", "0 0 -0.1", kind="fixed")

    found = robot(link("trunk", BOX), chain("a", 0.1), chain("b", -0.1)).legs
    assert [each.roles for each in found] == [roles] * 2


def test_legs_of_eight_legged_spider():
    # Radial legs, each of which bends about its own horizontal axis.
    parts = []
    for k in range(8):
        angle = 2 * math.pi * (k + 0.5) / 8
        x, y = math.cos(angle), math.sin(angle)
        parts.append(
            link(f"a{k}")
            + link(f"b{k}", '<sphere radius="0.01"/>', f'xyz="{0.1 * x} {0.1 * y} -0.2"')
            + joint("trunk", f"a{k}", f"{0.1 * x} {0.1 * y} 0", f"{-y} {x} 0")
            + joint(f"a{k}", f"b{k}", f"{0.1 * x} {0.1 * y} 0", f"{-y} {x} 0")
        )
    robot_of_eight = robot(link("trunk", BOX), *parts)
    assert len(robot_of_eight.legs) == 8
    assert {each.roles for each in robot_of_eight.legs} == {("hip", "knee")}
    assert robot_of_eight.stance.margin > 0.09

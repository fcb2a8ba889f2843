import mujoco
import numpy as np
import pytest

from tests.tables import read_table
from tests.terrainkit_robots.description import made_robots
from tests.terrainkit_robots.description.made_robots import body, codes, joint, link, mjcf, read
from tests.terrainkit_robots.description.mjcf.test_compiled_bodies import EVERYTHING


def test_joints_connect_links_in_document_order():
    """Links between the joints of one body are virtual, and a body without joints is fixed."""
    robot = read(EVERYTHING)
    assert robot.name == "everything"
    assert [each.name for each in robot.links if each.virtual] == ["leg:swing", "leg:lift"]
    fins = [f"fin{k}" for k in range(3)]
    assert [(each.name, each.kind, each.parent, each.child) for each in robot.joints] == [
        ("root", "floating", "world", "trunk"),
        ("in_frame", "revolute", "trunk", "framed"),
        ("swing", "revolute", "trunk", "leg:swing"),
        ("lift", "revolute", "leg:swing", "leg:lift"),
        ("slide", "prismatic", "leg:lift", "leg"),
        ("foot_fixed", "fixed", "leg", "foot"),
        ("wrist", "ball", "leg", "hand"),
        *((each.replace("fin", "flap"), "revolute", "trunk", each) for each in fins),
        ("post_fixed", "fixed", "world", "post"),
    ]
    lines = EVERYTHING.splitlines()
    assert all('<body name="fin">' in lines[link(robot, fin).source.line - 1] for fin in fins)
    virtual = link(robot, "leg:swing").source.line
    assert virtual == joint(robot, "swing").source.line == link(robot, "leg").source.line + 1


def test_unnamed_elements_get_names():
    robot = read(mjcf("<body><freejoint/><body><joint/><joint/></body><body/></body>"))
    first, second, third = (f"unnamed_body_{k}" for k in (1, 2, 3))
    assert [each.name for each in robot.links] == [first, f"{second}:{second}_joint", second, third]
    joints = [f"{first}_joint", f"{second}_joint", f"{second}_joint_2", f"{third}_fixed"]
    assert [each.name for each in robot.joints] == joints


def test_generated_names_are_unused():
    robot = read(
        mjcf(
            '<body name="a:j"/><body name="a"><joint name="j"/><joint name="b_fixed_2"/>'
            '<body name="b"/><body name="c"><joint name="b_fixed"/></body></body>'
        )
    )
    assert [each.name for each in robot.links] == ["a:j", "a:j_2", "a", "b", "c"]
    fixed = [each.name for each in robot.joints if each.kind == "fixed"]
    assert fixed == ["a:j_fixed", "b_fixed_3"]


def test_sources_are_start_lines():
    robot = read(
        mjcf('\n<body\n name="a">\n<joint\n name="j" range="0 1"/><geom\n size="1"/></body>')
    )
    (shape,) = link(robot).collisions
    sources = [each.source for each in (link(robot), joint(robot), joint(robot).limit, shape)]
    assert [(each.line, each.element) for each in sources] == [(2, 2), (4, 3), (4, 3), (5, 4)]
    assert (robot.file, *robot.sources, robot.source.element) == (
        made_robots.FILE,
        made_robots.FILE,
        0,
    )


def test_excluded_pairs():
    pair = '<exclude body1="{}" body2="{}"/>'
    excludes = pair.format("a", "b") + pair.format("b", "b")
    robot = read(mjcf('<body name="a"/><body name="b"/>', f"<contact>{excludes}</contact>"))
    assert robot.excluded == {frozenset({"a", "b"})}


def test_options():
    flags = ("contact", "constraint", "limit", "actuation", "gravity", "equality")
    plain = read(mjcf("")).options
    assert (plain.source.line, plain.gravity, plain.timestep) == (1, (0, 0, -9.81), 0.002)
    assert (plain.disabled, plain.degrees) == (frozenset(), True)
    disabled = " ".join(f'{flag}="disable"' for flag in (*flags, "warmstart"))
    option = f'<option timestep="0.01" gravity="1 2 3">\n<flag {disabled}/></option>'
    given = read(mjcf("", f'<compiler angle="radian"/>\n{option}')).options
    assert (given.source.line, given.gravity, given.timestep) == (2, (1, 2, 3), 0.01)
    assert (given.disabled, given.degrees) == (frozenset(flags), False)


def keyframe(keys, inside='<joint name="j"/>'):
    robot = read(body(inside, f"<keyframe>{keys}</keyframe>"))
    return robot.keyframe, codes(robot)


def test_home_is_first_keyframe_with_positions():
    inside = """<freejoint/><body name="b"><joint name="hip"/><joint name="slide" type="slide"/>
      <body><joint type="ball"/><body><joint name="knee"/><body/></body></body></body>"""
    keys = """<key name="none"/><key qpos="1 2 3 1 0 0 0  0.4 0.5  1 0 0 0  0.6"/>
      <key qpos="0 0 0 1 0 0 0  0 0  1 0 0 0  0"/>"""
    assert keyframe(keys, inside) == ({"hip": 0.4, "slide": 0.5, "knee": 0.6}, [])


def test_keyframe_of_other_size_is_not_used():
    assert keyframe('<key qpos="1 2"/><key qpos="1"/>') == ({}, ["XML011"])
    assert keyframe("<key/>") == ({}, [])
    # A repaired robot may have lost the joint.
    assert keyframe('<key qpos="1 2"/>', '<joint name="j"/><strange/>') == ({}, ["XML007"])


@pytest.mark.parametrize("axes", ["", "quat", "euler", "axisangle", "zaxis", "xyaxes"])
def test_inertia_as_written(axes):
    turn = {"": "", "quat": "1 0 0 0", "axisangle": "1 0 0 0", "xyaxes": "1 0 0 0 1 0"}
    attribute = axes and f'{axes}="{turn.get(axes, "0 0 1")}"'
    written = f'\n<inertial pos="1 2 3" mass="-4" diaginertia="1 2 3" {attribute}/>'
    inertial = link(read(body(written, '<compiler angle="radian"/>'))).inertial
    assert (inertial.source.line, inertial.mass) == (2, -4)
    assert inertial.origin[:3, 3].tolist() == [1, 2, 3]
    assert inertial.inertia.tolist() == np.diag([1, 2, 3]).tolist()
    assert (inertial.attribute, inertial.axes_attribute) == ("diaginertia", axes)


def test_full_inertia():
    written = '<inertial pos="0 0 0" mass="1" fullinertia="3 4 5 0.1 0.2 0.3"/>'
    inertial = link(read(body(written))).inertial
    assert inertial.inertia.tolist() == [[3, 0.1, 0.2], [0.1, 4, 0.3], [0.2, 0.3, 5]]
    assert inertial.attribute == "fullinertia"


def test_inertial_without_inertia():
    inertial = link(read(body('<inertial pos="0 0 0" mass="1"/>'))).inertial
    assert (inertial.mass, inertial.inertia, inertial.attribute) == (1, None, "")


def test_geom_without_contacts_is_visual():
    """Both bits are zero, and no pair names it."""
    off = 'contype="0" conaffinity="0"'
    robot = read(
        mjcf(
            f'<body name="a"><geom size="1" name="drawn" {off}/>'
            '<geom size="1" name="first" contype="0"/><geom size="1" name="other" conaffinity="0"/>'
            f'<geom size="1" name="paired" {off}/></body>'
            '<body name="b"><geom size="1" name="both" contype="6" conaffinity="5"/></body>',
            '<contact><pair geom1="paired" geom2="both"/></contact>',
        )
    )
    a, b = link(robot, "a"), link(robot, "b")
    shapes = [*a.visuals, *b.visuals, *a.collisions, *b.collisions]
    bits = {s.name: (s.contype, s.conaffinity, s.contacts) for s in shapes}
    assert bits == {
        "drawn": (0, 0, False),
        "first": (0, 1, True),
        "other": (1, 0, True),
        "paired": (2, 0, True),  # the lowest bit that no geom's conaffinity has
        "both": (6, 5, True),
    }
    assert [len(each) for each in (a.visuals, b.visuals)] == [1, 0]


def test_contacts_disabled_by_option():
    robot = read(body('<geom size="1"/>', '<option><flag contact="disable"/></option>'))
    assert [shape.contacts for shape in link(robot).collisions] == [False]


@pytest.mark.parametrize(
    ("written", "values"),
    [("", (1, 0, 3)), ('friction="0.5 0.1 0.2" priority="2" condim="6"', (0.5, 2, 6))],
)
def test_friction_of_geoms(written, values):
    (shape,) = link(read(body(f'<geom size="1" {written}/>'))).collisions
    assert (shape.friction, shape.priority, shape.condim) == values


@pytest.mark.parametrize(
    ("attributes", "kind", "bounds"),
    [
        *read_table(__file__, "joint_kind_and_limits"),
        ("", "continuous", None),
        ('range="0.1 1" limited="false"', "continuous", None),
        ('type="slide"', "prismatic", None),
    ],
)
def test_joint_kind_and_limits(attributes, kind, bounds):
    found = joint(read(body(f'<joint name="j" {attributes}/>', '<compiler angle="radian"/>')))
    limit = found.limit and (found.limit.lower, found.limit.upper, found.limit.effort)
    assert (found.kind, limit) == (kind, bounds and (*bounds, None))


@pytest.mark.parametrize(("limited", "found"), [("auto", ["XML011"]), ("true", []), ("false", [])])
def test_range_without_limited_is_reported(limited, found):
    inside = f'<joint name="j" range="0 1" limited="{limited}"/>'
    robot = read(body(inside, '<compiler autolimits="false"/>'))
    assert codes(robot) == found
    assert joint(robot).kind == ("continuous" if limited == "false" else "revolute")


@pytest.mark.parametrize(
    ("angle", "euler", "found"),
    [("radian", "90 0 0", ["XML018"]), ("radian", "1.57 0 0", []), ("degree", "90 0 0", [])],
)
def test_angles_that_look_like_degrees_are_reported(angle, euler, found):
    robot = read(body(f'<body euler="{euler}"/>', f'<compiler angle="{angle}"/>'))
    assert codes(robot) == found
    assert [each.message for each in robot.problems] == [
        f"euler of <body>: got {euler} rad; expected radians" for _ in found
    ]


def test_robot_that_mujoco_cannot_compile_has_no_links(monkeypatch):
    def refuse(_):
        raise ValueError("Error: too heavy\nElement name 'a', id 1, line 3")

    monkeypatch.setattr(mujoco.MjSpec, "compile", refuse)
    robot = read('<mujoco>\n<worldbody>\n<body name="a"/></worldbody></mujoco>')
    (problem,) = robot.problems
    assert (robot.links, problem.code, problem.source.line) == ((), "XML011", 3)
    assert problem.message == "MuJoCo rejects the file: too heavy; the robot is not checked"

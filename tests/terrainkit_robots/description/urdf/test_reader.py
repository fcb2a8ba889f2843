import tomllib
from pathlib import Path

import numpy as np
import pytest

from tests.tables import read_table
from tests.terrainkit_robots.description import made_robots
from tests.terrainkit_robots.description.made_robots import codes

FILE = Path("/robots/robot.urdf")
PARENTS = '<parent link="a"/><child link="b"/>'
PROBLEMS = tomllib.loads(Path(__file__).with_name("problems.toml").read_text())["problem"]
TURNED = [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]


def read(text):
    return made_robots.read(text, FILE)


def robot(inner):
    return read(f'<robot name="r">{inner}</robot>')


def link(inner):
    """Return a link, and the codes of all problems."""
    model = robot(f'<link name="l">{inner}</link>')
    return model.links[0], codes(model)


def joint(inner, more=""):
    """Return a joint, and all problems."""
    model = robot(f'<joint name="j" type="revolute"{more}>{PARENTS}{inner}</joint>')
    return model.joints[0], model.problems


def shape(inner):
    """Return a collision geometry at (1, 2, 3), and all problems."""
    model = robot(
        '<link name="l"><collision><origin xyz="1 2 3"/>'
        f"<geometry>{inner}</geometry></collision></link>"
    )
    (found,) = model.links[0].collisions
    assert found.origin[:3, 3].tolist() == [1, 2, 3]
    return found, model.problems


def values(element):
    """Return the values of an element but its source."""
    return {name: value for name, value in vars(element).items() if name != "source"}


def test_minimal_robot():
    model = robot('<link name="l"/>')
    assert (model.name, model.kind, model.file, model.sources) == ("r", "urdf", FILE, (FILE,))
    assert (model.joints, model.problems, model.actuators, model.keyframe) == ((), (), (), {})
    (only,) = model.links
    assert (only.name, only.inertial, only.collisions, only.visuals) == ("l", None, (), ())


def test_joint_defaults():
    found, problems = joint("")
    assert (problems, found.parent, found.child) == ((), "a", "b")
    assert (found.origin.tolist(), found.anchor.tolist()) == (np.eye(4).tolist(), [0, 0, 0])
    assert (found.axis, found.direction.tolist()) == (None, [1, 0, 0])
    assert found.limit is found.mimic is found.dynamics is found.safety_controller is None
    assert (found.reference, found.armature, found.damping, found.friction) == (0, 0, 0, 0)


def test_joint_with_all_elements():
    found, problems = joint(
        '<origin xyz="1 2 3" rpy="0 0 1.5707963267948966"/><axis xyz="0 0 2"/>'
        '<limit lower="-1" upper="2" effort="3" velocity="4"/>'
        '<mimic joint="k" multiplier="-2" offset="0.5"/><dynamics damping="0.1" friction="1"/>'
        '<safety_controller k_position="100" k_velocity="1" soft_upper_limit="5"/>'
    )
    assert (problems, found.name, found.kind) == ((), "j", "revolute")
    np.testing.assert_allclose(found.origin, TURNED, atol=1e-15)
    assert (found.axis.tolist(), found.direction.tolist()) == ([0, 0, 2], [0, 0, 1])
    assert values(found.limit) == {"lower": -1, "upper": 2, "effort": 3, "velocity": 4}
    expected = {"joint": "k", "multiplier": -2, "offset": 0.5, "settings": {}}
    assert values(found.mimic) == expected
    assert values(found.dynamics) == {"damping": 0.1, "friction": 1}
    assert values(found.safety_controller) == {
        "k_position": 100,
        "k_velocity": 1,
        "soft_lower_limit": None,
        "soft_upper_limit": 5,
    }


def test_missing_values_of_joint():
    found, problems = joint(
        '<limit effort="3"/><mimic joint="k"/><dynamics damping="0.1" friction="much"/>'
    )
    assert values(found.limit) == {"lower": None, "upper": None, "effort": 3, "velocity": None}
    expected = {"joint": "k", "multiplier": 1, "offset": 0, "settings": {}}
    assert values(found.mimic) == expected
    assert (values(found.dynamics), found.friction) == ({"damping": 0.1, "friction": None}, 0)
    assert [problem.code for problem in problems] == ["XML006"]
    assert joint('<mimic joint="k" multiplier="0"/>')[0].mimic.multiplier == 0


@pytest.mark.parametrize(("text", "wanted"), [("true", True), ("True", True), ("1", False)])
def test_dont_collapse(text, wanted):
    assert joint("", f' dont_collapse="{text}"')[0].dont_collapse is wanted


def test_origin_with_quaternion():
    found, (problem,) = joint('<origin xyz="1 2 3" quat_xyzw="0 0 2 2"/>')
    added, removed = problem.fix.edits
    assert (problem.code, removed.name) == ("XML014", "quat_xyzw")
    assert (added.name, added.value) == ("rpy", "0 0 1.570796327")
    np.testing.assert_allclose(found.origin, TURNED, atol=1e-15)
    assert joint('<origin quat_xyzw="0 0 0 -2"/>')[1] == ()


@pytest.mark.parametrize("axis", ['<axis xyz="x y z"/>', "<axis/>", '<axis xyz=" "/>'])
def test_axis_without_numbers_is_zero(axis):
    found, _ = joint(axis)
    assert (found.axis.tolist(), found.direction.tolist()) == ([0, 0, 0], [1, 0, 0])


MOMENTS = {"ixx": 1, "iyy": 2, "izz": 3}
PRODUCTS = {"ixy": 0.1, "ixz": 0.2, "iyz": 0.3}


@pytest.mark.parametrize(
    ("lost", "inertia", "missing", "found"),
    [
        ([], [[1, 0.1, 0.2], [0.1, 2, 0.3], [0.2, 0.3, 3]], (), []),
        (["ixy", "ixz", "iyz"], np.diag([1, 2, 3]), (), ["XML013"]),
        (["ixz"], [[1, 0.1, 0], [0.1, 2, 0.3], [0, 0.3, 3]], (), ["XML013"]),
        (["ixx"], None, ("ixx",), []),
        (["iyy", "ixz"], None, ("iyy",), []),
        (["izz"], None, ("izz",), []),
    ],
)
def test_inertia(lost, inertia, missing, found):
    given = {name: value for name, value in (MOMENTS | PRODUCTS).items() if name not in lost}
    written = " ".join(f'{name}="{value}"' for name, value in given.items())
    read_link, problems = link(
        f'<inertial><origin xyz="1 2 3"/><mass value="-4"/><inertia {written}/></inertial>'
    )
    inertial = read_link.inertial
    assert (inertial.mass, inertial.missing, problems) == (-4, missing, found)
    assert inertial.origin[:3, 3].tolist() == [1, 2, 3]
    assert (inertial.inertia is None) == (inertia is None)
    assert inertia is None or inertial.inertia.tolist() == np.asarray(inertia).tolist()


def test_inertial_without_mass_or_inertia():
    inertial = link("<inertial/>")[0].inertial
    assert (inertial.mass, inertial.inertia, inertial.missing) == (None, None, tuple(MOMENTS))
    assert inertial.origin.tolist() == np.eye(4).tolist()


@pytest.mark.parametrize(("text", "kind", "size"), read_table(__file__, "primitive"))
def test_primitive(text, kind, size):
    geometry, problems = shape(text)
    assert (geometry.shape, *geometry.size) == (kind, *size)
    assert (geometry.contacts, problems) == (True, ())


@pytest.mark.parametrize(("scale", "wanted"), [(' scale="1 -2 3"', (1, -2, 3)), ("", (1, 1, 1))])
def test_mesh(scale, wanted):
    geometry, problems = shape(f'<mesh filename=" meshes/foot.stl "{scale}/>')
    assert (geometry.shape, geometry.size, problems) == ("mesh", (), ())
    mesh = geometry.mesh
    assert (mesh.filename, mesh.scale) == ("meshes/foot.stl", wanted)
    assert (mesh.path, mesh.found_by) == (Path("/robots/meshes/foot.stl"), "nothing")


def test_geometry_in_document_order():
    each = '<geometry><sphere radius="1"/></geometry>'
    inner = "".join(
        f'<collision name="{name}">{each}</collision><visual>{each}</visual>' for name in "bac"
    )
    read_link, problems = link(inner)
    assert problems == []
    assert [collision.name for collision in read_link.collisions] == ["b", "a", "c"]
    assert len(read_link.visuals) == 3


def inside(problem):
    """Return the elements of the robot of a problem."""
    text = problem.get("shape")
    text = f"<collision><geometry>{text}</geometry></collision>" if text else problem.get("link")
    if "joint" in problem:
        return f'<joint name="j" type="revolute">{PARENTS}{problem["joint"]}</joint>'
    return f'<link name="l">{text}</link>' if text else problem["robot"]


@pytest.mark.parametrize("problem", PROBLEMS, ids=[each["message"][:30] for each in PROBLEMS])
def test_problem_is_reported_once(problem):
    model = robot(inside(problem))
    (found,) = model.problems
    told = {"code": found.code, "message": found.message, "attribute": found.attribute}
    told["fix"] = found.fix.description if found.fix else ""
    assert told == {"attribute": "", "fix": ""} | {k: problem[k] for k in told if k in problem}
    assert found.subject == next((k for k in "jl" if f'name="{k}"' in inside(problem)), "r")
    assert [shape.size for each in model.links for shape in each.collisions] in ([], [()])


def test_copies_are_compared_with_their_contents():
    """The second differs in an attribute of a child, the third in its tag."""
    geometry = '<geometry><{} radius="{}" length="1"/></geometry>'
    inside = [geometry.format(*each) for each in [("capsule", 1), ("capsule", 2), ("cylinder", 1)]]
    model = robot(f'<link name="l"><collision>{"".join(inside)}{inside[0]}</collision></link>')
    fixes = [problem.fix for problem in model.problems]
    assert [fix and fix.description for fix in fixes] == [None, None, "Remove the copy."]


@pytest.mark.parametrize("name", ["", ' name=""', ' name="  "'])
def test_robot_without_name(name):
    model = read(f"<robot{name}/>")
    assert (model.name, codes(model)) == ("", ["XML003"])


def test_materials_are_reported():
    """The material has no color, and the visual two of them; a collision may have one."""
    shapes = '<geometry><sphere radius="1"/></geometry><material name="m"/>'
    visual = f'<visual>{shapes}<material name="m"/></visual>'
    model = robot(f'<link name="l">{visual}<collision>{shapes}</collision></link>')
    assert [(each.code, each.message) for each in model.problems] == [
        ("XML016", "material m: has no color or texture anywhere; expected a definition"),
        ("XML008", "<visual> has two materials; expected one"),
    ]


def test_references_of_broken_files_are_not_compared():
    assert codes(read('<robot name="r"><gazebo reference="nobody"/>')) == ["XML001"]
    assert codes(robot('<gazebo reference="nobody"/><link name="${a}"/>')) == ["XML004"]


def test_duplicates_and_extensions():
    """Links may be repeated, and the joints of other elements are none of the robot."""
    model = robot(
        '<!-- a --><link name="l"><!-- b --></link><link name="l"/>'
        '<transmission name="t"><joint name="l"/></transmission>'
    )
    assert [each.name for each in model.links] == ["l", "l"]
    assert (model.joints, codes(model)) == ((), ["TRE010"])


def test_elements_have_lines():
    model = read(
        '<robot name="r">\n<link\n name="l">\n<inertial>\n<mass value="1"/>\n<inertia ixx="1"/>\n'
        "</inertial>\n<collision>\n<geometry>\n<box\nsize='1 1 1'/></geometry></collision></link>\n"
        f'<joint name="j" type="fixed">\n{PARENTS}\n\n<axis xyz="1 0 0"/>'
        '\n<limit lower="0"/>\n<mimic joint="k"/>\n<dynamics/>\n<safety_controller/></joint>'
        "</robot>"
    )
    (own,), (moved,) = model.links, model.joints
    (box,) = own.collisions
    sources = [model.source, own.source, own.inertial.source, own.inertial.inertia_source]
    sources += [box.source, box.size_source, moved.source, moved.axis_source]
    sources += [
        each.source for each in (moved.limit, moved.mimic, moved.dynamics, moved.safety_controller)
    ]
    assert [each.line for each in sources] == [1, 2, 4, 6, 8, 10, 12, 15, 16, 17, 18, 19]


@pytest.mark.parametrize(
    ("parameters", "gains"),
    [
        ({"position_kp": "40", "position_kd": "1.5"}, (40, 1.5)),
        ({"pos_kp": "40"}, (40, None)),
        ({"position_kp": "0", "pos_kp": "7", "pos_kd": "x"}, (7, None)),
        ({"position_kd": "1"}, None),
        ({}, None),
    ],
)
def test_position_gains_of_ros2_control(parameters, gains):
    params = "".join(f'<param name="{name}">{text}</param>' for name, text in parameters.items())
    control = f'<ros2_control><joint name="j">{params}</joint></ros2_control>'
    model = read(
        '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="continuous">'
        f'<parent link="a"/><child link="b"/></joint>{control}</robot>'
    )
    found = model.joints[0].position_gains
    assert (found and (found.stiffness, found.damping)) == gains

import math
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terrainkit_robots.description.load import load_robot
from terrainkit_robots.transforms import rpy_to_matrix

FILE = Path("/robots/robot.urdf")
URDFS = [
    "a1/urdf/a1.urdf",
    "go2/urdf/go2.urdf",
    "h1/urdf/h1.urdf",
    "g1/g1_29dof.urdf",
    "anymal_c/urdf/anymal_c.urdf",
    "cassie/urdf/cassie.urdf",
]


def read(text):
    return load_robot(FILE, contents={FILE: text.encode()})


def robot(inner):
    return read(f'<robot name="r">{inner}</robot>')


def link(inner, attributes='name="l"'):
    model = robot(f"<link {attributes}>{inner}</link>")
    return model.links[0], model.problems


def joint(inner, attributes='name="j" type="revolute"'):
    model = robot(f"<joint {attributes}>{inner}</joint>")
    return model.joints[0], model.problems


def shape(inner):
    read_link, problems = link(f"<collision><geometry>{inner}</geometry></collision>")
    return read_link.collisions[0], problems


PARENTS = '<parent link="a"/><child link="b"/>'


# Defaults


def test_minimal_robot():
    model = robot('<link name="l"/>')
    assert (model.name, model.kind, model.file, model.sources) == ("r", "urdf", FILE, (FILE,))
    assert [each.name for each in model.links] == ["l"]
    assert (model.joints, model.problems, model.actuators, model.keyframe) == ((), (), (), {})


def test_link_with_only_a_name():
    read_link, problems = link("")
    assert read_link.inertial is None
    assert read_link.collisions == read_link.visuals == ()
    assert not read_link.virtual
    assert problems == ()


def test_joint_defaults():
    read_joint, problems = joint(PARENTS)
    assert problems == ()
    assert read_joint.origin.tolist() == np.eye(4).tolist()
    assert read_joint.axis is None
    assert read_joint.direction.tolist() == [1, 0, 0]
    assert read_joint.limit is None
    assert read_joint.mimic is None
    assert read_joint.safety_controller is None
    assert read_joint.anchor.tolist() == [0, 0, 0]
    assert (read_joint.reference, read_joint.armature) == (0, 0)
    assert (read_joint.damping, read_joint.friction) == (0, 0)
    assert not read_joint.dont_collapse


def test_origin_with_quaternion():
    read_joint, problems = joint('<origin xyz="1 2 3" quat_xyzw="0 0 2 2"/>' + PARENTS)
    assert [(problem.code, problem.details["rpy"]) for problem in problems] == [
        ("XML014", "0 0 1.570796327")
    ]
    turned = [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]
    np.testing.assert_allclose(read_joint.origin, turned, atol=1e-15)


def test_identity_quaternion_is_not_reported():
    assert joint(f'<origin quat_xyzw="0 0 0 -2"/>{PARENTS}')[1] == ()


@pytest.mark.parametrize(
    ("written", "said"),
    [
        (
            'quat_xyzw="0 0 0 0"',
            "quat_xyzw of <origin>: got '0 0 0 0'; expected a nonzero quaternion",
        ),
        ('quat_xyzw="0 0 1"', "quat_xyzw of <origin>: got '0 0 1'; expected 4 numbers"),
        ('quat_xyzw="0 0 1 0" rpy="1 0 0"', "<origin> has quat_xyzw and rpy"),
    ],
)
def test_invalid_quaternion_is_reported(written, said):
    _, problems = joint(f"<origin {written}/>{PARENTS}")
    assert [problem.code for problem in problems] == ["XML006"]
    assert said in problems[0].message


def test_joint_with_all_elements():
    read_joint, problems = joint(
        '<origin xyz="1 2 3" rpy="0 0 1.5707963267948966"/>'
        + PARENTS
        + '<axis xyz="0 0 2"/><limit lower="-1" upper="2" effort="3" velocity="4"/>'
        '<mimic joint="k" multiplier="-2" offset="0.5"/>\n<dynamics damping="0.1" friction="1"/>'
        '\n<safety_controller k_position="100" k_velocity="1"/>',
        'name="j" type="revolute" dont_collapse="true"',
    )
    assert problems == ()
    assert (read_joint.name, read_joint.kind) == ("j", "revolute")
    assert (read_joint.parent, read_joint.child) == ("a", "b")
    turned = [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]
    np.testing.assert_allclose(read_joint.origin, turned, atol=1e-15)
    assert read_joint.axis.tolist() == [0, 0, 2]
    assert read_joint.direction.tolist() == [0, 0, 1]
    limit, mimic = read_joint.limit, read_joint.mimic
    assert (limit.lower, limit.upper, limit.effort, limit.velocity) == (-1, 2, 3, 4)
    assert (mimic.joint, mimic.multiplier, mimic.offset) == ("k", -2, 0.5)
    assert (read_joint.damping, read_joint.friction) == (0.1, 1)
    dynamics, safety = read_joint.dynamics, read_joint.safety_controller
    assert (dynamics.damping, dynamics.friction) == (0.1, 1)
    assert (safety.k_position, safety.k_velocity) == (100, 1)
    assert (safety.soft_lower_limit, safety.soft_upper_limit) == (None, None)
    line = mimic.source.line
    assert (dynamics.source.line, safety.source.line) == (line + 1, line + 2)
    assert read_joint.dont_collapse


def test_invalid_friction_is_reported():
    read_joint, problems = joint(PARENTS + '<dynamics damping="0.1" friction="much"/>')
    assert (read_joint.dynamics.damping, read_joint.dynamics.friction) == (0.1, None)
    assert read_joint.friction == 0
    assert [problem.code for problem in problems] == ["XML006"]


def test_incomplete_limit():
    limit = joint(PARENTS + '<limit effort="3"/>')[0].limit
    assert (limit.lower, limit.upper, limit.effort, limit.velocity) == (None, None, 3, None)


def test_mimic_defaults():
    mimic = joint(PARENTS + '<mimic joint="k"/>')[0].mimic
    assert (mimic.joint, mimic.multiplier, mimic.offset) == ("k", 1, 0)
    assert joint(PARENTS + '<mimic joint="k" multiplier="0"/>')[0].mimic.multiplier == 0


def test_safety_controller_without_position_gain():
    controller = joint(PARENTS + '<safety_controller k_velocity="1"/>')[0].safety_controller
    assert (controller.k_position, controller.k_velocity) == (None, 1)


@pytest.mark.parametrize(
    ("text", "wanted"), [("true", True), ("True", True), ("false", False), ("1", False)]
)
def test_dont_collapse(text, wanted):
    attributes = f'name="j" type="fixed" dont_collapse="{text}"'
    assert joint(PARENTS, attributes)[0].dont_collapse is wanted


def test_inertial_with_all_elements():
    read_link, problems = link(
        '<inertial><origin xyz="1 2 3"/><mass value="4"/>'
        '<inertia ixx="1" ixy="0.1" ixz="0.2" iyy="2" iyz="0.3" izz="3"/></inertial>'
    )
    inertial = read_link.inertial
    assert problems == ()
    assert inertial.mass == 4
    assert inertial.origin[:3, 3].tolist() == [1, 2, 3]
    assert inertial.inertia.tolist() == [[1, 0.1, 0.2], [0.1, 2, 0.3], [0.2, 0.3, 3]]


def test_missing_products_of_inertia_are_zero():
    text = '<inertial><mass value="1"/><inertia ixx="1" iyy="2" izz="3"/></inertial>'
    assert link(text)[0].inertial.inertia.tolist() == [[1, 0, 0], [0, 2, 0], [0, 0, 3]]


@pytest.mark.parametrize("lost", ["ixx", "iyy", "izz"])
def test_missing_moment_of_inertia(lost):
    moments = " ".join(f'{name}="1"' for name in ("ixx", "iyy", "izz") if name != lost)
    text = f'<inertial><mass value="1"/><inertia {moments}/></inertial>'
    assert link(text)[0].inertial.inertia is None


def test_inertial_without_mass_or_inertia():
    inertial = link("<inertial/>")[0].inertial
    assert inertial.mass is None
    assert inertial.inertia is None
    assert inertial.origin.tolist() == np.eye(4).tolist()


@pytest.mark.parametrize("mass", [-1.0, 0.0, 1e29, 1e-300])
def test_mass_is_not_corrected(mass):
    assert link(f'<inertial><mass value="{mass}"/></inertial>')[0].inertial.mass == mass


# Shapes


@pytest.mark.parametrize(
    ("text", "kind", "size"),
    [
        ('<box size="1 2 3"/>', "box", (0.5, 1, 1.5)),
        ('<sphere radius="0.1"/>', "sphere", (0.1,)),
        ('<cylinder radius="0.1" length="2"/>', "cylinder", (0.1, 1)),
        ('<capsule radius="0.1" length="2"/>', "capsule", (0.1, 1)),
        ('<cylinder radius="0" length="0"/>', "cylinder", (0, 0)),
        ('<box size="-1 2 3"/>', "box", (-0.5, 1, 1.5)),
    ],
)
def test_primitive(text, kind, size):
    geometry, problems = shape(text)
    assert (geometry.shape, geometry.size) == (kind, size)
    assert problems == ()
    assert geometry.contacts


@pytest.mark.parametrize(
    ("text", "lacks"),
    [
        ("<box/>", "size"),
        ("<sphere/>", "radius"),
        ('<cylinder radius="1"/>', "length"),
        ('<cylinder length="1"/>', "radius"),
        ("<capsule/>", "length, radius"),
    ],
)
def test_primitive_without_size(text, lacks):
    geometry, problems = shape(text)
    assert geometry.size == ()
    assert [(p.code, p.subject) for p in problems] == [("XML013", "l")]
    assert lacks in problems[0].message


@pytest.mark.parametrize("text", ['<box size="1 2"/>', '<sphere radius="x"/>'])
def test_invalid_size_is_reported_once(text):
    geometry, problems = shape(text)
    assert geometry.size == ()
    assert [problem.code for problem in problems] == ["XML006"]


def test_mesh():
    geometry, problems = shape('<mesh filename="meshes/foot.stl" scale="1 -2 3"/>')
    assert (geometry.shape, geometry.size, problems) == ("mesh", (), ())
    assert geometry.mesh.filename == "meshes/foot.stl"
    assert geometry.mesh.path == Path("/robots/meshes/foot.stl")
    assert geometry.mesh.scale == (1, -2, 3)


def test_mesh_scale_default():
    assert shape('<mesh filename="foot.stl"/>')[0].mesh.scale == (1, 1, 1)


@pytest.mark.parametrize("text", ["<mesh/>", '<mesh filename=""/>', '<mesh filename=" "/>'])
def test_mesh_without_filename(text):
    geometry, problems = shape(text)
    assert geometry.mesh is None
    assert [problem.code for problem in problems] == ["XML013"]


def test_unknown_shape():
    geometry, problems = shape('<sdf filename="a"/>')
    assert (geometry.shape, geometry.size, problems) == ("unknown", (), ())


@pytest.mark.parametrize("text", ["<collision/>", "<collision><geometry/></collision>"])
def test_collision_without_shape(text):
    read_link, problems = link(text)
    assert read_link.collisions[0].shape == "unknown"
    assert [problem.code for problem in problems] == ["XML013"]


def test_geometry_in_document_order():
    names = ["b", "a", "c"]
    each = '<geometry><sphere radius="1"/></geometry>'
    inner = "".join(
        f'<collision name="{n}">{each}</collision><visual>{each}</visual>' for n in names
    )
    read_link, _ = link(inner)
    assert [collision.name for collision in read_link.collisions] == names
    assert len(read_link.visuals) == 3


def test_two_materials_are_reported():
    material = '<material name="m"/>'
    each = f'<visual><geometry><sphere radius="1"/></geometry>{material}{material}</visual>'
    assert [problem.code for problem in link(each)[1]] == ["XML016", "XML008"]


# What is missing or wrong


@pytest.mark.parametrize("name", ["", ' name=""', ' name="  "'])
def test_robot_without_name(name):
    model = read(f"<robot{name}/>")
    assert model.name == ""
    assert [problem.code for problem in model.problems] == ["XML003"]


@pytest.mark.parametrize(
    ("text", "lacks"),
    [
        ("<link/>", "<link> has no name"),
        (f'<joint type="fixed">{PARENTS}</joint>', "<joint> has no name"),
        (f'<joint name="j">{PARENTS}</joint>', "<joint> has no type"),
        ('<joint name="j" type="fixed"><parent link="a"/></joint>', "<joint> has no link"),
        ('<joint name="j" type="fixed"><parent/><child link="a"/></joint>', "<parent> has no link"),
    ],
)
def test_missing_attributes_are_reported(text, lacks):
    problems = robot(text).problems
    assert [problem.code for problem in problems] == ["XML013"]
    assert lacks in problems[0].message


@pytest.mark.parametrize(
    "text", ["1 2", "1 2 3 4", "a b c", "nan 0 0", "0 inf 0", "1e308 0 0", "", "0x1 0 0"]
)
def test_invalid_number_is_reported(text):
    read_joint, problems = joint(f'<origin xyz="{text}"/>{PARENTS}')
    assert read_joint.origin.tolist() == np.eye(4).tolist()
    (problem,) = problems
    assert (problem.code, problem.subject) == ("XML006", "j")
    assert problem.details == {"attribute": "xyz", "repaired": ""}
    assert "expected 3 numbers" in problem.message


@pytest.mark.parametrize(
    ("text", "values", "repaired"),
    [
        ("0,5 0 0", [0.5, 0, 0], "0.5 0 0"),
        ("1, 2, 3", [1, 2, 3], "1 2 3"),
        ("1 ,2 ,3", [1, 2, 3], "1 2 3"),
        ("1,2,3", [1, 2, 3], "1 2 3"),
    ],
)
def test_commas_are_repaired(text, values, repaired):
    read_joint, (problem,) = joint(f'<origin xyz="{text}"/>{PARENTS}')
    assert read_joint.origin[:3, 3].tolist() == values
    assert problem.code == "XML006"
    assert problem.details["repaired"] == repaired


def test_mass_with_decimal_comma():
    read_link, (problem,) = link('<inertial><mass value="1,5"/></inertial>')
    assert read_link.inertial.mass == 1.5
    assert problem.details == {"attribute": "value", "repaired": "1.5"}


def test_number_is_reported_once():
    inertia = '<inertia ixx="a" ixy="b" ixz="0" iyy="1" iyz="0" izz="1"/>'
    problems = link(f"<inertial><mass value='x'/>{inertia}</inertial>")[1]
    assert sorted(p.details["attribute"] for p in problems) == ["ixx", "ixy", "value"]


def test_axis_without_numbers_is_zero():
    read_joint, problems = joint(PARENTS + '<axis xyz="x y z"/>')
    assert read_joint.axis.tolist() == [0, 0, 0]
    assert read_joint.direction.tolist() == [1, 0, 0]
    assert [problem.code for problem in problems] == ["XML006"]
    assert joint(PARENTS + "<axis/>")[0].axis.tolist() == [0, 0, 0]


def test_long_value_is_truncated():
    (problem,) = joint(f'<origin xyz="{"a" * 1000}"/>{PARENTS}')[1]
    assert len(problem.message) < 120


def test_xacro_value_is_reported_once():
    problems = joint(f'<origin xyz="${{x}} 0 0"/><axis xyz="$(arg a)"/>{PARENTS}')[1]
    assert [problem.code for problem in problems] == ["XML004"]


def test_misspelled_names_have_suggestion():
    (problem,) = joint(PARENTS + '<limit lower="0" uper="1"/>')[1]
    assert problem.code == "XML007"
    assert problem.subject == "j"
    assert "upper" in problem.message
    assert problem.details == {"attribute": "uper", "known": "upper"}


def test_all_problems_are_reported():
    model = robot(
        '<link/><link name="l"><inertial><mass value="a"/></inertial></link>'
        '<joint name="j" type="revolute"><parent link="l"/><axis xyz="1"/></joint><lnik/>'
    )
    codes = sorted(problem.code for problem in model.problems)
    assert codes == ["XML006", "XML006", "XML007", "XML013", "XML013"]


def test_duplicates_are_kept():
    model = robot('<link name="l"/><link name="l"/>')
    assert [each.name for each in model.links] == ["l", "l"]


def test_joints_of_extensions_are_ignored():
    model = robot('<transmission name="t"><joint name="j"/></transmission><link name="l"/>')
    assert model.joints == ()


def test_comments_are_ignored():
    model = robot(
        '<!-- a --><link name="l"><!-- b --><collision><!-- c --><geometry><!-- d -->'
        '<sphere radius="1"/></geometry></collision></link>'
    )
    assert model.links[0].collisions[0].size == (1,)
    assert model.problems == ()


def test_elements_have_lines():
    model = read(
        '<robot name="r">\n<link\n name="l">\n<inertial>\n<mass value="1"/>\n<inertia ixx="1"/>\n'
        "</inertial>\n<collision>\n<geometry>\n<box\nsize='1 1 1'/></geometry></collision></link>\n"
        '<joint name="j" type="fixed">\n<parent link="l"/>\n<child link="m"/>\n<axis xyz="1 0 0"/>'
        '\n<limit lower="0"/>\n<mimic joint="k"/></joint></robot>'
    )
    (read_link,), (read_joint,) = model.links, model.joints
    assert model.source.line == 1
    assert read_link.source.line == 2
    assert read_link.inertial.source.line == 4
    assert read_link.inertial.inertia_source.line == 6
    assert read_link.collisions[0].source.line == 8
    assert read_link.collisions[0].size_source.line == 10
    assert read_joint.source.line == 12
    assert read_joint.axis_source.line == 15
    assert read_joint.limit.source.line == 16
    assert read_joint.mimic.source.line == 17


# Rotations


def about(axis, angle):
    """Return a rotation about x, y or z."""
    k = "xyz".index(axis)
    i, j = (k + 1) % 3, (k + 2) % 3
    turn = np.eye(3)
    turn[[i, j], [i, j]] = math.cos(angle)
    turn[j, i], turn[i, j] = math.sin(angle), -math.sin(angle)
    return turn


@given(st.tuples(*[st.floats(-10, 10)] * 3))
def test_rpy_rotates_about_fixed_axes(rpy):
    roll, pitch, yaw = rpy
    wanted = about("z", yaw) @ about("y", pitch) @ about("x", roll)
    np.testing.assert_allclose(rpy_to_matrix(np.array(rpy)), wanted, atol=1e-14)


# Against another reader


@pytest.fixture(params=URDFS, scope="module")
def both(request, robot_file):
    """Return a robot as it is read here, and as yourdfpy reads it."""
    yourdfpy = pytest.importorskip("yourdfpy")
    path = robot_file(request.param)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        other = yourdfpy.URDF.load(path, load_meshes=False, build_scene_graph=False).robot
    return load_robot(path), other


def test_links_match_yourdfpy(both):
    model, other = both
    assert [each.name for each in model.links] == [each.name for each in other.links]
    for ours, theirs in zip(model.links, other.links, strict=True):
        assert len(ours.collisions) == len(theirs.collisions)
        assert len(ours.visuals) == len(theirs.visuals)
        assert (ours.inertial is None) == (theirs.inertial is None)
        if ours.inertial is None:
            continue
        assert ours.inertial.mass == theirs.inertial.mass
        wanted = np.eye(4) if theirs.inertial.origin is None else theirs.inertial.origin
        np.testing.assert_allclose(ours.inertial.origin, wanted, atol=1e-12)
        np.testing.assert_array_equal(ours.inertial.inertia, theirs.inertial.inertia)


def test_joints_match_yourdfpy(both):
    model, other = both
    assert [each.name for each in model.joints] == [each.name for each in other.joints]
    for ours, theirs in zip(model.joints, other.joints, strict=True):
        assert (ours.kind, ours.parent, ours.child) == (theirs.type, theirs.parent, theirs.child)
        wanted = np.eye(4) if theirs.origin is None else theirs.origin
        np.testing.assert_allclose(ours.origin, wanted, atol=1e-12)
        if ours.moves:
            np.testing.assert_array_equal(ours.axis, theirs.axis)
        if ours.limit is not None:
            limit = theirs.limit
            assert (ours.limit.lower, ours.limit.upper) == (limit.lower, limit.upper)
            assert (ours.limit.effort, ours.limit.velocity) == (limit.effort, limit.velocity)


def test_collisions_match_yourdfpy(both):
    model, other = both
    for link_here, link_there in zip(model.links, other.links, strict=True):
        for ours, theirs in zip(link_here.collisions, link_there.collisions, strict=True):
            wanted = np.eye(4) if theirs.origin is None else theirs.origin
            np.testing.assert_allclose(ours.origin, wanted, atol=1e-12)
            geometry = theirs.geometry
            if ours.shape == "mesh":
                assert ours.mesh.filename == geometry.mesh.filename
            elif ours.shape == "box":
                np.testing.assert_allclose(2 * np.array(ours.size), geometry.box.size)
            elif ours.shape == "sphere":
                assert ours.size == (geometry.sphere.radius,)
            else:
                assert ours.shape == "cylinder"
                assert ours.size[0] == geometry.cylinder.radius
                assert 2 * ours.size[1] == geometry.cylinder.length

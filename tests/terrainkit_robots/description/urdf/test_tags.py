import pytest
from lxml import etree

from terrainkit_robots.description.urdf.tags import has_variable, misspelled_names, unexpanded_xacro


def found(inner):
    """Return tag, attribute and known word of each misspelled name in a robot."""
    root = etree.fromstring(f'<robot name="r">{inner}</robot>')
    return [(element.tag, attribute, known) for element, attribute, known in misspelled_names(root)]


def in_joint(inner):
    return f'<joint name="j" type="revolute">{inner}</joint>'


def in_shape(inner):
    return f'<link name="l"><visual><geometry>{inner}</geometry></visual></link>'


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ('<lnik name="l"/>', ("lnik", "", "link")),
        ('<Joint name="l"/>', ("Joint", "", "joint")),
        ('<link nam="l"/>', ("link", "nam", "name")),
        ('<joint name="j" typ="fixed"/>', ("joint", "typ", "type")),
        (in_joint('<limit uper="0"/>'), ("limit", "uper", "upper")),
        (in_joint('<limits lower="0"/>'), ("limits", "", "limit")),
        (in_joint('<axis xzy="1 0 0"/>'), ("axis", "xzy", "xyz")),
        (in_joint('<origin xyz="0 0 0" ryp="0 0 0"/>'), ("origin", "ryp", "rpy")),
        (in_joint('<parent lnk="l"/>'), ("parent", "lnk", "link")),
        (in_joint('<mimic jiont="k"/>'), ("mimic", "jiont", "joint")),
        (in_joint('<dynamics dampning="1"/>'), ("dynamics", "dampning", "damping")),
        ("<link><inertail/></link>", ("inertail", "", "inertial")),
        ("<link><inertial><mas/></inertial></link>", ("mas", "", "mass")),
        ('<link><inertial><inertia iyx="1"/></inertial></link>', ("inertia", "iyx", "ixy")),
        ("<link><collision><geometri/></collision></link>", ("geometri", "", "geometry")),
        (in_shape('<mesh file_name="a"/>'), ("mesh", "file_name", "filename")),
        (in_shape("<cilinder/>"), ("cilinder", "", "cylinder")),
        (in_shape('<capsule lenght="1"/>'), ("capsule", "lenght", "length")),
    ],
)
def test_similar_name(text, wanted):
    assert found(text) == [wanted]


@pytest.mark.parametrize(
    "text",
    [
        '<gazebo reference="l"><lnik nmae="a"/><mu1>1</mu1><kp value="2"/></gazebo>',
        '<transmission name="t"><type>a</type></transmission>',
        '<ros2_control><joint name="j"><command_interface/></joint></ros2_control>',
        '<drake:acceleration xmlns:drake="d"/><loop_joint name="a" type="ball"/>',
        '<material name="m"><color rgba="1 1 1 1"/></material>',
        in_joint('<limit lower="0" upper="1" effort="2" velocity="3"/>'),
        in_joint('<limit lower="0" lowe="0" upper="1"/>'),  # it is there as well
        in_joint('<hardwareInterface>x</hardwareInterface><calibration rising="0"/>'),
        "<link><contact><lateral_friction/></contact><self_collision_checking/></link>",
        in_shape('<sdf filename="a"/>'),
    ],
)
def test_known_and_extension_names(text):
    assert found(text) == []


@pytest.mark.parametrize(("others", "is_seen"), [(9, True), (10, False)])
def test_number_of_unknown_attributes_is_bounded(others, is_seen):
    """Ten are compared, in alphabetical order."""
    many = " ".join(f'aa{k}="1"' for k in range(others))
    assert found(in_joint(f'<limit {many} uper="1"/>')) == [("limit", "uper", "upper")] * is_seen


def test_several_misspellings():
    text = in_joint('<limt lower="1"/><axis xzy="1 0 0"/>') + '<link nam="l"/>' * 2000
    names = found(text)
    assert names.count(("link", "nam", "name")) == 2000
    assert {("axis", "xzy", "xyz"), ("limt", "", "limit")} < set(names)


@pytest.mark.parametrize("text", ["${a}", "1 ${b} 2", "$(arg x)/mesh.stl"])
def test_has_variable(text):
    assert has_variable(text)


@pytest.mark.parametrize("text", ["", "$5", "{a}", "(arg x)", "$(find x)", "package://a/b"])
def test_has_no_variable(text):
    assert not has_variable(text)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ('<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro/></robot>', ["<macro>"]),
        ('<robot xmlns:x="http://ros.org/wiki/xacro"><x:property/></robot>', ["<property>"]),
        ("<robot><xacro:include/><xacro:macro/></robot>", ["<xacro:include>"]),
        ('<robot><link name="${a}l"/><link name="${b}"/></robot>', ["'${a}l'"]),
        ('<robot name="$(arg name)"/>', ["'$(arg name)'"]),
        ('<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="l"/></robot>', []),
    ],
)
def test_first_unexpanded_xacro(text, what):
    root = etree.fromstring(text, etree.XMLParser(recover=True))
    assert [word for _, word in unexpanded_xacro(root)] == what

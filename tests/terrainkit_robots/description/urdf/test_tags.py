import pytest
from lxml import etree

from terrainkit_robots.description.urdf.tags import has_variable, misspelled_names, unexpanded_xacro


def found(text):
    """Return tag, attribute and the known word of each that looks misspelled_names."""
    root = etree.fromstring(text)
    return [(element.tag, attribute, known) for element, attribute, known in misspelled_names(root)]


def in_joint(inner):
    return f'<robot name="r"><joint name="j" type="revolute">{inner}</joint></robot>'


def in_link(inner):
    return f'<robot name="r"><link name="l">{inner}</link></robot>'


# Misspelt words


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ('<robot nmae="r"/>', ("robot", "nmae", "name")),
        ('<robot Name="r"/>', ("robot", "Name", "name")),
        ('<robot name="r"><lnik name="l"/></robot>', ("lnik", "", "link")),
        ('<robot name="r"><Joint name="l"/></robot>', ("Joint", "", "joint")),
        ('<robot name="r"><joints name="l"/></robot>', ("joints", "", "joint")),
        ('<robot name="r"><joint name="j" typ="fixed"/></robot>', ("joint", "typ", "type")),
        (in_joint('<limit lowwer="0" upper="1"/>'), ("limit", "lowwer", "lower")),
        (in_joint('<limit uper="0"/>'), ("limit", "uper", "upper")),
        (in_joint('<limit efort="0"/>'), ("limit", "efort", "effort")),
        (in_joint('<limit velocty="0"/>'), ("limit", "velocty", "velocity")),
        (in_joint('<limits lower="0"/>'), ("limits", "", "limit")),
        (in_joint('<axsi xyz="1 0 0"/>'), ("axsi", "", "axis")),
        (in_joint('<axis xzy="1 0 0"/>'), ("axis", "xzy", "xyz")),
        (in_joint('<origin xyz="0 0 0" ryp="0 0 0"/>'), ("origin", "ryp", "rpy")),
        (in_joint('<parnet link="l"/>'), ("parnet", "", "parent")),
        (in_joint('<parent lnk="l"/>'), ("parent", "lnk", "link")),
        (in_joint('<mimic jiont="k"/>'), ("mimic", "jiont", "joint")),
        (in_joint('<dynamics dampning="1"/>'), ("dynamics", "dampning", "damping")),
        (in_link("<inertail/>"), ("inertail", "", "inertial")),
        (in_link("<colision/>"), ("colision", "", "collision")),
        (in_link("<visuals/>"), ("visuals", "", "visual")),
        (in_link('<inertial><mass vlaue="1"/></inertial>'), ("mass", "vlaue", "value")),
        (in_link('<inertial><inertia ixx="1" iyx="1"/></inertial>'), ("inertia", "iyx", "ixy")),
        (in_link("<visual><geometri/></visual>"), ("geometri", "", "geometry")),
        (
            in_link('<visual><geometry><mesh file_name="a"/></geometry></visual>'),
            ("mesh", "file_name", "filename"),
        ),
        (
            in_link("<visual><geometry><cilinder/></geometry></visual>"),
            ("cilinder", "", "cylinder"),
        ),
        (
            in_link('<visual><geometry><cylinder radius="1" lenght="1"/></geometry></visual>'),
            ("cylinder", "lenght", "length"),
        ),
    ],
)
def test_similar_name(text, wanted):
    assert found(text) == [wanted]


@pytest.mark.parametrize(
    "text",
    [
        '<robot name="r" version="1.0"/>',
        '<robot name="r"><gazebo reference="l"><mu1>1</mu1><kp value="2"/></gazebo></robot>',
        '<robot name="r"><transmission name="t"><type>a</type></transmission></robot>',
        '<robot name="r"><ros2_control><joint name="j"><command_interface/></joint>'
        "</ros2_control></robot>",
        '<robot name="r"><mujoco><compiler meshdir="m"/></mujoco></robot>',
        '<robot name="r"><drake:acceleration xmlns:drake="d"/></robot>',
        '<robot name="r"><loop_joint name="a" type="ball"/></robot>',
        '<robot name="r"><material name="m"><color rgba="1 1 1 1"/></material></robot>',
        in_joint('<limit lower="0" upper="1" effort="2" velocity="3"/>'),
        in_joint('<hardwareInterface>x</hardwareInterface><calibration rising="0"/>'),
        in_joint('<safety_controller k_position="1" k_velocity="1"/>'),
        in_link("<contact><lateral_friction/></contact><self_collision_checking/>"),
        in_link("<collision><verbose/></collision><sensor name='s'/>"),
        in_link('<visual><geometry><sdf filename="a"/></geometry></visual>'),
        in_link('<visual><geometry><capsule radius="1" length="1"/></geometry></visual>'),
    ],
)
def test_known_and_extension_names(text):
    assert found(text) == []


def test_present_attribute_is_not_suggested():
    assert found(in_joint('<limit lower="0" lowe="0" upper="1"/>')) == []


def test_several_misspellings():
    text = in_joint('<limt lower="1"/><axis xzy="1 0 0"/>')
    assert sorted(found(text)) == [("axis", "xzy", "xyz"), ("limt", "", "limit")]


def test_contents_of_extensions_are_ignored():
    text = '<robot name="r"><gazebo><lnik nmae="a"/><limt/></gazebo></robot>'
    assert found(text) == []


def test_deep_document_needs_no_recursion():
    text = '<robot name="r">' + '<link nam="l"/>' * 5000 + "</robot>"
    assert len(found(text)) == 5000


# xacro


@pytest.mark.parametrize("text", ["${a}", "1 ${b} 2", "$(arg x)", "$(arg x)/mesh.stl"])
def test_has_variable(text):
    assert has_variable(text)


@pytest.mark.parametrize("text", ["", "1 2 3", "$5", "{a}", "(arg x)", "package://a/b"])
def test_has_no_variable(text):
    assert not has_variable(text)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ('<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro/></robot>', "<macro>"),
        ('<robot xmlns:x="http://ros.org/wiki/xacro"><x:property/></robot>', "<property>"),
        ('<robot name="r"><link name="${prefix}l"/></robot>', "'${prefix}l'"),
        ('<robot name="$(arg name)"/>', "'$(arg name)'"),
    ],
)
def test_unexpanded_xacro(text, what):
    assert [word for _, word in unexpanded_xacro(etree.fromstring(text))] == [what]


def test_prefix_without_namespace():
    parser = etree.XMLParser(recover=True)
    root = etree.fromstring('<robot name="r"><xacro:include filename="a"/></robot>', parser)
    assert [word for _, word in unexpanded_xacro(root)] == ["<xacro:include>"]


def test_first_xacro_element_is_reported():
    text = '<robot name="r"><link name="${a}"/><link name="${b}"/></robot>'
    (told,) = unexpanded_xacro(etree.fromstring(text))
    assert told[0].get("name") == "${a}"


def test_robot_without_xacro():
    text = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="r"><link name="l"/></robot>'
    assert list(unexpanded_xacro(etree.fromstring(text))) == []

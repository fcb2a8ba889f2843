import pytest
from lxml import etree

from terrainkit_robots.description.urdf.tags import has_variable, misspelled_names, unexpanded_xacro
from tests.tables import read_table


def found(inner):
    """Return tag, attribute and known word of each misspelled name in a robot."""
    root = etree.fromstring(f'<robot name="r">{inner}</robot>')
    return [(element.tag, attribute, known) for element, attribute, known in misspelled_names(root)]


def in_joint(inner):
    return f'<joint name="j" type="revolute">{inner}</joint>'


@pytest.mark.parametrize(("text", "wanted"), read_table(__file__, "similar_name"))
def test_similar_name(text, wanted):
    assert found(text) == [tuple(wanted)]


@pytest.mark.parametrize("text", read_table(__file__, "known_names"))
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


@pytest.mark.parametrize(("text", "what"), read_table(__file__, "first_unexpanded_xacro"))
def test_first_unexpanded_xacro(text, what):
    root = etree.fromstring(text, etree.XMLParser(recover=True))
    assert [word for _, word in unexpanded_xacro(root)] == what

import pytest

from terrainkit_robots.description.load import load_robot
from terrainkit_robots.description.xacro.expansion import XacroError, expand_xacro

HEAD = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'


@pytest.fixture
def write(tmp_path):
    def write(name, *lines):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("\n".join([HEAD, *lines, "</robot>"]))
        return path

    return write


LEG = (
    '<xacro:macro name="leg" params="side y">',
    '  <link name="${side}_leg">',
    '    <inertial><mass value="${2 * 0.25}"/></inertial>',
    "  </link>",
    '  <joint name="${side}_joint" type="fixed">',
    '    <parent link="base"/><child link="${side}_leg"/><origin xyz="0 ${y} 0"/>',
    "  </joint>",
    "</xacro:macro>",
)


def test_macro_elements_have_source_lines(write):
    write("parts/leg.xacro", *LEG)
    path = write(
        "r.xacro",
        '<xacro:include filename="parts/leg.xacro"/>',
        '<link name="base"/>',
        '<xacro:leg side="left" y="0.1"/>',
        '<xacro:leg side="right" y="${-0.1}"/>',
    )
    model = load_robot(path)
    assert model.kind == "xacro"
    assert model.problems == ()
    assert [link.name for link in model.links] == ["base", "left_leg", "right_leg"]
    assert model.links[1].inertial.mass == 0.5
    assert [joint.origin[1, 3] for joint in model.joints] == [0.1, -0.1]
    assert (model.links[0].source.file, model.links[0].source.line) == (path, 3)
    assert model.links[2].source.file == path.parent / "parts/leg.xacro"
    assert model.links[2].source.line == 3
    assert model.links[2].source.element is None  # nothing in it can be edited
    assert set(model.sources) == {path, path.parent / "parts/leg.xacro"}


def test_missing_argument_is_named(write):
    path = write("r.xacro", '<link name="a"/>', '<link name="$(arg side)_b"/>')
    (problem,) = load_robot(path).problems
    assert problem.code == "XML005"
    assert "--xacro-arg side:=VALUE" in problem.message
    assert problem.source.line == 3
    model = load_robot(path, xacro_arguments={"side": "left"})
    assert [link.name for link in model.links] == ["a", "left_b"]


def test_missing_package_is_named(write):
    leg = write("legs_description/urdf/leg.xacro", '<link name="leg"/>')
    text = '<xacro:include filename="$(find legs_description)/urdf/leg.xacro"/>'
    path = write("somewhere/else/entirely/r.xacro", text)
    model = load_robot(path, packages={"legs_description": leg.parents[1]})
    assert [link.name for link in model.links] == ["leg"]
    (leg.parents[1] / "package.xml").write_text("<package><name>legs_description</name></package>")
    beside = write("legs_description/robots/r.xacro", text)
    assert [link.name for link in load_robot(beside).links] == ["leg"]
    lost = write("r.xacro", '<xacro:include filename="$(find no_such_package_at_all)/x.xacro"/>')
    (problem,) = load_robot(lost).problems
    assert "--package no_such_package_at_all=FOLDER" in problem.message


@pytest.mark.parametrize(
    "expression",
    [
        "${open('/etc/hostname').read()}",
        "${__import__('os').getcwd()}",
        "${().__class__.__bases__}",
        "${1 / 0}",
        "${[}",
        "$(find)",
        "$(eval open('/etc/hostname').read())",
    ],
)
def test_unsafe_expression_is_a_problem(write, expression):
    (problem,) = load_robot(write("r.xacro", f'<link name="{expression}"/>')).problems
    assert problem.code == "XML005"
    assert "Traceback" not in problem.message
    assert "\n" not in problem.message


def test_limits(write):
    endless = write("endless.xacro", '<link name="${10**10**10}"/>')
    with pytest.raises(XacroError, match="longer than 1 s"):
        expand_xacro(endless, {}, {}, timeout=1.0)
    huge = write("huge.xacro", "<link name=\"${'a' * 10**11}\"/>")
    with pytest.raises(XacroError, match="memory"):
        expand_xacro(huge, {}, {})
    loop = write("loop.xacro", '<xacro:macro name="m"><xacro:m/></xacro:macro><xacro:m/>')
    with pytest.raises(XacroError, match=r"without end|recursion"):
        expand_xacro(loop, {}, {})


def test_broken_file_is_reported_once(write, tmp_path):
    path = tmp_path / "r.xacro"
    path.write_text(HEAD + '<link name="a">')
    assert {problem.code for problem in load_robot(path).problems} == {"XML001"}
    include = write("s.xacro", '<xacro:include filename="r.xacro"/>')
    assert [problem.code for problem in load_robot(include).problems] == ["XML005"]

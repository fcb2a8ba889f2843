"""Xacro is expanded without ROS; what fails is told with its place, and nothing else is done."""

import os
from pathlib import Path

import pytest

from terrainkit_robots.description.load import load_robot
from terrainkit_robots.description.xacro.process import _check_expression, _RejectedError
from terrainkit_robots.description.xacro.reader import XacroError, expand_xacro
from tests.tables import read_table
from tests.terrainkit_robots.description.made_robots import codes, write_all


def wrapped(inside):
    """Return a robot; its second line is the first of what is inside."""
    return f'<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">\n{inside}\n</robot>'


def write(folder, inside, **files):
    """Write robot.xacro, and others beside it by their stems."""
    texts = {f"{stem}.xacro": wrapped(text) for stem, text in {"robot": inside, **files}.items()}
    return write_all(folder / "pack/urdf", texts)


def failure(file, **limits):
    with pytest.raises(XacroError) as caught:
        expand_xacro(file, {}, {}, **limits)
    assert "\n" not in str(caught.value)
    assert "Traceback" not in str(caught.value)
    return caught.value


LEG = read_table(__file__, "leg")


def test_xacro_features(tmp_path):
    file = write(
        tmp_path,
        """<xacro:arg name="prefix" default="left"/>
<xacro:arg name="arms" default="false"/>
<xacro:property name="length" value="0.2"/>
<xacro:property name="values" value="${xacro.load_yaml('values.yaml')}"/>
<xacro:include filename="$(find pack)/urdf/leg.xacro"/>
<link name="base">
  <inertial><mass value="${values['mass'] * 2}"/></inertial>
</link>
<xacro:leg name="$(arg prefix)" length="${2 * length + pi}">
  <origin xyz="0 ${length} 0"/>
</xacro:leg>
<xacro:leg name="right" length="1"><origin xyz="0 -0.2 0"/></xacro:leg>
<xacro:if value="$(arg arms)"><link name="arm"/></xacro:if>
<xacro:unless value="$(arg arms)"><link name="no_arm"/></xacro:unless>""",
        leg=LEG,
    )
    (file.parent / "values.yaml").write_text("mass: 1.5")
    robot = load_robot(file, xacro_arguments={"prefix": "front"})
    assert (robot.problems, robot.kind) == ((), "xacro")
    sources = {each.name: each.source for each in robot.links}
    assert {name: (at.file.name, at.line, at.element) for name, at in sources.items()} == {
        "base": ("robot.xacro", 7, None),  # without an element, nothing can be edited
        "front_leg": ("leg.xacro", 3, None),
        "right_leg": ("leg.xacro", 3, None),
        "no_arm": ("robot.xacro", 15, None),
    }
    base, leg = robot.links[:2]
    assert (base.inertial.mass, base.inertial.source.line) == (3, 8)
    (shape,) = leg.collisions
    assert (shape.size, shape.source.line) == (pytest.approx((0.4 + 3.141592653589793,)), 4)
    assert [joint.origin[1, 3] for joint in robot.joints] == [0.2, -0.2]
    assert {path.name for path in robot.sources} == {"robot.xacro", "leg.xacro", "values.yaml"}


def test_packages_are_found(tmp_path):
    """A package is given, or beside the file, or named by its package.xml."""
    include = '<xacro:include filename="$(find {})/part.xacro"/>'
    part = {"part.xacro": wrapped('<link name="found"/>')}
    given = write(tmp_path / "a", include.format("other"))
    write_all(tmp_path / "else", part)
    robot = load_robot(given, packages={"other": tmp_path / "else"})
    assert robot.links[0].source.file == tmp_path / "else/part.xacro"
    named = write(tmp_path / "b", include.format("my_robot"))
    package = {"package.xml": "<package><name>my_robot</name></package>"}
    write_all(tmp_path / "b/pack", {**part, **package})
    assert [each.name for each in load_robot(named).links] == ["found"]


@pytest.mark.parametrize(("inside", "says", "place"), read_table(__file__, "errors_have_location"))
def test_errors_have_location(inside, says, place, tmp_path):
    file = write(tmp_path, inside, bad="<link>", part='\n\n<link name="${q}"/>')
    (file.parent / "entity.xacro").write_text('<!DOCTYPE r [<!ENTITY e "e">]><r>&e;</r>')
    os.mkfifo(file.parent / "pipe.xacro")
    error = failure(file)
    assert says in str(error)
    assert error.location == (file.with_name(f"{place[0]}.xacro"), place[1])


def test_failed_expansion_is_one_problem(tmp_path):
    file = write(tmp_path, '\n<link name="$(arg side)"/>')
    robot = load_robot(file)
    (problem,) = robot.problems
    assert (robot.kind, robot.links, problem.code) == ("xacro", (), "XML005")
    assert (problem.source.file, problem.source.line) == (file, 3)
    assert [each.name for each in load_robot(file, xacro_arguments={"side": "a"}).links] == ["a"]


def test_broken_file_is_not_expanded(tmp_path):
    file = write_all(tmp_path, {"r.xacro": "<robot><xacro:a>"})
    assert set(codes(load_robot(file))) == {"XML001"}


@pytest.mark.parametrize("value", ["${len(list(map(float, range(10**9))))}", "${10**10**10}"])
def test_time_limit(value, tmp_path):
    error = failure(write(tmp_path, f'<link name="{value}"/>'), timeout=0.6, max_memory=2**40)
    assert "takes more than 0.6 s" in str(error)


@pytest.mark.parametrize("value", ["${len('a' * 10**9)}", "${'a' * 10**11}"])
def test_memory_limit(value, tmp_path):
    error = failure(write(tmp_path, f'<link name="{value}"/>'), max_memory=2**28)
    assert "more than 0.25 GiB of memory" in str(error)


@pytest.mark.parametrize("expression", read_table(__file__, "unsafe_expressions_are_rejected"))
def test_unsafe_expressions_are_rejected(expression):
    with pytest.raises(_RejectedError, match="not allowed"):
        _check_expression(expression)


@pytest.mark.parametrize(
    "expression",
    ["2 * length + pi", "'{}_{}'.format(a, b)", "values['x'].y", "sin(radians(30))", "_a or b"],
)
def test_safe_expressions_are_allowed(expression):
    _check_expression(f" {expression} ")


@pytest.mark.parametrize("value", read_table(__file__, "side_effects_are_blocked"))
def test_side_effects_are_blocked(value, tmp_path):
    file = write(tmp_path, f'<link name="{value}"/>')
    before = sorted(tmp_path.rglob("*"))
    error = str(failure(file))
    assert "not defined" in error or "not allowed" in error
    assert "root:" not in error
    assert sorted(tmp_path.rglob("*")) == before


def test_code_in_robot_folder_is_not_run(tmp_path, monkeypatch):
    file = write(tmp_path, '<link name="a"/>')
    for name in ("json", "yaml", "xacro", "xml", "sitecustomize"):
        (file.parent / f"{name}.py").write_text("raise SystemExit('run')")
    monkeypatch.chdir(file.parent)
    assert b'name="a"' in expand_xacro(Path(file.name), {}, {})[0]
    robot = load_robot(Path(file.name))
    assert robot.file == robot.links[0].source.file == Path(file.name)


def test_secret_variables_are_hidden(tmp_path, monkeypatch):
    monkeypatch.setenv("ROBOT_MODEL", "big")
    monkeypatch.setenv("CI_TOKEN", "hidden")
    file = write(tmp_path, '<link name="$(env ROBOT_MODEL)$(optenv CI_TOKEN none)"/>')
    assert [each.name for each in load_robot(file).links] == ["bignone"]


def test_expand_decides_by_prefix_whatever_the_namespace(tmp_path):
    file = tmp_path / "robot.xacro"
    file.write_text(
        """<robot name="r" xmlns:xacro="http://playerstage.sourceforge.net/#interface">
<xacro:macro name="bar" params="name"><link name="${name}"/></xacro:macro>
<xacro:bar name="post"/>
</robot>"""
    )
    (link,) = load_robot(file).links
    assert (link.name, link.source.line) == ("post", 2)

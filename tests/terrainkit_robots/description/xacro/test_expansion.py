"""Xacro is expanded without ROS; what fails is told with its place, and nothing else is done."""

import os
from collections.abc import Mapping
from pathlib import Path

import pytest

from terrainkit_robots.description.load import load_robot
from terrainkit_robots.description.model import Problem, RobotModel
from terrainkit_robots.description.xacro.expansion import XacroError, expand_xacro
from terrainkit_robots.description.xacro.process import _check_expression, _RejectedError

NAMESPACE = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'


def write(folder: Path, inside: str, files: Mapping[str, str] | None = None) -> Path:
    """Write robot.xacro in folder/pack/urdf, and files beside it; line 2 is the first inside."""
    urdf = folder / "pack" / "urdf"
    everything = {"robot.xacro": inside, **(files or {})}
    for name, text in everything.items():
        (urdf / name).parent.mkdir(parents=True, exist_ok=True)
        whole = text if text.startswith("<?xml") or name.endswith(".yaml") else wrapped(text)
        (urdf / name).write_text(whole)
    return urdf / "robot.xacro"


def wrapped(inside: str) -> str:
    return f'<robot name="r" {NAMESPACE}>\n{inside}\n</robot>'


def places(robot: RobotModel) -> dict[str, tuple[str, int]]:
    return {each.name: (each.source.file.name, each.source.line) for each in robot.links}


def failure(file: Path, **limits: float) -> XacroError:
    with pytest.raises(XacroError) as told:
        expand_xacro(file, {}, {}, **limits)  # type: ignore[arg-type]
    assert "\n" not in str(told.value)
    assert "Traceback" not in str(told.value)
    return told.value


def told_at(error: XacroError) -> tuple[str, int] | None:
    return error.location and (error.location[0].name, error.location[1])


def test_expand_supports_xacro_features(tmp_path: Path) -> None:
    file = write(
        tmp_path,
        """<xacro:arg name="prefix" default="left"/>
<xacro:arg name="arms" default="false"/>
<xacro:property name="length" value="0.2"/>
<xacro:property name="values" value="${xacro.load_yaml('values.yaml')}"/>
<xacro:include filename="$(find pack)/urdf/parts/leg.xacro"/>
<link name="base">
  <inertial><mass value="${values['mass'] * 2}"/></inertial>
</link>
<xacro:leg name="$(arg prefix)" length="${2 * length + pi}">
  <origin xyz="0 ${length} 0"/>
</xacro:leg>
<xacro:leg name="right" length="1"><origin xyz="0 -0.2 0"/></xacro:leg>
<xacro:if value="$(arg arms)"><link name="arm"/></xacro:if>
<xacro:unless value="$(arg arms)"><link name="no_arm"/></xacro:unless>""",
        {
            "parts/leg.xacro": """<xacro:macro name="leg" params="name length *origin">
<link name="${name}_leg">
  <collision>
    <geometry><sphere radius="${length}"/></geometry>
  </collision></link>
<joint name="${name}" type="fixed"><parent link="base"/><child link="${name}_leg"/>
  <xacro:insert_block name="origin"/></joint>
</xacro:macro>""",
            "values.yaml": "mass: 1.5",
        },
    )
    robot = load_robot(file, xacro_arguments={"prefix": "front"})
    assert robot.problems == ()
    assert robot.kind == "xacro"
    assert places(robot) == {
        "base": ("robot.xacro", 7),
        "front_leg": ("leg.xacro", 3),
        "right_leg": ("leg.xacro", 3),
        "no_arm": ("robot.xacro", 15),
    }
    base, leg = robot.links[0], robot.links[1]
    assert base.inertial is not None
    assert base.inertial.mass == 3
    assert base.inertial.source.line == 8
    assert base.inertial.source.element is None  # no fix can be written
    (shape,) = leg.collisions
    assert shape.size == pytest.approx((0.4 + 3.141592653589793,))
    assert shape.source.line == 4
    assert robot.joints[0].origin[1, 3] == 0.2
    assert {path.name for path in robot.sources} == {"robot.xacro", "leg.xacro", "values.yaml"}


def test_given_package(tmp_path: Path) -> None:
    file = write(tmp_path / "a", '<xacro:include filename="$(find other)/part.xacro"/>')
    part = tmp_path / "elsewhere" / "part.xacro"
    part.parent.mkdir()
    part.write_text(wrapped('<link name="found"/>'))
    robot = load_robot(file, packages={"other": part.parent})
    assert [each.name for each in robot.links] == ["found"]
    assert robot.links[0].source.file == part


def test_package_xml(tmp_path: Path) -> None:
    file = write(tmp_path, '<xacro:include filename="$(find my_robot)/urdf/part.xacro"/>')
    (tmp_path / "pack" / "package.xml").write_text("<package><name>my_robot</name></package>")
    (file.parent / "part.xacro").write_text(wrapped('<link name="found"/>'))
    assert [each.name for each in load_robot(file).links] == ["found"]


@pytest.mark.parametrize(
    ("inside", "says", "place"),
    [
        ('\n<link name="$(arg side)"/>', "--xacro-arg side:=VALUE", ("robot.xacro", 3)),
        ("\n<link name=\"${xacro.arg('side')}\"/>", "--xacro-arg side:=", ("robot.xacro", 3)),
        (
            '\n\n<xacro:include filename="$(find gone)/x.xacro"/>',
            "package gone: not found; pass its folder with --package gone=FOLDER",
            ("robot.xacro", 4),
        ),
        ('\n<xacro:include filename="gone.xacro"/>', "gone.xacro: No such", ("robot.xacro", 3)),
        ('\n<xacro:include filename="bad.xacro"/>', "malformed XML", ("bad.xacro", 3)),
        ('<xacro:include filename="part.xacro"/>', "name 'q' is not", ("part.xacro", 4)),
        ('<xacro:include filename="entity.xacro"/>', "entities", ("robot.xacro", 2)),
        ('<xacro:include filename="/dev/zero"/>', "not a regular file", ("robot.xacro", 2)),
        ('\n<link name="${1 +}"/>', "invalid expression '1 +'", ("robot.xacro", 3)),
        ("\n<xacro:leg/>", "unknown macro name: xacro:leg", ("robot.xacro", 3)),
        (
            '<xacro:macro name="leg" params="side"><link name="${side}"/></xacro:macro>\n'
            "\n<xacro:leg/>",
            "Undefined parameters [side] of macro leg",
            ("robot.xacro", 4),
        ),
        ('<link name="$(env NO_SUCH_VARIABLE)"/>', "NO_SUCH_VARIABLE", ("robot.xacro", 2)),
        (
            '<xacro:macro name="m"><xacro:m/></xacro:macro><xacro:m/>',
            "recurses",
            ("robot.xacro", 2),
        ),
    ],
)
def test_errors_have_location(
    inside: str, says: str, place: tuple[str, int], tmp_path: Path
) -> None:
    file = write(
        tmp_path,
        inside,
        {
            "bad.xacro": "<link>",
            "part.xacro": '\n\n<link name="${q}"/>',
            "entity.xacro": '<?xml version="1.0"?><!DOCTYPE r [<!ENTITY e "e">]><r>&e;</r>',
        },
    )
    error = failure(file)
    assert says in str(error)
    assert told_at(error) == place


def only(robot: RobotModel) -> Problem:
    assert len(robot.problems) == 1, robot.problems
    return robot.problems[0]


def test_failed_expansion_is_one_problem(tmp_path: Path) -> None:
    robot = load_robot(write(tmp_path, '\n<link name="$(arg side)"/>'))
    assert robot.kind == "xacro"
    assert robot.links == ()
    problem = only(robot)
    assert problem.code == "XML005"
    assert "--xacro-arg side:=" in problem.message
    assert problem.source.line == 3


def test_time_limit(tmp_path: Path) -> None:
    file = write(tmp_path, '<link name="${len(list(map(float, range(10**9))))}${10**10**10}"/>')
    error = failure(file, timeout=0.6)
    assert "longer than 0.6 s" in str(error) or "memory" in str(error)


def test_memory_limit(tmp_path: Path) -> None:
    pytest.importorskip("resource")
    error = failure(write(tmp_path, "<link name=\"${len('a' * 10**9)}\"/>"), max_memory=2**28)
    assert "more than 0.25 GiB of memory" in str(error)


@pytest.mark.parametrize(
    "expression",
    [
        "__import__('os')",
        "().__class__.__base__.__subclasses__()",
        "(lambda: ().__class__)()",
        "[x.__class__ for x in [1]]",
        "(x for x in [1]).gi_frame.f_back.f_globals['os'].system('true')",
        "math.__loader__",
        "str.mro()",
        "(lambda: 0).__globals__",
    ],
)
def test_unsafe_expressions_are_rejected(expression: str) -> None:
    with pytest.raises(_RejectedError, match="not allowed"):
        _check_expression(expression)


@pytest.mark.parametrize(
    "expression",
    ["2 * length + pi", "'{}_{}'.format(a, b)", "values['x'].y", "sin(radians(30))", "not a or b"],
)
def test_safe_expressions_are_allowed(expression: str) -> None:
    _check_expression(f" {expression} ")


@pytest.mark.parametrize(
    "value",
    [
        "${open('/etc/passwd').read()}",
        "${__import__('os').mkdir('written')}",
        "${(lambda: ().__class__.__base__.__subclasses__())()}",
        "${python.vars(python.type(xacro.load_yaml))}",
        "$(eval [].__class__)",
        "$(eval arg.gi_frame)",
    ],
)
def test_side_effects_are_blocked(value: str, tmp_path: Path) -> None:
    file = write(tmp_path, f'<link name="{value}"/>')
    before = sorted(tmp_path.rglob("*"))
    error = failure(file)
    assert "not defined" in str(error) or "not allowed" in str(error)
    assert "root:" not in str(error)
    assert sorted(tmp_path.rglob("*")) == before


def test_code_in_robot_folder_is_not_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = write(tmp_path, '<link name="a"/>')
    for name in ("json", "yaml", "xacro", "xml", "sitecustomize"):
        (file.parent / f"{name}.py").write_text("raise SystemExit('run')")
    monkeypatch.chdir(file.parent)
    assert b'name="a"' in expand_xacro(Path(file.name), {}, {}).data


def test_secret_variables_are_hidden(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROBOT_MODEL", "big")
    monkeypatch.setenv("CI_TOKEN", "hidden")
    file = write(tmp_path, '<link name="$(env ROBOT_MODEL)$(optenv CI_TOKEN none)"/>')
    assert [each.name for each in load_robot(file).links] == ["bignone"]


def test_fifo_does_not_block(tmp_path: Path) -> None:
    if not hasattr(os, "mkfifo"):
        pytest.skip("this system has no FIFOs")
    file = write(tmp_path, '<xacro:include filename="pipe.xacro"/>')
    os.mkfifo(file.parent / "pipe.xacro")
    assert "not a regular file" in str(failure(file))


def test_relative_path_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = write(tmp_path, '<link name="a"/>')
    monkeypatch.chdir(file.parent)
    robot = load_robot(Path(file.name))
    assert robot.file == Path(file.name)
    assert robot.links[0].source.file == Path(file.name)

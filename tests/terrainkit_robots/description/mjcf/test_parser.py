"""What MuJoCo refuses is reported, each defect once, and the rest is read."""

import tomllib
from pathlib import Path

import mujoco
import pytest

from terrainkit_robots.description.mjcf import parser
from tests.tables import read_table
from tests.terrainkit_robots.description.made_robots import body, codes, joint, link, mjcf, read

REFUSED = tomllib.loads(Path(__file__).with_name("refused.toml").read_text())


def text_of(refused):
    if "text" in refused:
        return refused["text"]
    make = body if "body" in refused else mjcf
    return make(refused.get("body", refused.get("world")), refused.get("rest", ""))


def test_all_defects_are_reported():
    text = mjcf(
        '\n<body name="a" poss="1 2 3"><inertial pos="0 0 0" mass="1,5" diaginertia="1 1 1"/>'
        '\n<joint name="j" range="0 1 2"/><joint name="j"/><geom size="0.1" type="ball"/></body>'
        '\n<bodi name="a"><geom size="nan"/></bodi>',
        '<actuator><motor joint="j" gain="1"/><motr joint="j"/></actuator>',
    )
    robot = read(text)
    assert sorted((each.source.line, each.code, each.subject) for each in robot.problems) == [
        (1, "XML007", ""),
        (1, "XML007", ""),
        (2, "XML006", "a"),
        (2, "XML007", "a"),
        (3, "TRE001", "j"),
        (3, "XML006", "j"),
        (3, "XML011", "a"),
        (4, "TRE001", "a"),
        (4, "XML006", "a"),
        (4, "XML007", "a"),
    ]
    assert link(robot).inertial.mass == 1.5
    assert [each.name for each in robot.links] == ["a:j", "a", "a_2"]
    assert [each.joint for each in robot.actuators] == ["j", "j"]


@pytest.mark.parametrize("refused", REFUSED.values(), ids=REFUSED)
def test_defects_have_codes(refused):
    (problem,) = read(text_of(refused)).problems
    assert (problem.code, problem.source.line) == (refused["code"], 1)
    assert refused["says"] in problem.message
    assert "\n" not in problem.message


@pytest.mark.parametrize(
    ("names", "expected"),
    read_table(__file__, "attributes_that_are_no_numbers_are_reported_with_their_count"),
)
def test_attributes_that_are_no_numbers_are_reported_with_their_count(names, expected):
    for name in names.split():
        (problem,) = read(body(f'<geom type="capsule" {name}="nan"/>')).problems
        assert problem.message.startswith(f"{name} of <geom>: got 'nan'; expected {expected}")


@pytest.mark.parametrize("name", ["attribute", "element", "class", "geom", "key", "pos", "where"])
def test_mujoco_refuses_it_too(name):
    with pytest.raises(ValueError, match="Error"):
        mujoco.MjModel.from_xml_string(text_of(REFUSED[name]))


def test_suggested_names_are_read_unless_they_are_written():
    robot = read(
        body(
            '<geom sise="1"/><geom sise="1" size="2"/><geom usr="1" size="3"/>'
            '<gem size="4"><x/></gem><gem sise="5"/>'
        )
    )
    assert [each.size for each in link(robot).collisions] == [(1,), (2,), (3,), (4,), (5,)]
    (sise, *_) = [each for each in robot.problems if "sise" in each.message]
    assert " (2 times, next on line 1)" in sise.message
    assert sise.message.endswith("; did you mean size?")
    assert (sise.attribute, sise.severity) == ("sise", "error")


@pytest.mark.parametrize(
    ("attribute", "text", "repaired"), read_table(__file__, "commas_are_repaired")
)
def test_commas_are_repaired(attribute, text, repaired):
    robot = read(body(f'<geom type="capsule" {attribute}="{text}"/>'))
    fixes = [f'Set {attribute}="{text}".' if text else None for text in repaired]
    found = [problem.fix for problem in robot.problems]
    assert [fix and fix.description for fix in found] == fixes


def test_decimal_commas_are_all_reported():
    robot = read(mjcf("".join(f'\n<body name="b{k}" pos="0,1 2 3"/>' for k in range(60))))
    assert codes(robot) == ["XML006"] * 60
    assert joint(robot, "b7_fixed").origin[:3, 3].tolist() == [0.1, 2, 3]
    (edit,) = robot.problems[0].fix.edits
    assert (edit.name, edit.value) == (robot.problems[0].attribute, "0.1 2 3") == ("pos", "0.1 2 3")
    assert robot.problems[0].message.endswith(", with decimal points and separated by spaces")


def test_repeated_error_is_reported_once():
    robot = read(mjcf("".join(f'\n<body name="b{k}" poss="1 2 3"/>' for k in range(60))))
    (problem,) = robot.problems
    assert "60 times, next on line 3" in problem.message
    assert len(robot.links) == 60
    assert joint(robot, "b7_fixed").origin[:3, 3].tolist() == [1, 2, 3]


def test_names_of_duplicates_are_unused():
    robot = read(mjcf('<body name="a"/>' * 3 + '<body name="a_2"/>'))
    assert [each.name for each in robot.links] == ["a", "a_3", "a_4", "a_2"]


def test_first_of_exclusive_and_repeated_values_is_read():
    inertial = '<inertial pos="{} 0 0" mass="1" diaginertia="1 1 1"/>'
    turned = '<body name="b" euler="0 0 90" quat="1 0 0 0"/>'
    robot = read(body(inertial.format(1) + inertial.format(2) + turned))
    assert codes(robot) == ["XML011", "XML011"]
    assert link(robot).inertial.origin[0, 3] == 1
    assert joint(robot, "b_fixed").origin[1, 0] == pytest.approx(1)


def test_missing_mass_is_left_to_lint_rule():
    robot = read(body('<inertial pos="0 0 0" diaginertia="1 2 3"/>'))
    inertial = link(robot).inertial
    assert (robot.problems, inertial.mass) == ((), None)
    assert inertial.inertia.diagonal().tolist() == [1, 2, 3]


def test_renamed_top_level_default():
    inside = '<body name="a" childclass="old"><joint name="j"/></body>'
    robot = read(mjcf(inside, '<default class="old"><joint damping="3"/></default>'))
    assert (codes(robot), joint(robot).damping) == (["XML011"], 3)


def test_file_with_too_many_kinds_of_errors_is_not_checked(monkeypatch):
    monkeypatch.setattr(parser, "MAX_ATTEMPTS", 3)
    words = [f'w{k}="1"' for k in range(3)]
    two, three = (read(body(f"<geom size='1' {' '.join(words[:k])}/>")) for k in (2, 3))
    assert (codes(two), len(two.links)) == (["XML007"] * 2, 1)
    assert (codes(three), three.links) == (["XML007"] * 3 + ["XML011"], ())
    assert three.problems[-1].message.startswith("MuJoCo still rejects the file")
    monkeypatch.setattr(parser, "MAX_SECONDS", -1)
    assert codes(read(body("<geom size='1' w='1'/>"))) == ["XML007", "XML011"]


def test_no_log_file_and_no_warnings(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    inside = '<geom size="1" friction="nan" solref="nan 1"/><site rgba="nan 0 0 0"/>'
    read(body(inside, '<visual><map fogend="nan"/></visual>'))
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")
    assert mujoco.get_mju_user_warning() is None

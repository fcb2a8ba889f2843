"""What MuJoCo refuses is reported, each defect once, and the rest is read."""

import mujoco
import pytest

from terrainkit_robots.description.mjcf import parser
from tests.terrainkit_robots.description.made_robots import body, codes, joint, link, mjcf, read


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


REFUSED = {
    # numbers
    "few": (body("<body pos='1 2'/>"), "XML006", "pos of <body>: got '1 2'; expected 3 numbers"),
    "many": (body("<body pos='1 2 3 4'/>"), "XML006", "got '1 2 3 4'; expected 3 numbers"),
    "nan": (body("<body pos='nan 0 0'/>"), "XML006", "'nan 0 0'"),
    "inf": (body("<body pos='inf 0 0'/>"), "XML006", "'inf 0 0'"),
    "large": (body("<body pos='1e308 0 0'/>"), "XML006", "'1e308 0 0'"),
    "word": (body("<body pos='x 0 0'/>"), "XML006", "'x 0 0'"),
    "quat": (body("<body quat='1 0 0'/>"), "XML006", "'1 0 0'; expected 4 numbers"),
    "range": (
        body("<joint range='1'/>"),
        "XML006",
        "range of <joint>: got '1'; expected 2 numbers",
    ),
    "size": (body("<geom size='1 2 3 4'/>"), "XML006", "size of <geom>: got '1 2 3 4'; expected 3"),
    "user": (body("<geom size='1' solimp='1 1 1 1 1 1'/>"), "XML006", "solimp of <geom>"),
    "whole": (body("<geom size='1' contype='1.5'/>"), "XML006", "contype of <geom>: got '1.5'"),
    "huge": (body("<geom size='1' contype='99999999999'/>"), "XML006", "expected a smaller number"),
    "mass": (body("<geom size='1' mass='-inf'/>"), "XML006", "got '-inf'; expected a number"),
    "infinite": (
        body("<joint name='j'/>", "<actuator><motor joint='j' ctrlrange='-inf x'/></actuator>"),
        "XML006",
        "ctrlrange of <motor>: got '-inf x'; expected 2 numbers",
    ),
    # words
    "attribute": (body("<geom sise='1'/>"), "XML007", "attribute sise of <geom> is unknown"),
    "similar": (body("<geom sise='1'/>"), "XML007", "; did you mean size?"),
    "strange": (body("<geom strange='1'/>"), "XML007", "strange of <geom>"),
    "element": (body("<gem size='1'/>"), "XML007", "<gem> in <body> is unknown to MuJoCo"),
    "tag": (body("<gem size='1'/>"), "XML007", "; did you mean <geom>?"),
    "section": ("<mujoco><strange/></mujoco>", "XML007", "<strange> in <mujoco>"),
    "keyword": (body("<geom type='ball'/>"), "XML011", "'ball' in type"),
    "angle": ("<mujoco><compiler angle='grad'/></mujoco>", "XML011", "'grad' in angle"),
    # names
    "body": (
        mjcf("<body name='a'/><body name='a'/><body name='a'/>"),
        "TRE001",
        "duplicate body a: also on line 1 and 1 more times; MuJoCo rejects the file",
    ),
    "joint": (body("<joint name='j'/><joint name='j'/>"), "TRE001", "joint j: also on line 1; MuJ"),
    "world": (mjcf("<body name='world'/>"), "TRE001", "duplicate body world: the name is taken; M"),
    "geom": (mjcf("<geom size='1' name='g'/>" * 2), "XML011", "'g' in geom"),
    "class": (body("<geom class='no'/>"), "XML011", "'no' in class"),
    "childclass": (mjcf("<body childclass='no'/>"), "XML011", "childclass 'no'"),
    # contents
    "quaternion": (body("<body name='b' quat='0 0 0 0'/>"), "XML011", "zero quaternion"),
    "two": (body("<body quat='1 0 0 0' euler='0 0 0'/>"), "XML011", "multiple"),
    "eulerseq": (mjcf("<body euler='1 2 3'/>", "<compiler eulerseq='xyq'/>"), "XML011", "sequence"),
    "letters": (body("", "<compiler eulerseq='xy'/>"), "XML011", "must have exactly 3 characters"),
    "where": (mjcf("<joint name='j'/>"), "XML011", "World body"),
    "pos": (body("<inertial mass='1' diaginertia='1 1 1'/>"), "XML013", "<inertial> has no pos; M"),
    "unique": (body("<inertial pos='0 0 0' mass='1'/>" * 2), "XML011", "found 2 times"),
    "key": (
        body("<joint/>", "<keyframe><key qpos='1 2'/></keyframe>"),
        "XML011",
        "qpos of <key>: got 2 numbers; expected 1; MuJoCo rejects the file",
    ),
    "limited": (
        body("<joint name='j' range='0 1'/>", "<compiler autolimits='false'/>"),
        "XML011",
        "joint j has a range but no limited, and autolimits is off",
    ),
}


@pytest.mark.parametrize(("text", "code", "says"), REFUSED.values(), ids=REFUSED)
def test_defects_have_codes(text, code, says):
    (problem,) = read(text).problems
    assert (problem.code, problem.source.line) == (code, 1)
    assert says in problem.message
    assert "\n" not in problem.message


@pytest.mark.parametrize("name", ["attribute", "element", "class", "geom", "key", "pos", "where"])
def test_mujoco_refuses_it_too(name):
    with pytest.raises(ValueError, match="Error"):
        mujoco.MjModel.from_xml_string(REFUSED[name][0])


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
    assert sise.details == {
        "attribute": "sise",
        "found": "sise",
        "known": "size",
        "refused": "mujoco",
    }


@pytest.mark.parametrize(
    ("attribute", "text", "repaired"),
    [
        ("mass", "1,5", ["1.5"]),
        ("size", "1, 2, 3", ["1 2 3"]),
        ("size", "1,5", ["1 5"]),  # of one, two and three numbers, the most that are possible
        ("size", "1;5", [""]),
        ("size", "+1 +2", []),
        ("rgba", "1,1,1,1", ["1 1 1 1"]),
    ],
)
def test_commas_are_repaired(attribute, text, repaired):
    robot = read(body(f'<geom type="capsule" {attribute}="{text}"/>'))
    assert [each.details["repaired"] for each in robot.problems] == repaired


def test_decimal_commas_are_all_reported():
    robot = read(mjcf("".join(f'\n<body name="b{k}" pos="0,1 2 3"/>' for k in range(60))))
    assert codes(robot) == ["XML006"] * 60
    assert joint(robot, "b7_fixed").origin[:3, 3].tolist() == [0.1, 2, 3]
    assert robot.problems[0].details == {"attribute": "pos", "repaired": "0.1 2 3"}
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
    monkeypatch.setattr(parser, "_MAX_ATTEMPTS", 3)
    words = [f'w{k}="1"' for k in range(3)]
    two, three = (read(body(f"<geom size='1' {' '.join(words[:k])}/>")) for k in (2, 3))
    assert (codes(two), len(two.links)) == (["XML007"] * 2, 1)
    assert (codes(three), three.links) == (["XML007"] * 3 + ["XML011"], ())
    assert three.problems[-1].message.startswith("MuJoCo still rejects the file")
    monkeypatch.setattr(parser, "_MAX_SECONDS", -1)
    assert codes(read(body("<geom size='1' w='1'/>"))) == ["XML007", "XML011"]


def test_no_log_file_and_no_warnings(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    inside = '<geom size="1" friction="nan" solref="nan 1"/><site rgba="nan 0 0 0"/>'
    read(body(inside, '<visual><map fogend="nan"/></visual>'))
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")
    assert mujoco.get_mju_user_warning() is None

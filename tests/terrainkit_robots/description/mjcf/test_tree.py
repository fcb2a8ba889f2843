"""An MJCF is read with the files that it includes and attaches, within limits."""

import mujoco
import pytest

from terrainkit_robots.description.load import load_robot
from terrainkit_robots.description.mjcf import tree
from terrainkit_robots.description.mjcf.tree import MAX_ELEMENTS
from tests.tables import read_table
from tests.terrainkit_robots.description import made_robots
from tests.terrainkit_robots.description.made_robots import codes, joint, link, mjcf, read

PART = '<x><worldbody><body name="b"/></worldbody></x>'


def names(robot):
    return [each.name for each in robot.links]


def load(folder, files):
    """Return the robot of the first of some files."""
    return load_robot(made_robots.write_all(folder, files))


def test_included_elements_have_file_and_line(tmp_path):
    file = made_robots.write_all(
        tmp_path,
        {
            "robot.xml": '<mujoco>\n<include file="parts/defaults.xml"/>\n<worldbody>\n'
            '<body name="a"><include file="parts/leg.xml"/></body>\n</worldbody></mujoco>',
            "parts/defaults.xml": "<mujocoinclude><default><joint\n damping='2'/></default>"
            "</mujocoinclude>",
            "parts/leg.xml": '<mujoco>\n<body name="leg">\n<joint name="j"/>'
            '<include file="parts/foot.xml"/></body></mujoco>',
            "parts/foot.xml": '<x>\n\n<geom name="foot" size="1"/></x>',
        },
    )
    robot = load_robot(file)
    assert robot.problems == ()
    (foot,) = link(robot, "leg").collisions
    sources = [each.source for each in (link(robot), link(robot, "leg"), joint(robot), foot)]
    assert [(each.file.name, each.line, each.element) for each in sources] == [
        ("robot.xml", 4, 3),
        ("leg.xml", 2, 1),
        ("leg.xml", 3, 2),
        ("foot.xml", 3, 1),
    ]
    assert joint(robot).damping == 2
    parts = [tmp_path / f"parts/{name}.xml" for name in ("defaults", "leg", "foot")]
    assert robot.sources == (file, *parts)
    mujoco.MjSpec.from_file(str(file))  # so does MuJoCo


def test_one_file_is_included_by_two_links(tmp_path):
    file = made_robots.write_all(
        tmp_path,
        {
            "robot.xml": '<mujoco><worldbody><body name="a"><include file="left.xml"/></body>'
            '<body name="b"><include file="right.xml"/></body></worldbody></mujoco>',
            "pad.xml": '<x><geom size="1"/></x>',
        },
    )
    for name in ("left.xml", "right.xml"):
        (tmp_path / name).symlink_to("pad.xml")
    robot = load_robot(file)
    assert robot.problems == ()
    assert [len(link(robot, name).collisions) for name in "ab"] == [1, 1]
    mujoco.MjSpec.from_file(str(file))


def test_include_relative_to_including_file(tmp_path):
    file = made_robots.write_all(
        tmp_path,
        {
            "robot.xml": '<mujoco><include file="sub/a.xml"/></mujoco>',
            "sub/a.xml": '<x><include file="b.xml"/></x>',
            "sub/b.xml": PART.replace('"b"', '"beside"'),
        },
    )
    assert link(load_robot(file), "beside").source.file == tmp_path / "sub" / "b.xml"
    (tmp_path / "b.xml").write_text(PART.replace('"b"', '"top"'))
    assert names(load_robot(file)) == ["top"]
    assert [each.name for each in mujoco.MjSpec.from_file(str(file)).bodies] == ["world", "top"]


def test_file_may_be_included_by_several_models(tmp_path):
    """Each model has its own includes; only within one may no file be included twice."""
    part = '<include file="part.xml"/>'
    hand = '<asset><model name="h" file="hand.xml"/></asset>'
    attach = '<body name="arm"><attach model="h" body="b" prefix="p_"/></body>'
    files = {"robot.xml": mjcf(attach, part + hand), "hand.xml": f"<mujoco>{part}</mujoco>"}
    robot = load(tmp_path, files | {"part.xml": PART})
    assert (robot.problems, names(robot)) == ((), ["b", "arm", "p_b"])


@pytest.mark.parametrize(("include", "says", "subject"), read_table(__file__, "broken_includes"))
def test_broken_includes_are_reported(include, says, subject, tmp_path):
    robot = load(
        tmp_path,
        {
            "robot.xml": f'<mujoco>\n{include}<worldbody><body name="a"/></worldbody></mujoco>',
            "part.xml": PART,
            "circle.xml": '<x><include file="circle.xml"/></x>',
            "round.xml": '<x><include file="robot.xml"/></x>',
            "empty.xml": "<x/>",
            "large.xml": "",
        },
    )
    problem = robot.problems[-1]
    assert {each.code for each in robot.problems} <= {"XML001", "XML012"}
    assert (problem.code, problem.subject) == ("XML012", subject)
    assert says in problem.message
    assert link(robot)


def test_contents_replace_files(tmp_path):
    file = tmp_path / "robot.xml"
    data = b'<mujoco><include file="part.xml"/></mujoco>'
    robot = load_robot(file, contents={file: data, tmp_path / "part.xml": PART.encode()})
    assert names(robot) == ["b"]


ARM = """<mujoco><compiler angle="radian"/><asset><model name="h" file="{}"/></asset><worldbody>
  <body name="arm"><frame pos="0 0 1"><attach model="h" body="hand" prefix="l_"/></frame></body>
</worldbody></mujoco>"""


def test_attached_model_keeps_its_settings(tmp_path):
    hand = """<mujoco><compiler angle="degree" meshdir="m"/><asset><mesh name="b" file="b.stl"/>
      </asset><worldbody>\n<body name="hand">
      <joint name="j" range="-90 90"/><geom type="mesh" mesh="b"/></body></worldbody></mujoco>"""
    robot = load(tmp_path, {"robot.xml": ARM.format("sub/hand.xml"), "sub/hand.xml": hand})
    assert robot.problems == ()
    found, attached = link(robot, "l_hand"), joint(robot, "l_j")
    assert (found.source.file.name, found.source.line) == ("hand.xml", 3)
    assert attached.limit.upper == pytest.approx(3.141592653589793 / 2)
    assert attached.origin[:3, 3].tolist() == [0, 0, 1]
    assert found.collisions[0].mesh.path == tmp_path / "sub" / "m" / "b.stl"
    assert [path.name for path in robot.sources] == ["robot.xml", "hand.xml"]


@pytest.mark.parametrize(("model", "says"), read_table(__file__, "invalid_attachments"))
def test_invalid_attachments_are_reported(model, says, tmp_path):
    robot = load(
        tmp_path,
        {
            "robot.xml": ARM.format(model),
            "round.xml": ARM.format("robot.xml").replace('"arm"', '"hand"'),
            "robot.urdf": "<robot name='r'/>",
        },
    )
    problem = robot.problems[0]
    assert problem.code == "XML012"
    assert says in problem.message
    assert link(robot, "arm")


@pytest.mark.parametrize(
    ("inside", "rest"),
    [
        ('<body name="b"><geom size="1" user="{}"/></body>'.format("1 " * 100_000), ""),
        ("", '<asset><hfield name="h" nrow="99999" ncol="99999" size="1 1 1 1"/></asset>'),
        ("", '<asset><mesh name="m" builtin="sphere" params="100000 1 1"/></asset>'),
        ("", '<custom><numeric name="n" size="500000000" data="1"/></custom>'),
        ('<flexcomp name="f" type="grid" count="1000 1000 1000"/>', ""),
    ],
    ids=["user", "hfield", "mesh", "numeric", "flexcomp"],
)
def test_attributes_that_take_memory_are_not_read(inside, rest):
    assert names(read(mjcf(f'<body name="a"/>{inside}', rest)))[0] == "a"


def test_replicas_up_to_the_limit_are_created(monkeypatch):
    """Root, world and replicate are three elements; each copy is one."""
    monkeypatch.setattr(tree, "MAX_ELEMENTS", 20)
    found = [
        read(mjcf(f'<replicate count="{count}"><body name="a"/></replicate>'))
        for count in (17, 18, 10**9)
    ]
    too_many = (1, ["XML011"])
    assert [(len(each.links), codes(each)) for each in found] == [(17, []), too_many, too_many]
    assert "replicas are not created" in found[1].problems[0].message


@pytest.mark.parametrize(("length", "is_read"), [(4999, True), (5000, False)])
def test_long_attributes_count_as_elements(length, is_read, monkeypatch):
    """Root, world and body are three elements; the name is as long as four or five others."""
    monkeypatch.setattr(tree, "MAX_ELEMENTS", 7)
    robot = read(mjcf(f'<body name="{"a" * length}"/>'))
    assert (len(robot.links), codes(robot)) == ((1, []) if is_read else (0, ["XML011"]))


def test_too_many_elements_are_reported(monkeypatch):
    assert MAX_ELEMENTS == 8000
    monkeypatch.setattr(tree, "MAX_ELEMENTS", 20)
    few, many = (read(mjcf("<body/>" * count)) for count in (18, 19))
    assert (len(few.links), codes(few)) == (18, [])
    assert (many.links, codes(many)) == ((), ["XML011"])
    assert "more than 20" in many.problems[0].message


def test_number_of_files_is_bounded(tmp_path, monkeypatch):
    monkeypatch.setattr(tree, "MAX_FILES", 3)
    includes = "".join(f'<include file="p{k}.xml"/>' for k in range(3))
    files = {f"p{k}.xml": PART.replace('"b"', f'"b{k}"') for k in range(3)}
    robot = load(tmp_path, {"robot.xml": f"<mujoco>{includes}</mujoco>", **files})
    assert (names(robot), codes(robot)) == (["b0", "b1"], ["XML012"])
    assert "p2.xml is not read: too many" in robot.problems[0].message


def test_nested_attachments_are_bounded(tmp_path):
    files = {}
    for k in range(30):
        twice = "".join(f'<attach model="m" body="b" prefix="p{k}_"/>' for k in range(2))
        asset = f'<asset><model name="m" file="m{k + 1}.xml"/></asset>'
        files["robot.xml" if k == 0 else f"m{k}.xml"] = mjcf(
            f'<body name="b">{twice}</body>', asset
        )
    files["m30.xml"] = mjcf('<body name="b"/>')
    assert codes(load(tmp_path, files)) == ["XML011"]


@pytest.mark.parametrize(
    ("bodies", "found"), [((200, 199), []), ((200, 200), ["XML011"]), ((90,) * 10, ["XML011"])]
)
def test_depth_is_bounded(bodies, found, tmp_path):
    """Each file has bodies in each other, and includes the next; the world is 1 deep."""
    files = {"robot.xml": mjcf('<include file="p0.xml"/>')}
    for k, count in enumerate(bodies):
        inside = f'<include file="p{k + 1}.xml"/>' if k + 1 < len(bodies) else ""
        files[f"p{k}.xml"] = f"<x>{'<body>' * count}{inside}{'</body>' * count}</x>"
    robot = load(tmp_path, files)
    assert (len(robot.links), codes(robot)) == (399, found)


# Elements that MuJoCo would open or cannot have


def test_root_of_an_included_part_is_reported():
    robot = read('<mujocoinclude><worldbody><body name="a"/></worldbody></mujocoinclude>')
    (problem,) = robot.problems
    assert problem.code == "XML002"
    assert "got <mujocoinclude>, a part of a model; expected <mujoco>" in problem.message
    assert names(robot) == ["a"]


def test_plugins_and_soft_bodies_are_skipped():
    robot = read(
        mjcf(
            '<body name="a"><plugin plugin="p"><config key="k" value="v"/></plugin>'
            '<joint name="j"/></body><flexcomp name="f" type="grid" count="9 9 9"/>',
            '<extension><plugin plugin="p"/></extension><deformable/>'
            '<actuator><plugin plugin="p" instance="i" joint="j"/></actuator>'
            '<contact><exclude body1="a" body2="gone"/></contact>',
        )
    )
    assert robot.problems == ()  # without the soft body, no reference is sure to be wrong
    assert (names(robot), [each.joint for each in robot.actuators]) == (["a"], ["j"])

import pytest

from terrainkit_robots.description.load import load_robot
from tests.tables import read_table
from tests.terrainkit_robots.description.made_robots import codes, write_all

URDF = """<robot name="dog"><link name="base"/><link name="foot"/><joint name="ankle" type="fixed">
  <parent link="base"/><child link="foot"/></joint></robot>"""
GROUP = '<group name="g"/>'
WRONG = '<robot name="dog"><passive_joint name="nobody"/></robot>'


def problems(tmp_path, srdf, name="urdf/robot.srdf", **others):
    files = {"urdf/robot.urdf": URDF, name: srdf, **others}
    return load_robot(write_all(tmp_path, files)).problems


@pytest.mark.parametrize(
    ("text", "kind", "place"),
    [
        *read_table(__file__, "names_that_the_robot_lacks_are_reported"),
        (GROUP + '<group_state group="{}"/>', "group", "group of <group_state>"),
    ],
)
def test_names_that_the_robot_lacks_are_reported(text, kind, place, tmp_path):
    known = {"link": ["base"], "joint": ["ankle", "root_joint"], "group": ["g"]}[kind]
    for name in ["", *known]:
        assert problems(tmp_path, f"<robot>{text.format(name)}</robot>") == ()
    (problem,) = problems(tmp_path, f"<robot>\n{text.format('nobody')}</robot>")
    assert (problem.code, problem.subject) == ("TRE010", "nobody")
    assert (problem.source.file.name, problem.source.line) == ("robot.srdf", 2)
    assert problem.message == (
        "1 unknown name in robot.srdf: got nobody; expected names of the robot; the first is "
        f"{place}, a {kind}"
    )


def test_virtual_joints_are_known(tmp_path):
    text = '<robot><virtual_joint name="v"/><passive_joint name="v"/></robot>'
    assert problems(tmp_path, text) == ()


@pytest.mark.parametrize("folder", ["urdf", "urdf/srdf", "urdf/config", "srdf", "config"])
@pytest.mark.parametrize("stem", ["robot", "dog"])
def test_srdf_has_the_name_of_the_file_or_the_robot(folder, stem, tmp_path):
    known = '<link_sphere_approximation link="base"/>'
    text = WRONG.replace("<passive", f"{known}<passive")
    (problem,) = problems(tmp_path, text, f"{folder}/{stem}.srdf")
    assert problem.subject == "nobody"


def test_srdf_of_another_urdf_is_not_compared(tmp_path):
    others = {"urdf/dog.urdf": URDF}
    assert problems(tmp_path, WRONG, "urdf/dog.srdf", **others) == ()
    assert problems(tmp_path, WRONG, "urdf/cat.srdf") == ()


@pytest.mark.parametrize(("unknown", "found"), [(2, ["TRE010"]), (3, [])])
def test_srdf_of_another_variant_is_not_compared(unknown, found, tmp_path):
    """Half of the names have to exist, unless the SRDF has the name of the file."""
    names = ["ankle", "root_joint", *(f"n{k}" for k in range(unknown))]
    text = "".join(f'<passive_joint name="{name}"/>' for name in names * 2)
    srdf = f"<robot>{text}</robot>"
    assert [each.code for each in problems(tmp_path, srdf, "urdf/dog.srdf")] == found
    (problem,) = problems(tmp_path, srdf)
    assert problem.message.startswith(f"{unknown} unknown names in robot.srdf: got n0, n1")


def test_srdf_that_is_not_xml_is_reported(tmp_path):
    (problem,) = problems(tmp_path, "<robot>\n<group>")
    assert (problem.code, problem.source.file.name) == ("TRE010", "robot.srdf")


def test_srdf_that_cannot_be_read_is_not_compared(tmp_path):
    (tmp_path / "urdf/robot.srdf").mkdir(parents=True)
    (tmp_path / "urdf/robot.urdf").write_text(URDF)
    assert codes(load_robot(tmp_path / "urdf/robot.urdf")) == []

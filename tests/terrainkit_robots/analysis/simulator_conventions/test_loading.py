import os
import struct

import pytest

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.simulator_conventions import loading
from terrainkit_robots.analysis.simulator_conventions.loading import (
    LoadError,
    mujoco_load_error,
)
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from tests.robots import ROBOTS
from tests.small_robots import ball, joint, link, shape
from tests.tables import read_table

BODY = '<body><freejoint/><geom size="0.1"/></body>'
LINK = '<robot name="r"><link name="a"/></robot>'


def in_mujoco(robot, **options):
    return mujoco_load_error(robot.model, **options)


@pytest.fixture
def read(tmp_path):
    """Return a function that loads a robot from the text of a file."""

    def make(text, name=""):
        path = tmp_path / (name or ("robot.xml" if "<mujoco>" in text[:9] else "robot.urdf"))
        path.write_text(text)
        return Facts(load_robot(path))

    return make


@pytest.mark.parametrize("name", ROBOTS)
def test_robots_load(robot_file, name):
    robot = Facts(load_robot(robot_file(name)))
    assert in_mujoco(robot) is None


def test_load_error_names_element_of_mujoco(read):
    text = bundled.urdf_path("quadruped").read_text().replace('ixx="', 'ixx="9', 1)
    message = "inertia must satisfy A + B >= C; use 'balanceinertia' to fix"
    assert in_mujoco(read(text)) == LoadError(message=message, element="base")


@pytest.mark.parametrize("with_meshes", [True, False])
def test_load_error_has_line_of_urdf(read, with_meshes):
    text = bundled.urdf_path("quadruped").read_text()
    text = text.replace("<inertial>", "<inertial/><inertial>", 1)
    text = text.replace("</robot>", '<gazebo><plugin filename="p.so"/></gazebo></robot>')
    line = text[: text.index("<inertial>")].count("\n") + 1
    assert in_mujoco(read(text), with_meshes=with_meshes) == LoadError(
        message="repeated element: 'inertial'", line=line if with_meshes else 0
    )


@pytest.mark.parametrize(("name", "line"), [("c", 0), ("d", 2)])
def test_load_error_has_no_line_with_repeated_shape_names(read, name, line):
    named = ball(1).replace("<collision", "<collision name='{}'").format
    hinge = joint("a", "b", kind="hinge")
    text = f'<robot name="r">{link("a", named("c"), named(name))}{link("b")}\n{hinge}</robot>'
    # MuJoCo reads another text then.
    message = "invalid joint type in URDF joint definition"
    assert in_mujoco(read(text)) == LoadError(message=message, line=line)


def test_meshes_may_be_left_out_and_no_file_is_written(read, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = mesh_of("package://lost/lost.dae", "x")
    assert "Error opening file" in in_mujoco(read(text)).message
    assert [path.name for path in tmp_path.iterdir()] == ["robot.urdf"]
    assert in_mujoco(read(text), with_meshes=False) is None
    with pytest.raises(CannotCheckError, match="only URDF"):
        in_mujoco(read(f"<mujoco>{BODY}</mujoco>"), with_meshes=False)


GENERATED = "<asset><texture name='t' type='2d' builtin='flat' width='{}' height='9'/></asset>"


@pytest.mark.parametrize(
    ("inside", "why"),
    [
        *read_table(__file__, "costly_elements_are_not_passed_to_mujoco"),
        (GENERATED.format(4097), "texture: got 4097 pixels per side; expected at most 4096"),
    ],
)
def test_costly_elements_are_not_passed_to_mujoco(read, inside, why):
    robot = read(f"<mujoco>{inside}<worldbody>{BODY}</worldbody></mujoco>")
    with pytest.raises(CannotCheckError, match=why):
        in_mujoco(robot)


def test_cheap_elements_are_passed_to_mujoco_and_comments_not_counted(read, monkeypatch):
    cheap = '<!-- a --><size nuser_geom="1000" nkey="1000"/>' + GENERATED.format(9)
    monkeypatch.setattr(loading, "MAX_ELEMENTS", 8)
    assert in_mujoco(read(f"<mujoco>{cheap}<worldbody>{BODY}</worldbody></mujoco>")) is None


@pytest.mark.parametrize(
    ("limit", "message"),
    [
        ("MAX_BODIES", "number of bodies: got 3; expected at most 2 for MuJoCo"),
        ("MAX_ELEMENTS", "number of elements: expected at most 2"),
        # 1 name, 1 folder of the file, and 3 folders: its own, and 2 of the compiler.
        ("MAX_PATHS", "number of files and folders: got 3 paths; expected at most 2"),
    ],
)
def test_large_files_are_not_passed(read, monkeypatch, limit, message):
    folders = '<mujoco><compiler meshdir="x" texturedir="y"/></mujoco>'
    links = link("a", shape('mesh filename="m.stl"')) + link("b") + link("c")
    joints = joint("a", "b") + joint("b", "c")
    robot = read(f'<robot name="r">{folders}{links}{joints}</robot>')
    monkeypatch.setattr(loading, limit, 2)
    with pytest.raises(CannotCheckError, match=message):
        in_mujoco(robot)
    if limit != "MAX_ELEMENTS":
        monkeypatch.setattr(loading, limit, 3)
        assert "Error opening file" in in_mujoco(robot).message


def mesh_of(name, folder=""):
    part = link("a", shape(f'mesh filename="{name}"'))
    return f'<robot name="r"><mujoco><compiler meshdir="{folder}"/></mujoco>{part}</robot>'


@pytest.mark.parametrize(
    ("name", "folder"), [("m.stl", ""), ("else/m.stl", ""), ("m.stl", "in"), ("/dev/zero", "")]
)
def test_pipes_and_devices_are_never_opened(tmp_path, read, name, folder):
    (tmp_path / "in").mkdir()
    os.mkfifo(tmp_path / (folder or ".") / "m.stl")
    with pytest.raises(CannotCheckError, match=r"(m\.stl|zero) is not passed to MuJoCo"):
        in_mujoco(read(mesh_of(name, folder)))


@pytest.mark.parametrize("size", [2**25, 2**25 + 1])
def test_large_meshes_are_not_passed(tmp_path, read, size):
    with (tmp_path / "m.stl").open("wb") as file:
        file.truncate(size)
    robot = read(mesh_of("m.stl"))
    if size == 2**25:
        assert "STL" in in_mujoco(robot).message
        return
    with pytest.raises(CannotCheckError, match="expected at most 33,554,432 bytes"):
        in_mujoco(robot)


@pytest.mark.parametrize(("width", "is_large"), [(4096, False), (4097, True)])
def test_large_textures_are_not_passed(tmp_path, read, width, is_large):
    head = b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sII", 13, b"IHDR", width, 4096)
    (tmp_path / "t.png").write_bytes(head)
    texture = '<asset><texture type="2d" name="t" file="t.png"/></asset>'
    robot = read(f"<mujoco>{texture}<worldbody>{BODY}</worldbody></mujoco>")
    if is_large:
        with pytest.raises(CannotCheckError, match="got 4097 x 4096 pixels"):
            in_mujoco(robot)
    else:
        assert in_mujoco(robot) is not None


def test_included_files_are_checked(tmp_path, read):
    (tmp_path / "part.xml").write_text('<mujoco><size nkey="99999999"/></mujoco>')
    text = f'<mujoco><include file="part.xml"/><worldbody>{BODY}</worldbody></mujoco>'
    with pytest.raises(CannotCheckError, match="nkey"):
        in_mujoco(read(text))


def test_xacro_and_missing_files_are_not_passed(read):
    xacro = LINK.replace("<robot", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"')
    expanded, missing = read(xacro, "robot.xacro"), read(LINK)
    missing.model.file.unlink()
    with pytest.raises(CannotCheckError, match="xacro"):
        in_mujoco(expanded)
    with pytest.raises(CannotCheckError, match="there is no file"):
        in_mujoco(missing)


@pytest.mark.parametrize("with_meshes", [True, False])
def test_repeated_shape_names_print_nothing(read, capfd, with_meshes):
    text = bundled.urdf_path("quadruped").read_text().replace("<collision>", '<collision name="c">')
    assert text.count('name="c"') > 1
    assert in_mujoco(read(text), with_meshes=with_meshes) is None
    assert capfd.readouterr() == ("", "")

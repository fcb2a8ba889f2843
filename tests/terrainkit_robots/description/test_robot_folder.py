import pytest

from terrainkit_robots.description import robot_folder
from terrainkit_robots.description.robot_folder import robot_files
from terrainkit_robots.description.xml.document import RobotFileError
from tests.terrainkit_robots.description.made_robots import write_all

XACRO = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">{}</robot>'
LEG = '<xacro:macro name="leg" params="side"><link name="${side}_leg"/></xacro:macro>'
MJCF = "<mujoco>{}</mujoco>"
BODY = '<worldbody><body><joint/><geom size="1"/></body></worldbody>'
ROBOTS = {
    "a/robot.urdf": '<robot name="r"><link name="base"/></robot>',
    "a/broken.urdf": "<robot",
    "a/robot.xacro": XACRO.format(
        '<xacro:include filename="$(find a)/parts/leg.xacro"/><xacro:leg side="left"/>'
        '<xacro:include filename="itself.xacro"/>'
    ),
    "a/mjcf/robot.xml": MJCF.format(BODY),
    "a/mjcf/parts.xml": MJCF.format('<worldbody><include file="part.xml"/></worldbody>'),
}
OTHERS = {
    "a/package.xml": "<package><name>a</name></package>",
    "a/broken.xml": "<robot",
    "a/parts/leg.xacro": XACRO.format(LEG),
    "a/parts/shared.xacro": XACRO.format('<xacro:include filename="leg.xacro"/>' + LEG),
    "a/parts/materials.xacro": XACRO.format('<material name="blue"/>'),
    "a/robot.srdf.xacro": XACRO.format('<link name="base"/>'),
    "a/mjcf/part.xml": "<mujocoinclude><body><joint/></body></mujocoinclude>",
    "a/mjcf/scene.xml": MJCF.format('<include file="robot.xml"/>' + BODY),
    "a/mjcf/terrain.xml": MJCF.format('<worldbody><body><geom size="1"/></body></worldbody>'),
    "a/.git/robot.urdf": '<robot name="r"><link name="base"/></robot>',
    "build/robot.urdf": '<robot name="r"><link name="base"/></robot>',
    "build/COLCON_IGNORE": "",
}


@pytest.fixture
def folder(tmp_path):
    write_all(tmp_path, ROBOTS | OTHERS)
    return tmp_path


def test_robot_files_finds_robots(folder):
    (folder / "a" / "loop").symlink_to(folder)
    (folder / "a" / "itself.xacro").symlink_to("itself.xacro")
    (folder / "a" / "same.urdf").symlink_to("robot.urdf")
    found = [path.relative_to(folder).as_posix() for path in robot_files(folder)]
    assert found == sorted(ROBOTS)


def test_robot_files_does_not_count_other_files(folder, monkeypatch):
    monkeypatch.setattr(robot_folder, "MAX_FILES", 30)
    for k in range(31):
        (folder / f"{k}.png").touch()
    assert len(robot_files(folder)) == len(ROBOTS)


def test_robot_files_limits_number(folder, monkeypatch):
    monkeypatch.setattr(robot_folder, "MAX_FILES", 9)
    with pytest.raises(RobotFileError, match="got more than 9 files"):
        robot_files(folder)


def test_robot_files_needs_a_robot(folder):
    with pytest.raises(RobotFileError, match="got no robot file"):
        robot_files(folder / "a" / "parts")

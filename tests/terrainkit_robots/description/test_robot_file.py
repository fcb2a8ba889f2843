"""Tests of robots by name. The repositories of robot_descriptions are prepared in its cache."""

import subprocess
import sys
from pathlib import Path

import pytest

from terrainkit_robots import check_robot, load_robot
from terrainkit_robots.description.robot_file import find_robot, is_description
from terrainkit_robots.description.xml.document import RobotFileError

BOX = '<robot name="{}"><link name="box"/></robot>'
FLEXIV = """<robot name="flexiv" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="robot_type" default=""/>
  <xacro:include filename="$(find flexiv_description)/parts/base.xacro"/>
  <link name="$(arg robot_type)"/>
</robot>"""
BASE = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="base"/></robot>'
REPOSITORIES = {
    "unitree_ros/robots/go2_description/urdf/go2_description.urdf": BOX.format("go2"),
    "unitree_mujoco/data/a1/urdf/a1.urdf": BOX.format("a1"),
    "unitree_mujoco/data/a1/xml/a1.xml": '<mujoco model="a1"/>',
    "flexiv_description/urdf/flexiv.urdf.xacro": FLEXIV,
    "flexiv_description/parts/base.xacro": BASE,
}


pytest.importorskip("robot_descriptions")


@pytest.fixture(autouse=True)
def published(tmp_path_factory, monkeypatch) -> Path:
    """Return the cache of robot_descriptions, with small repositories; downloads fail."""
    cache = tmp_path_factory.mktemp("cache")
    for name, text in REPOSITORIES.items():
        repository, _, file = name.partition("/")
        path = cache / f"{repository}-HEAD" / repository / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    for repository in cache.glob("*/*"):
        for words in ("init -q", "-c user.name=a -c user.email=a@b commit -q -m a --allow-empty"):
            subprocess.run(["git", *words.split()], cwd=repository, check=True)
    monkeypatch.setenv("ROBOT_DESCRIPTIONS_CACHE", str(cache))
    monkeypatch.setenv("ROBOT_DESCRIPTION_COMMIT", "HEAD")
    monkeypatch.setenv("GIT_CONFIG_COUNT", "1")
    monkeypatch.setenv("GIT_CONFIG_KEY_0", f"url.{cache}/none/.insteadOf")
    monkeypatch.setenv("GIT_CONFIG_VALUE_0", "https://github.com/")
    for name in [name for name in sys.modules if name.startswith("robot_descriptions.")]:
        monkeypatch.delitem(sys.modules, name)
    return cache


def test_find_robot_by_name(published):
    found = find_robot("go2_description").path
    assert found.relative_to(published).parts[:2] == ("unitree_ros-HEAD", "unitree_ros")
    report = check_robot("go2_description", against="go2_description")
    assert report.facts.model.name == "go2"


@pytest.mark.parametrize(("name", "kind"), [("go2", "urdf"), ("a1_mj", "mjcf")])
def test_mj_name_prefers_mjcf(name, kind):
    assert load_robot(f"{name}_description").kind == kind


def test_load_robot_by_name_with_xacro_arguments():
    model = load_robot("enlight_description")
    assert [link.name for link in model.links] == ["base", "Enlight-L"]
    model = load_robot("enlight_description", xacro_arguments={"robot_type": "mine"})
    assert [link.name for link in model.links] == ["base", "mine"]


def test_find_robot_download_fails(capfd):
    message = "^solo_description: robot_descriptions cannot download it: .*example-robot-data"
    with pytest.raises(RobotFileError, match=message) as caught:
        find_robot("solo_description")
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


def test_find_robot_unknown_name():
    with pytest.raises(RobotFileError, match=r"^no robot go3_description .* go2_description"):
        find_robot("go3_description")
    with pytest.raises(
        RobotFileError, match=r"got go2, which .*; did you mean go2_description[?] B"
    ):
        find_robot("go2")
    with pytest.raises(RobotFileError, match=r"^cannot read a{5000}: File name too long"):
        find_robot("a" * 5000)


def test_find_robot_without_package(monkeypatch):
    monkeypatch.setitem(sys.modules, "robot_descriptions", None)
    with pytest.raises(RobotFileError, match=r"-U robot_descriptions$"):
        find_robot("go2_description")
    with pytest.raises(RobotFileError, match=r"does not exist; bundled robots are: biped"):
        find_robot("go2")


def test_find_robot_prefers_local_file_and_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("go2_description").write_text(BOX.format("mine"))
    assert load_robot("go2_description").name == "mine"
    Path("a1_description").mkdir()
    assert find_robot("a1_description").path == Path("a1_description")
    assert not is_description("a1_description")
    assert is_description("h1_description")
    assert not is_description("there/h1_description")

from pathlib import Path

import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.lint.changed import changed_robots
from terrainkit_robots.lint.settings import Settings

XACRO = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
FILES = {
    "arm/arm.urdf": '<robot name="arm"><link name="a"><visual><geometry>'
    '<mesh filename="hull.stl"/></geometry></visual></link></robot>',
    "dog/dog.urdf.xacro": f'<robot {XACRO} name="dog"><xacro:include filename="macros/leg.xacro"/>'
    '<xacro:leg side="left"/></robot>',
    "dog/macros/leg.xacro": f'<robot {XACRO}><xacro:macro name="leg" params="side">'
    '<link name="${side}"/></xacro:macro></robot>',
    "dog/macros/unused.xacro": f'<robot {XACRO}><xacro:macro name="m"/></robot>',
    "dog/package.xml": "<package><name>dog</name></package>",
    "mj/scene.xml": '<mujoco><include file="body.xml"/></mujoco>',
    "mj/body.xml": '<mujoco><include file="defaults.xml"/><worldbody><body name="b"><freejoint/>'
    "</body></worldbody></mujoco>",
    "mj/defaults.xml": "<mujoco><default/></mujoco>",
    "broken/half.urdf": '<robot name="half"><link',
    "broken/missing.xacro": f'<robot {XACRO} name="$(arg nothing)"/>',
    ".hidden/arm.urdf": '<robot name="arm"><link name="a"/></robot>',
}


@pytest.fixture(autouse=True)
def repository(tmp_path, monkeypatch):
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(
    ("changed", "robots"),
    [
        ("arm/arm.urdf", ["arm/arm.urdf"]),
        ("arm/hull.stl", ["arm/arm.urdf"]),  # a deleted mesh
        ("dog/dog.urdf.xacro", ["broken/missing.xacro", "dog/dog.urdf.xacro"]),
        ("dog/macros/leg.xacro", ["broken/missing.xacro", "dog/dog.urdf.xacro"]),
        ("dog/macros/unused.xacro", ["broken/missing.xacro"]),
        ("dog/package.xml", []),
        ("mj/scene.xml", []),
        ("mj/body.xml", ["mj/body.xml"]),
        ("mj/defaults.xml", ["mj/body.xml"]),
        ("broken/half.urdf", ["broken/half.urdf"]),
        ("broken/missing.xacro", ["broken/missing.xacro"]),
        (".hidden/arm.urdf", []),
        ("none.urdf", []),
    ],
)
def test_changed_robots_reads_changed_file(changed, robots):
    assert changed_robots([Path(changed)], Settings()) == tuple(map(Path, robots))


def test_changed_robots_include_deleted_files_once():
    for deleted in ("mj/defaults.xml", "dog/macros/leg.xacro", "broken/missing.xacro"):
        Path(deleted).unlink()
    assert changed_robots([Path("mj/defaults.xml")], Settings()) == (Path("mj/body.xml"),)
    changed = [Path("dog/macros/leg.xacro"), Path("arm/arm.urdf").absolute(), Path("arm/hull.stl")]
    assert changed_robots(changed, Settings()) == (Path("arm/arm.urdf"), Path("dog/dog.urdf.xacro"))


def test_changed_robots_use_settings_of_folder():
    Path("broken/missing.xacro").unlink()
    table = '[check-robot]\npackage = { legs = "macros" }\n'
    Path("dog/terrainkit.toml").write_text(table)
    text = FILES["dog/dog.urdf.xacro"].replace("macros/", "$(find legs)/")
    Path("dog/dog.urdf.xacro").write_text(text)
    changed = [Path("dog/macros/leg.xacro")]
    assert changed_robots(changed, Settings()) == (Path("dog/dog.urdf.xacro"),)
    Path("dog/terrainkit.toml").write_text("[check-robot]\nselekt = []\n")
    with pytest.raises(ConfigError, match="selekt"):
        changed_robots(changed, Settings())

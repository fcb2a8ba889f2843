from pathlib import Path

import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.lint.changed import changed_robots
from terrainkit_robots.lint.settings import Settings
from tests.tables import read_table

FILES = read_table(__file__, "files")


@pytest.fixture(autouse=True)
def repository(tmp_path, monkeypatch):
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(("changed", "robots"), read_table(__file__, "changed_robots_reads"))
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

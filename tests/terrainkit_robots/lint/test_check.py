import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.lint.check import check_robot
from terrainkit_robots.lint.settings import Settings
from tests.robots import QUADRUPED
from tests.small_robots import link

ROBOT = f'<robot name="box">{link("trunk", mass="{}")}</robot>'


def test_check_robot_reads_settings_above_file(tmp_path):
    (tmp_path / "box.urdf").write_text(ROBOT.format(-1))
    (tmp_path / "terrainkit.toml").write_text('[check-robot]\nselect = ["NAM"]\n')
    assert not check_robot(tmp_path / "box.urdf").findings
    codes = {finding.code for finding in check_robot(tmp_path / "box.urdf", Settings()).findings}
    assert "INR002" in codes


def test_check_robot_reads_contents_instead_of_file(tmp_path):
    file = tmp_path / "box.urdf"
    file.write_text(ROBOT.format(1))
    settings = Settings(select=("INR002",))
    assert not check_robot(file, settings).findings
    report = check_robot(file, settings, contents={file: ROBOT.format(-1).encode()})
    assert [finding.code for finding in report.findings] == ["INR002"]


def test_check_robot_compares_with_other_file_and_spec():
    settings = Settings(select=("XRF",), simulate=False)
    others = {"against": QUADRUPED.with_suffix(".xml"), "spec": QUADRUPED.parent / "robot.toml"}
    report = check_robot(QUADRUPED, settings, **others)
    assert report.facts.against.model.file == others["against"]
    assert (report.facts.spec.name, report.verdict) == ("quadruped", "pass")


def test_check_robot_rejects_other_file_without_robot(tmp_path):
    (tmp_path / "empty.urdf").write_text("")
    with pytest.raises(ConfigError, match=r"empty\.urdf does not describe a robot: "):
        check_robot(QUADRUPED, Settings(), against=tmp_path / "empty.urdf")

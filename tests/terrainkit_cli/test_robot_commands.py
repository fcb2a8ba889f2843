import json
import os
import re
import shlex
import subprocess
import sys

import pytest

from terrainkit_robots.description import bundled
from terrainkit_robots.lint.rule import rules
from tests.robots import BOX
from tests.tables import read_table

GOOD = f'<?xml version="1.0"?>\n{BOX.format(name="box", mass=1)}'
BAD = GOOD.replace('mass value="1"', 'mass value="-1"')
UNNAMED = GOOD.replace(' name="box"', "")


@pytest.fixture
def folder(tmp_path):
    for name, text in {"good": GOOD, "bad": BAD, "unnamed": UNNAMED}.items():
        (tmp_path / f"{name}.urdf").write_text(text)
    return tmp_path


@pytest.fixture
def check(terrainkit, folder):  # noqa: ARG001
    """Return a function that runs `terrainkit check-robot` with the words of a text."""
    return lambda words: terrainkit("check-robot", *shlex.split(words))


@pytest.mark.parametrize(("words", "code"), read_table(__file__, "check_robot_exit_code"))
def test_check_robot_exit_code(check, words, code):
    assert check(words).returncode == code


def test_check_robot_prints_file_and_line(check):
    run = check("bad.urdf --select negative-mass")
    assert "\nerror INR002 negative-mass\n  line 4: " in run.stdout
    assert run.stdout.endswith("\nbad.urdf: 1 error\n")
    assert run.stderr == ""


@pytest.mark.parametrize("name", bundled.robot_names())
def test_check_robot_finds_bundled_robot(check, name):
    run = check(f"{name} --strict --simulation")
    assert run.returncode == 0, run.stdout
    assert f"robot     {name} (URDF)\n" in run.stdout


def test_check_robot_prefers_file_to_bundled_robot(check, tmp_path):
    (tmp_path / "quadruped").mkdir()
    assert "robot     quadruped (URDF)" in check("quadruped").stdout
    (tmp_path / "biped").write_text(GOOD)
    assert "robot     box (URDF)" in check("biped").stdout


def test_check_robot_formats_several_files(check):
    words = "good.urdf bad.urdf --select INR002 --format"
    lines = check(f"{words} json").stdout.splitlines()
    assert [json.loads(line)["verdict"] for line in lines] == ["pass", "fail"]
    document = json.loads(check(f"{words} sarif").stdout)
    assert [result["ruleId"] for result in document["runs"][0]["results"]] == ["INR002"]


def test_check_robot_checks_folder(check):
    run = check(". --select INR002")
    assert run.returncode == 1
    assert run.stdout == (
        "bad.urdf: 1 error [INR002]\ngood.urdf: no problems found\n"
        "unnamed.urdf: no problems found\n\n3 files: 1 error\n"
    )
    assert "line 4: mass" in check(". --select INR002 --notes").stdout
    lines = check(". --select INR002 --format json").stdout.splitlines()
    assert [json.loads(line)["verdict"] for line in lines] == ["fail", "pass", "pass"]


@pytest.mark.parametrize(("words", "message"), read_table(__file__, "check_robot_rejects_input"))
def test_check_robot_rejects_input(rejected, folder, words, message):
    os.mkfifo(folder / "fifo")
    (folder / "empty").mkdir()
    (folder / "link").symlink_to("good.urdf")
    include = '<mujoco><worldbody><include file="part.xml"/></worldbody></mujoco>'
    (folder / "whole.xml").write_text(include)
    (folder / "part.xml").write_text("<mujocoinclude/>")
    before = sorted(folder.iterdir())
    assert message in rejected(f"check-robot {words}")
    assert sorted(folder.iterdir()) == before
    assert (folder / "good.urdf").read_text() == GOOD
    assert (folder / "part.xml").read_text() == "<mujocoinclude/>"


def test_check_robot_output_replaces_file(check, folder):
    (folder / "report.json").write_text("old")
    run = check("bad.urdf --format json -o report.json")
    assert run.returncode == 1
    assert run.stdout.startswith("wrote report.json: ")
    assert json.loads((folder / "report.json").read_text())["verdict"] == "fail"
    assert {path.suffix for path in folder.iterdir()} == {".urdf", ".json"}


def test_check_robot_picture_replaces_file(check, folder):
    (folder / "picture.png").write_text("before")
    assert check("good.urdf --picture picture.png").returncode == 0
    assert (folder / "picture.png").read_bytes().startswith(b"\x89PNG")
    assert check("good.urdf --picture good.urdf").returncode == 2


def test_check_robot_xacro_arguments_and_packages(check, folder):
    (folder / "parts").mkdir()
    (folder / "parts" / "trunk.urdf").write_text(GOOD)
    (folder / "robot.xacro").write_text(
        '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="$(arg called)">'
        '<xacro:include filename="$(find mine)/trunk.urdf"/></robot>'
    )
    words = "robot.xacro --select XML"
    assert check(words).returncode == 1
    run = check(f"{words} --package mine=parts --xacro-arg 'called:=one two'")
    assert run.returncode == 0, run.stdout
    assert "robot     one two (xacro)" in run.stdout
    table = '[check-robot]\npackage = { mine = "parts" }\nxacro-arg = { called = 3 }\n'
    (folder / "terrainkit.toml").write_text(table)
    assert "robot     3 (xacro)" in check(words).stdout
    assert "robot     4 (xacro)" in check(f"{words} --xacro-arg called:=4").stdout


def test_check_robot_options_override_settings_file(check, folder):
    (folder / "sub").mkdir()
    (folder / "sub" / "bad.urdf").write_text(BAD)
    (folder / "pyproject.toml").write_text(
        "[tool.terrainkit.check-robot]\nselect=['INR002', 'XML']\nignore={INR002='a balloon'}\n"
    )
    for option, reason in (
        ("", "a balloon"),
        ("--ignore 'INR002=a feather, or so'", "a feather, or so"),
    ):
        run = check(f"sub/bad.urdf {option}")
        assert run.returncode == 0
        assert f"skipped: INR002: ignored: {reason}\n" in run.stdout
    (folder / "terrainkit.toml").write_text("[check-robot]\nstrict = true\nsimulation = false\n")
    assert check("unnamed.urdf").returncode == 1
    assert check("unnamed.urdf --no-strict").returncode == 0
    static, simulated = (
        check(f"good.urdf {flag} --format json").stdout for flag in ("", "--simulation")
    )
    assert static != simulated
    (folder / "terrainkit.toml").unlink()
    (folder / "pyproject.toml").write_text("[tool.terrainkit.check-robot]\nselekt=[]\n")
    run = check("sub/bad.urdf")
    assert run.returncode == 2
    assert "pyproject.toml: config has no key 'selekt'; did you mean 'select'?" in run.stderr


def test_check_robot_escapes_unencodable_names(terrainkit_process, folder, monkeypatch):
    monkeypatch.setenv("PYTHONIOENCODING", "ascii")
    (folder / "good.urdf").write_text(GOOD.replace('name="box"', 'name="b\u00f6x"'))
    run = terrainkit_process("check-robot", "good.urdf")
    assert (run.returncode, run.stderr) == (0, "")
    assert "robot     b\\xf6x (URDF)" in run.stdout


def test_check_robot_fix_writes_file(check, folder):
    run = check("unnamed.urdf --fix")
    assert run.returncode == 0
    assert "\nfixed\n  line 2: XML003, " in run.stdout
    assert run.stdout.endswith("\nunnamed.urdf: no problems found\n")
    text = (folder / "unnamed.urdf").read_text()
    assert re.sub(r"<robot [^>]*>", "<robot>", text) == UNNAMED
    again = check("unnamed.urdf --fix")
    assert "fixed" not in again.stdout
    assert (folder / "unnamed.urdf").read_text() == text


def test_check_robot_diff_writes_nothing(check, folder):
    run = check("unnamed.urdf --diff --strict")
    assert run.returncode == 1  # of the unfixed file
    assert run.stdout.startswith("--- unnamed.urdf\n+++ unnamed.urdf\n")
    assert "\n-<robot>\n+<robot name=" in run.stdout
    assert (folder / "unnamed.urdf").read_text() == UNNAMED


@pytest.mark.parametrize("option", ["--fix", "--unsafe-fixes"])
@pytest.mark.parametrize("is_path", [False, True])
def test_check_robot_fix_rejects_bundled_robot(rejected, option, is_path):
    file = bundled.urdf_path("quadruped")
    name, text = str(file) if is_path else "quadruped", file.read_bytes()
    told = f"{name} is not your file and cannot be changed; copy {file} first\n"
    assert rejected("check-robot", name, option) == told
    assert file.read_bytes() == text


@pytest.mark.parametrize("name", ["quadruped", "good.urdf"])
def test_check_robot_diff_without_changes(check, name):
    run = check(f"{name} --diff")
    assert (run.returncode, run.stdout) == (0, "")
    assert run.stderr == "terrainkit: there is nothing to fix\n"


def test_check_robot_baseline_accepts_recorded_findings(check, folder):
    words = "bad.urdf unnamed.urdf --strict --baseline robots.json"
    run = check(f"{words} --write-baseline --format json")
    assert (run.returncode, run.stderr) == (0, "terrainkit: wrote robots.json\n")
    assert [json.loads(line)["verdict"] for line in run.stdout.splitlines()] == ["pass", "pass"]
    assert check(words).returncode == 0
    (folder / "bad.urdf").write_text(BAD.replace("trunk", "hull"))
    run = check(words)
    assert run.returncode == 1
    assert "\nwarning: INR002: no longer needed in robots.json: trunk\n" in run.stdout


def test_check_robot_baseline_is_written_without_unreadable_robots(check, folder):
    run = check("none.urdf bad.urdf --baseline a.json --write-baseline")
    assert run.returncode == 2
    assert list(json.loads((folder / "a.json").read_text())["robots"]) == ["bad.urdf"]


def test_check_robot_changed_checks_robots_of_the_files(check, folder):
    (folder / "notes.txt").touch()
    (folder / "submodule").mkdir()  # git lists it as a changed file
    run = check("--changed notes.txt bad.urdf submodule")
    assert run.returncode == 1
    assert run.stdout.startswith("bad.urdf\n")
    run = check("--changed notes.txt")
    assert (run.returncode, run.stdout) == (0, "")
    assert run.stderr == "terrainkit: no robot in this folder reads a changed file\n"


def test_check_robot_colors_exclude_escapes_of_file(folder):
    (folder / "bad.urdf").write_text(BAD.replace("trunk", "tr\u009b31munk"))
    script = "import pty, sys; sys.exit(pty.spawn(sys.argv[1:]) >> 8)"
    command = [sys.executable, "-c", script, sys.executable, "-m", "terrainkit_cli.main"]
    run = subprocess.run(
        [*command, "check-robot", "bad.urdf", "--select", "INR002"],
        cwd=folder,
        env=os.environ | {"TERM": "xterm-256color"},
        capture_output=True,
        timeout=60,
        check=False,
    )
    assert run.returncode == 1
    assert b"\x1b[1;31merror\x1b[0m INR002 negative-mass" in run.stdout
    assert "\u009b".encode() not in run.stdout
    assert b"tr\\x9b31munk" in run.stdout


def test_rule_prints_page(terrainkit):
    run = terrainkit("rule", "inr002")
    assert run.returncode == 0
    assert run.stdout.startswith("INR002 negative-mass (error), mass and inertia\n\n")
    for part in ("\n\nFix: ", "\n\nSource: "):
        assert part in run.stdout
    assert terrainkit("rule", "negative-mass").stdout == run.stdout


def test_rule_all_lists_rules(terrainkit):
    listed = terrainkit("rule", "--all").stdout
    for rule in rules():
        assert re.search(rf"^  {rule.code} +{rule.name} +{rule.severity}\b", listed, re.MULTILINE)


def test_rule_rejects_unknown_code(rejected):
    assert "got CODE and --all; expected one of them" in rejected("rule INR002 --all")
    assert "no rule 'INR999'; there are: INR001" in rejected("rule INR999")

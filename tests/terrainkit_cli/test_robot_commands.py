import json
import os
import re
import subprocess
import sys

import pytest

from terrainkit_cli.main import main
from terrainkit_robots.description import bundled
from terrainkit_robots.lint.rule import rules
from tests.robots import BOX

GOOD = f'<?xml version="1.0"?>\n{BOX.format(name="box", mass=1)}'
BAD = GOOD.replace('mass value="1"', 'mass value="-1"')
UNNAMED = GOOD.replace(' name="box"', "")


@pytest.fixture
def folder(tmp_path):
    for name, text in {"good": GOOD, "bad": BAD, "unnamed": UNNAMED}.items():
        (tmp_path / f"{name}.urdf").write_text(text)
    return tmp_path


@pytest.fixture
def here(tmp_path, monkeypatch, capsys):
    """Run `terrainkit` in this process, since a new process takes half a second."""

    def run(*words):
        capsys.readouterr()
        code = main([str(word) for word in words])
        captured = capsys.readouterr()
        return subprocess.CompletedProcess(words, code, captured.out, captured.err)

    monkeypatch.chdir(tmp_path)
    return run


# Findings and exit codes.


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (("good.urdf",), 0),
        (("bad.urdf",), 1),
        (("unnamed.urdf",), 0),
        (("unnamed.urdf", "--strict"), 1),
        (("good.urdf", "bad.urdf"), 1),
        (("bad.urdf", "--ignore", "INR002=a balloon", "--select", "INR002,XML"), 0),
        (("none.urdf",), 2),
        (("good.urdf", "none.urdf"), 2),
        (("bad.urdf", "none.urdf"), 2),
    ],
)
@pytest.mark.usefixtures("folder")
def test_check_robot_exit_code(here, words, code):
    assert here("check-robot", *words).returncode == code


@pytest.mark.usefixtures("folder")
def test_check_robot_prints_file_and_line(here):
    run = here("check-robot", "bad.urdf", "--select", "negative-mass")
    assert "\nerror INR002 negative-mass\n  line 4: " in run.stdout
    assert run.stdout.endswith("\nbad.urdf: 1 error\n")
    assert run.stderr == ""


@pytest.mark.usefixtures("folder")
def test_check_robot_continues_after_missing_file(here):
    run = here("check-robot", "none.urdf", "bad.urdf", "--format", "json")
    assert json.loads(run.stdout)["file"] == "bad.urdf"
    assert run.stderr.count("\n") == 1
    assert run.stderr.startswith("terrainkit: error: robot file: got none.urdf")


@pytest.mark.parametrize("name", bundled.robot_names())
def test_check_robot_finds_bundled_robot(here, name):
    run = here("check-robot", name, "--strict")
    assert run.returncode == 0, run.stdout
    assert f"robot     {name} (URDF)\n" in run.stdout


def test_check_robot_prefers_file_to_bundled_robot(here, tmp_path):
    (tmp_path / "quadruped").mkdir()
    assert "robot     quadruped (URDF)" in here("check-robot", "quadruped").stdout
    (tmp_path / "biped").write_text(GOOD)
    assert "robot     box (URDF)" in here("check-robot", "biped").stdout


def test_check_robot_download_fails(here, tmp_path, monkeypatch):
    pytest.importorskip("robot_descriptions")
    monkeypatch.setenv("ROBOT_DESCRIPTIONS_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("GIT_CONFIG_COUNT", "1")
    monkeypatch.setenv("GIT_CONFIG_KEY_0", f"url.{tmp_path}/none/.insteadOf")
    monkeypatch.setenv("GIT_CONFIG_VALUE_0", "https://github.com/")
    run = here("check-robot", "cassie_description")
    assert (run.returncode, run.stdout, run.stderr.count("\n")) == (2, "", 1)
    error = "terrainkit: error: cassie_description: robot_descriptions cannot download it: "
    assert run.stderr.startswith(error)


@pytest.mark.usefixtures("folder")
def test_check_robot_formats_several_files(here):
    words = ("good.urdf", "bad.urdf", "--select", "INR002")
    lines = here("check-robot", *words, "--format", "json").stdout.splitlines()
    assert [json.loads(line)["verdict"] for line in lines] == ["pass", "fail"]
    document = json.loads(here("check-robot", *words, "--format", "sarif").stdout)
    assert [result["ruleId"] for result in document["runs"][0]["results"]] == ["INR002"]


@pytest.mark.usefixtures("folder")
def test_check_robot_checks_folder(here):
    run = here("check-robot", ".", "--select", "INR002")
    assert run.returncode == 1
    assert run.stdout == (
        "bad.urdf: 1 error [INR002]\ngood.urdf: no problems found\n"
        "unnamed.urdf: no problems found\n\n3 files: 1 error\n"
    )
    assert "line 4: mass" in here("check-robot", ".", "--select", "INR002", "--notes").stdout
    lines = here("check-robot", ".", "--select", "INR002", "--format", "json").stdout.splitlines()
    assert [json.loads(line)["verdict"] for line in lines] == ["fail", "pass", "pass"]


# Options.


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "FILE: missing"),
        (
            ("none.urdf",),
            "robot file: got none.urdf, which does not exist; bundled robots are: ",
        ),
        (("empty",), "empty: got no robot file in it; expected URDF, xacro or MJCF"),
        ((".", "--spec", "robot.toml"), "--against and --spec: got 3 files; expected one"),
        (("fifo",), "cannot read fifo: it is a pipe"),
        (("good.urdf", "--select", "XYZ1"), "no rule 'XYZ1'; expected a code"),
        (("good.urdf", "--ignore", "INR002"), "--ignore: got 'INR002'; expected CODES=REASON"),
        (("good.urdf", "--ignore", "INR002="), "--ignore: got 'INR002='; expected CODES=REASON"),
        (("good.urdf", "--ignore", "XYZ1=why"), "no rule 'XYZ1'"),
        (("good.urdf", "--ignore", "INR=a", "--ignore", "INR=b"), "--ignore: got INR twice"),
        (("good.urdf", "--package", "mine"), "--package: got 'mine'; expected NAME=DIR"),
        (
            ("good.urdf", "--package", "mine=none"),
            "package mine: got none; expected an existing folder",
        ),
        (("good.urdf", "--xacro-arg", "a=1"), "--xacro-arg: got 'a=1'; expected NAME:=VALUE"),
        (("good.urdf", "--diff", "--format", "json"), "--diff prints a diff"),
        (("",), "it is a folder"),  # not all robots of the working directory
        (("good.urdf", "--baseline", "none.json"), "no file none.json; --write-baseline"),
        (("good.urdf", "--baseline", "bad.urdf"), "baseline bad.urdf: Expecting value"),
        (
            ("bad.urdf", "--baseline", "bad.urdf", "--write-baseline"),
            "baseline bad.urdf: Expecting value",
        ),
        (
            ("bad.urdf", "--baseline", "good.urdf/a.json", "--write-baseline"),
            "good.urdf is not a folder",
        ),
        (("good.urdf", "--write-baseline"), "--write-baseline: got no file"),
        (("good.urdf", "-o", "good.urdf/a.txt"), "good.urdf is not a folder"),
        (("good.urdf", "-o", "."), "it is a folder"),
        (("good.urdf", "-o", "/proc/report.txt"), "cannot write /proc/report.txt"),
        (("good.urdf", "-o", "good.urdf"), "would replace the checked file good.urdf"),
    ],
    ids=lambda value: " ".join(map(str, value))[:60] if isinstance(value, tuple) else "",
)
def test_check_robot_rejects_input(here, folder, words, message):
    os.mkfifo(folder / "fifo")
    (folder / "empty").mkdir()
    before = sorted(folder.iterdir())
    run = here("check-robot", *words)
    assert run.returncode == 2
    assert run.stdout == ""
    assert run.stderr.count("\n") == 1
    assert run.stderr.startswith("terrainkit: error: ")
    assert message in run.stderr
    assert sorted(folder.iterdir()) == before


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read every file")
def test_check_robot_without_read_permission(here, folder):
    (folder / "good.urdf").chmod(0)
    run = here("check-robot", "good.urdf")
    assert (run.returncode, run.stderr) == (
        2,
        "terrainkit: error: cannot read good.urdf: Permission denied\n",
    )


@pytest.mark.usefixtures("folder")
def test_check_robot_rejects_unknown_format(terrainkit):
    run = terrainkit("check-robot", "good.urdf", "--format", "xml")
    assert (run.returncode, run.stdout, run.stderr.count("\n")) == (2, "", 1)
    assert "--format: got 'xml'; expected one of: text, json" in run.stderr


def test_check_robot_output_replaces_file(here, folder):
    (folder / "report.json").write_text("old")
    run = here("check-robot", "bad.urdf", "--format", "json", "-o", "report.json")
    assert run.returncode == 1
    assert run.stdout.startswith("wrote report.json: ")
    assert json.loads((folder / "report.json").read_text())["verdict"] == "fail"
    assert sorted(path.name for path in folder.iterdir() if path.suffix != ".urdf") == [
        "report.json"
    ]


def test_check_robot_output_rejects_link_to_input(here, folder):
    (folder / "link.txt").symlink_to("good.urdf")
    run = here("check-robot", "good.urdf", "-o", "link.txt")
    assert run.returncode == 2
    assert (folder / "good.urdf").read_text() == GOOD


def test_check_robot_output_rejects_other_inputs(here, folder):
    run = here("check-robot", "none.urdf", "good.urdf", "bad.urdf", "-o", "bad.urdf")
    assert run.returncode == 2
    include = '<mujoco><worldbody><include file="part.xml"/></worldbody></mujoco>'
    (folder / "whole.xml").write_text(include)
    (folder / "part.xml").write_text("<mujocoinclude/>")
    run = here("check-robot", "whole.xml", "good.urdf", "-o", "part.xml")
    assert run.returncode == 2
    assert (
        run.stderr
        == "terrainkit: error: --output part.xml would replace the checked file part.xml\n"
    )
    assert (folder / "bad.urdf").read_text() == BAD
    assert (folder / "part.xml").read_text() == "<mujocoinclude/>"


def test_check_robot_xacro_arguments_and_packages(here, folder):
    (folder / "parts").mkdir()
    (folder / "parts" / "trunk.urdf").write_text(GOOD)
    (folder / "robot.xacro").write_text(
        '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="$(arg called)">'
        '<xacro:include filename="$(find mine)/trunk.urdf"/></robot>'
    )
    words = ("check-robot", "robot.xacro", "--select", "XML")
    assert here(*words).returncode == 1
    options = ("--package", "mine=parts", "--xacro-arg", "called:=one two")
    run = here(*words, *options)
    assert run.returncode == 0, run.stdout
    assert "robot     one two (xacro)" in run.stdout
    table = '[check-robot]\npackage = { mine = "parts" }\nxacro-arg = { called = 3 }\n'
    (folder / "terrainkit.toml").write_text(table)
    assert "robot     3 (xacro)" in here(*words).stdout
    assert "robot     4 (xacro)" in here(*words, "--xacro-arg", "called:=4").stdout


def test_check_robot_options_override_settings_file(here, folder):
    (folder / "sub").mkdir()
    (folder / "sub" / "bad.urdf").write_text(BAD)
    (folder / "pyproject.toml").write_text(
        "[tool.terrainkit.check-robot]\nselect=['INR002', 'XML']\nignore={INR002='a balloon'}\n"
    )
    run = here("check-robot", "sub/bad.urdf")
    assert run.returncode == 0
    assert "skipped: INR002: ignored: a balloon\n" in run.stdout
    run = here("check-robot", "sub/bad.urdf", "--ignore", "INR002=a feather, perhaps")
    assert "skipped: INR002: ignored: a feather, perhaps\n" in run.stdout
    (folder / "pyproject.toml").write_text("[tool.terrainkit.check-robot]\nselekt=[]\n")
    run = here("check-robot", "sub/bad.urdf")
    assert run.returncode == 2
    assert "pyproject.toml: config has no key 'selekt'; did you mean 'select'?" in run.stderr


def test_check_robot_escapes_unencodable_names(terrainkit_process, folder, monkeypatch):
    monkeypatch.setenv("PYTHONIOENCODING", "ascii")
    (folder / "good.urdf").write_text(GOOD.replace('name="box"', 'name="b\u00f6x"'))
    run = terrainkit_process("check-robot", "good.urdf")
    assert (run.returncode, run.stderr) == (0, "")
    assert "robot     b\\xf6x (URDF)" in run.stdout


@pytest.mark.usefixtures("folder")
def test_check_robot_avoids_slow_imports():
    # Each import takes more than 10 % of the time of the whole command.
    heavy = ("rich", "jsonschema", "scipy", "unittest.mock", "asyncio", "glfw")
    script = (
        "import sys; from terrainkit_cli.main import main; main(sys.argv[1:]);"
        f"print([name for name in {heavy} if name in sys.modules], file=sys.stderr)"
    )
    command = [sys.executable, "-c", script, "check-robot", "quadruped", "--select", "XML,COL"]
    run = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    assert run.stderr == "[]\n"


# Fixes.


def test_check_robot_fix_writes_file(here, folder):
    run = here("check-robot", "unnamed.urdf", "--fix")
    assert run.returncode == 0
    assert "\nfixed\n  line 2: XML003, " in run.stdout
    assert run.stdout.endswith("\nunnamed.urdf: no problems found\n")
    text = (folder / "unnamed.urdf").read_text()
    assert re.sub(r"<robot [^>]*>", "<robot>", text) == UNNAMED
    again = here("check-robot", "unnamed.urdf", "--fix")
    assert "fixed" not in again.stdout
    assert (folder / "unnamed.urdf").read_text() == text


def test_check_robot_diff_writes_nothing(here, folder):
    run = here("check-robot", "unnamed.urdf", "--diff", "--strict")
    assert run.returncode == 1  # of the unfixed file
    assert run.stdout.startswith("--- unnamed.urdf\n+++ unnamed.urdf\n")
    assert "\n-<robot>\n+<robot name=" in run.stdout
    assert (folder / "unnamed.urdf").read_text() == UNNAMED


@pytest.mark.parametrize("option", ["--fix", "--unsafe-fixes"])
@pytest.mark.parametrize("is_path", [False, True])
def test_check_robot_fix_rejects_bundled_robot(here, option, is_path):
    file = bundled.urdf_path("quadruped")
    name, text = str(file) if is_path else "quadruped", file.read_bytes()
    run = here("check-robot", name, option)
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr == (
        f"terrainkit: error: {name} is not your file and cannot be changed; copy {file} first\n"
    )
    assert file.read_bytes() == text


def test_check_robot_diff_reads_bundled_robot(here):
    run = here("check-robot", "quadruped", "--diff")
    assert (run.returncode, run.stdout) == (0, "")
    assert run.stderr == "terrainkit: there is nothing to fix\n"


@pytest.mark.usefixtures("folder")
def test_check_robot_diff_without_changes(here):
    run = here("check-robot", "good.urdf", "--diff")
    assert (run.returncode, run.stdout) == (0, "")
    assert run.stderr == "terrainkit: there is nothing to fix\n"


@pytest.mark.usefixtures("folder")
def test_check_robot_json_lists_fixed_findings(here):
    run = here("check-robot", "unnamed.urdf", "--fix", "--format", "json")
    document = json.loads(run.stdout)
    assert [finding["code"] for finding in document["fixed"]] == ["XML003"]
    assert document["verdict"] == "pass"


# Baselines.


@pytest.mark.usefixtures("folder")
def test_check_robot_baseline_accepts_recorded_findings(here, folder):
    words = ("check-robot", "bad.urdf", "unnamed.urdf", "--strict", "--baseline", "robots.json")
    run = here(*words, "--write-baseline", "--format", "json")
    assert (run.returncode, run.stderr) == (0, "terrainkit: wrote robots.json\n")
    assert [json.loads(line)["verdict"] for line in run.stdout.splitlines()] == ["pass", "pass"]
    assert here(*words).returncode == 0
    (folder / "bad.urdf").write_text(BAD.replace("trunk", "hull"))
    run = here(*words)
    assert run.returncode == 1
    assert "\nwarning: INR002: no longer needed in robots.json: trunk\n" in run.stdout


@pytest.mark.usefixtures("folder")
def test_check_robot_baseline_is_written_without_unreadable_robots(here, folder):
    run = here("check-robot", "none.urdf", "bad.urdf", "--baseline", "a.json", "--write-baseline")
    assert run.returncode == 2
    assert list(json.loads((folder / "a.json").read_text())["robots"]) == ["bad.urdf"]


# Changed files.


@pytest.mark.usefixtures("folder")
def test_check_robot_changed_checks_robots_of_the_files(here, folder):
    (folder / "notes.txt").touch()
    (folder / "submodule").mkdir()  # git lists it as a changed file
    run = here("check-robot", "--changed", "notes.txt", "bad.urdf", "submodule")
    assert run.returncode == 1
    assert run.stdout.startswith("bad.urdf\n")
    run = here("check-robot", "--changed", "notes.txt")
    assert (run.returncode, run.stdout) == (0, "")
    assert run.stderr == "terrainkit: no robot in this folder reads a changed file\n"


# Colors.


@pytest.mark.usefixtures("folder")
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


# Rules.


def test_rule_prints_page(here):
    run = here("rule", "inr002")
    assert run.returncode == 0
    assert run.stdout.startswith("INR002 negative-mass (error), mass and inertia\n\n")
    for part in ("\n\nFix: ", "\n\nSource: "):
        assert part in run.stdout
    assert here("rule", "negative-mass").stdout == run.stdout


def test_rule_all_lists_rules(here):
    listed = here("rule", "--all").stdout
    for rule in rules():
        assert re.search(rf"^  {rule.code} +{rule.name} +{rule.severity}\b", listed, re.MULTILINE)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("INR002", "--all"), "got CODE and --all; expected one of them"),
        (("INR999",), "no rule 'INR999'; there are: INR001"),
    ],
)
def test_rule_rejects_unknown_code(here, words, message):
    run = here("rule", *words)
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr.count("\n") == 1
    assert message in run.stderr


def test_check_robot_offers_every_format():
    import typing

    from terrainkit_cli.robot_commands import CheckRobot
    from terrainkit_robots.lint.report import FORMATS

    assert typing.get_args(typing.get_type_hints(CheckRobot)["format"]) == FORMATS


def test_check_robot_flags_override_settings(here, folder):
    (folder / "terrainkit.toml").write_text("[check-robot]\nstrict = true\nsimulation = false\n")
    assert here("check-robot", "unnamed.urdf").returncode == 1
    assert here("check-robot", "unnamed.urdf", "--no-strict").returncode == 0
    static, simulated = (
        here("check-robot", "good.urdf", "--format", "json", *words).stdout
        for words in ((), ("--simulation",))
    )
    assert static != simulated


def test_check_robot_names_why_a_file_cannot_be_read(terrainkit):
    run = terrainkit("check-robot", "a" * 300)
    assert run.returncode == 2
    assert run.stderr.startswith("terrainkit: ")
    assert "File name too long" in run.stderr

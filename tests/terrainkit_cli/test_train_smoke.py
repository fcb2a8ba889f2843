import json
import shutil

import pytest

pytest.importorskip("torch", reason="the extra `train` is not installed")

from terrainkit.errors import ConfigError
from terrainkit_cli import training_extra
from terrainkit_robots.policy import smoke_test as smoke_test
from terrainkit_robots.policy.smoke_test import Check, Smoke
from terrainkit_robots.rl.registry import find

GOOD = Check(name="spawn height", passed=True, measured="1.0 cm", wanted="within 2.0 cm")
BAD = Check(name="observation policy", passed=False, measured="44 numbers", wanted="45 numbers")


@pytest.fixture
def here(tmp_path, monkeypatch, called):
    """Run `terrainkit` in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return called


@pytest.fixture
def told(monkeypatch):
    """Find in robots what their names say, and return what was asked."""
    asked = []

    def look(name, **options):
        asked.append((name, options))
        if name.startswith("none"):
            raise ConfigError(f"there is no {name}")
        checks = (GOOD, BAD) if name.startswith("bad") else (GOOD,)
        return Smoke(robot=name.upper(), checks=checks)

    monkeypatch.setattr(smoke_test, "smoke_of", look)
    return asked


def test_a_folder_that_was_edited_badly_fails_with_a_table(here, tmp_path):
    shutil.copytree(find("quadruped").folder, tmp_path / "mine")
    spec = tmp_path / "mine" / "robot.toml"
    text = spec.read_text()
    spec.write_text(text.replace("spawn_height = 0.34626", "spawn_height = 0.64626"))
    run = here("check-robot", "mine", "--train-smoke")
    assert run.returncode == 1, run.stderr
    assert run.stderr == ""
    lines = run.stdout.splitlines()
    assert lines[0] == "robot     quadruped (mine)"
    (wrong,) = (k for k, line in enumerate(lines) if line.startswith("FAIL"))
    assert lines[wrong].split()[1:4] == ["spawn", "height", "31.0"]
    assert lines[wrong + 1].strip() == (
        "wanted: every foot within 2.0 cm of the ground, none below"
    )
    assert sum(line.startswith("ok  ") for line in lines) >= 15
    assert lines[-1].startswith("quadruped: 1 of ")


def test_a_robot_that_fails_is_exit_1_and_one_that_cannot_be_read_is_2(here, told):
    for words, code in (
        (("good",), 0),
        (("bad",), 1),
        (("good", "bad"), 1),
        (("none", "good"), 2),
        (("bad", "none"), 2),
        (("good", "good"), 0),
    ):
        run = here("check-robot", *words, "--train-smoke")
        assert run.returncode == code, words
        assert run.stderr.count("\n") == sum(word == "none" for word in words)
    assert [name for name, _ in told[:2]] == ["good", "bad"]


@pytest.mark.usefixtures("told")
def test_the_table_says_what_was_wanted_where_it_is_not_so(here):
    assert here("check-robot", "good", "bad", "--train-smoke").stdout == (
        "robot     GOOD (good)\n"
        "\n"
        "ok    spawn height  1.0 cm\n"
        "\n"
        "GOOD can be trained\n"
        "\n"
        "robot     BAD (bad)\n"
        "\n"
        "ok    spawn height        1.0 cm\n"
        "FAIL  observation policy  44 numbers\n"
        "                          wanted: 45 numbers\n"
        "\n"
        "BAD: 1 of 2 checks failed\n"
    )


@pytest.mark.usefixtures("told")
def test_json_is_a_document_and_of_several_robots_one_on_a_line_each(here):
    run = here("check-robot", "bad", "--train-smoke", "--format", "json")
    assert run.returncode == 1
    document = json.loads(run.stdout)
    assert document["schema_version"] == 1
    assert document["tool"]["name"] == "terrainkit"
    assert (document["file"], document["robot"], document["verdict"]) == ("bad", "BAD", "fail")
    assert document["checks"][1] == {
        "name": "observation policy",
        "passed": False,
        "measured": "44 numbers",
        "wanted": "45 numbers",
    }
    lines = here("check-robot", "good", "bad", "--train-smoke", "--format", "json").stdout
    assert [json.loads(line)["verdict"] for line in lines.splitlines()] == ["pass", "fail"]


@pytest.mark.usefixtures("told")
def test_the_report_goes_to_a_file(here, tmp_path):
    words = ("good", "bad", "--train-smoke", "--format", "json", "-o", "report.json")
    run = here("check-robot", *words)
    assert run.returncode == 1
    assert run.stdout == ("wrote report.json: GOOD can be trained, BAD: 1 of 2 checks failed\n")
    lines = (tmp_path / "report.json").read_text().splitlines()
    assert [json.loads(line)["file"] for line in lines] == ["good", "bad"]


def test_packages_arguments_and_a_spec_are_handed_on(here, told, tmp_path):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "a").touch()
    words = ("--package", "my=meshes", "--xacro-arg", "arm:=false", "--ignore", "MSH=no meshes")
    assert here("check-robot", "a", "--train-smoke", *words, "--spec", "a.toml").returncode == 0
    (_, options) = told[0]
    assert str(options["spec"]) == "a.toml"
    assert options["settings"].packages["my"].name == "meshes"
    assert options["settings"].xacro_arguments == {"arm": "false"}
    assert options["settings"].ignore == {"MSH": "no meshes"}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("a", "--format", "sarif"), "--train-smoke reports as text or json; not as sarif"),
        (("a", "--select", "INR"), "asks no rules, so --select makes no sense with it"),
        (("a", "--against", "b"), "--against makes no sense"),
        (("a", "--strict"), "--strict makes no sense"),
        (("a", "--fix"), "--fix makes no sense"),
        (("a", "--no-simulation"), "--no-simulation makes no sense"),
        (("a", "b", "--spec", "c.toml"), "--spec is of one robot, and there are 2"),
        ((), "no FILE to check"),
        (("a", "--package", "my=."), "--package is for a robot's file"),
        (("a", "b", "--xacro-arg", "arm:=false"), "no file is called: a, b"),
        (("a" * 300, "--ignore", "MSH=no meshes"), "--ignore is for a robot's file"),
        (("a", "--spec", "a.toml"), "--spec is for a robot's file"),
        (("a", "-o", "nowhere/a.txt"), "there is no folder nowhere"),
        (("a", "-o", "."), "it is a folder"),
    ],
)
def test_options_that_make_no_sense_are_one_line_before_the_work(here, told, words, said):
    run = here("check-robot", *words, "--train-smoke")
    assert run.returncode == 2
    assert run.stdout == ""
    assert run.stderr.count("\n") == 1
    assert said in run.stderr
    assert told == []


def test_a_robot_that_is_not_there_is_one_line(here):
    run = here("check-robot", "unicorn", "--train-smoke")
    assert run.returncode == 2
    assert run.stdout == ""
    assert run.stderr.count("\n") == 1
    assert "there are: biped, quadruped" in run.stderr


def test_without_the_extra_it_is_said_what_to_install(here, monkeypatch):
    monkeypatch.setattr(training_extra, "_PACKAGES", ("no_such_package",))
    run = here("check-robot", "quadruped", "--train-smoke")
    assert run.returncode == 2
    assert "no_such_package, which is not installed: pip install 'terrainkit[train]'" in run.stderr

import json
import shutil
from dataclasses import asdict
from functools import partial

import pytest

from tests.tables import read_table

pytest.importorskip("torch", reason="the extra `train` is not installed")

from terrainkit.errors import ConfigError
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.smoke_test import checks as module
from terrainkit_robots.smoke_test.checks import Check, make_result

GOOD = Check("spawn height", True, "1.0 cm", "within 2.0 cm")
BAD = Check("observation policy", False, "44 numbers", "45 numbers")


@pytest.fixture
def here(terrainkit):
    """Run `terrainkit smoke-test` in an empty folder."""
    return partial(terrainkit, "smoke-test")


@pytest.fixture
def calls(monkeypatch):
    """Derive the result of a robot from its name, and return the calls."""
    calls = []

    def smoke_test(name, options, *, samples, seed, progress):
        calls.append((name, options, samples, seed))
        progress(0.5)
        if name.startswith("none"):
            raise ConfigError(f"there is no {name}")
        checks = (GOOD, BAD) if name.startswith("bad") else (GOOD,)
        return make_result(name.upper(), *checks)

    monkeypatch.setattr(module, "smoke_test", smoke_test)
    return calls


def test_smoke_test_shows_expectation_of_failed_check(here, tmp_path):
    shutil.copytree(get_task("quadruped").folder, tmp_path / "mine")
    spec = tmp_path / "mine" / "robot.toml"
    text = spec.read_text()
    spec.write_text(text.replace("spawn_height = 0.344", "spawn_height = 0.644"))
    run = here("mine", "--samples", 1)
    assert run.returncode == 1, run.stderr
    assert run.stderr == ""
    lines = run.stdout.splitlines()
    assert lines[0] == "robot     quadruped (mine)"
    # The drop also costs a statue more than it earns.
    failed, *_ = (k for k, line in enumerate(lines) if line.startswith("FAIL"))
    assert lines[failed].split()[1:4] == ["spawn", "height", "FL_foot"]
    expected = "expected: the lowest foot within 2.0 cm of the ground, none below"
    assert lines[failed + 1].strip().startswith(expected)
    assert sum(line.startswith("ok  ") for line in lines) >= 15
    assert lines[-1].startswith("quadruped: ")
    assert lines[-1].endswith(" checks failed")


def test_smoke_test_exit_code_is_worst_result(here, calls):
    for words, code in (
        (("good",), 0),
        (("bad",), 1),
        (("good", "bad"), 1),
        (("none", "good"), 2),
        (("bad", "none"), 2),
        (("good", "good"), 0),
    ):
        run = here(*words)
        assert run.returncode == code, words
        assert run.stderr.count("\n") == sum(word == "none" for word in words)
    assert [name for name, *_ in calls[:2]] == ["good", "bad"]


@pytest.mark.usefixtures("calls")
def test_smoke_test_text_lists_checks(here):
    assert here("good", "bad").stdout == (
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
        "                          expected: 45 numbers\n"
        "\n"
        "BAD: 1 of 2 checks failed\n"
    )


@pytest.mark.usefixtures("calls")
def test_smoke_test_json_has_document_per_robot(here, tmp_path):
    run = here("good", "bad", "--format", "json", "-o", "report.json")
    assert run.returncode == 1
    assert run.stdout == "wrote report.json: GOOD can be trained, BAD: 1 of 2 checks failed\n"
    text = (tmp_path / "report.json").read_text()
    assert here("good", "bad", "--format", "json").stdout == text
    good, bad = map(json.loads, text.splitlines())
    assert (good["file"], good["robot"], good["verdict"]) == ("good", "GOOD", "pass")
    assert (bad["file"], bad["robot"], bad["verdict"]) == ("bad", "BAD", "fail")
    assert (bad["schema_version"], bad["tool"]["name"]) == (2, "terrainkit")
    assert bad["checks"] == [asdict(GOOD), asdict(BAD)]


def test_smoke_test_passes_file_options(here, calls, tmp_path):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "a").touch()
    words = ("--package", "my=meshes", "--xacro-arg", "arm:=false", "--ignore", "MSH=no meshes")
    assert here("a", *words, "--spec", "a.toml").returncode == 0
    (_, options, samples, seed) = calls[0]
    assert (samples, seed) == (100_000, 1)
    assert str(options.spec) == "a.toml"
    assert options.settings.packages["my"].name == "meshes"
    assert options.settings.xacro_arguments == {"arm": "false"}
    assert options.settings.ignore == {"MSH": "no meshes"}
    assert here("a", "--samples", 0).returncode == 0
    assert calls[1][2] == 0


@pytest.mark.parametrize(("words", "message"), read_table(__file__, "smoke_test_rejects_options"))
def test_smoke_test_rejects_options_first(rejected, calls, words, message):
    assert message in rejected(f"smoke-test {words}")
    assert calls == []

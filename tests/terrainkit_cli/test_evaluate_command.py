import json
import sys
from dataclasses import replace

import pytest

pytest.importorskip("torch", reason="the extra `train` is not installed")

from terrainkit_cli import evaluate_command, training_extra
from terrainkit_robots.rl import run as run_module


@pytest.fixture
def here(walking, monkeypatch, called):
    """Run `terrainkit evaluate` in a folder with a run `walk`."""
    monkeypatch.chdir(walking.parent)

    def run(*words):
        done = called("evaluate", *words)
        return done.returncode, done.stdout, done.stderr

    return run


def one_line(err):
    assert err.startswith("terrainkit: error: ")
    assert err.count("\n") == 1
    return err


def test_it_prints_json_and_nothing_else(here):
    code, out, err = here("walk", "--seconds", "0.1", "--num-envs", "2")
    assert (code, err) == (0, "")
    told = json.loads(out)
    assert (told["robot"], told["checkpoint"], told["terrain"]) == (
        "quadruped",
        "model_7.pt",
        "plane",
    )
    assert told["all"]["robots"] == 2
    assert len(told["by_command"]) == 2


def test_the_same_words_give_the_same_bytes(here):
    words = ("walk", "--seconds", "0.2", "--num-envs", "2", "--seed", "3")
    assert here(*words) == here(*words)


def test_one_command_for_all(here):
    words = ("walk", "--seconds", "2.1", "--num-envs", "1", "--command", "-0.5", "0", "0")
    told = json.loads(here(*words)[1])
    assert told["all"]["robots"] == 1
    assert told["all"]["lin_vel_error"] < 0.25  # it walks backward as it is asked to
    assert "by_command" not in told


def test_it_writes_a_file_once(here, tmp_path, monkeypatch):
    words = ("walk", "--seconds", "0.04", "--num-envs", "1", "-o", "result.json")
    assert here(*words) == (0, "wrote result.json\n", "")
    before = (tmp_path / "result.json").read_text()
    assert json.loads(before)["seconds"] == 0.04
    with monkeypatch.context() as patch:
        patch.setattr(run_module, "open_run", None)  # it is told before any work
        code, _, err = here(*words)
    assert code == 2
    assert "result.json exists" in one_line(err)
    assert here(*words, "--overwrite")[0] == 0
    assert (tmp_path / "result.json").read_text() == before


def test_a_checkpoint_is_asked_for_by_its_iteration(here):
    words = ("--seconds", "0.04", "--num-envs", "1")
    told = [
        json.loads(here(*run, *words)[1])["checkpoint"]
        for run in (("walk",), ("walk", "--checkpoint", "3"), ("walk/model_3.pt",))
    ]
    assert told == ["model_7.pt", "model_3.pt", "model_3.pt"]


def test_a_robot_whose_policy_is_shipped_walks(here):
    words = ("--seconds", "3", "--num-envs", "1", "--command", "0.5", "0", "0.5")
    told = json.loads(here("quadruped", *words)[1])
    assert told["robot"] == "quadruped"
    assert told["all"]["falls"] == 0
    assert told["all"]["lin_vel_error"] < 0.25
    assert told["all"]["ang_vel_error"] < 0.25


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ((), "no RUN; wanted"),
        (("walk", "--checkpoint", "5"), "there are: 3, 7"),
        (("walk", "--seconds", "-1"), "seconds is -1; wanted more than 0"),
        (("walk", "--checkpoint", "-5"), "there are: 3, 7"),
        (("walk", "--num-envs", "-3"), "num_envs is -3"),
        (("walk", "--num-envs", "0"), "num_envs is 0"),
        (("walk", "--terrain", "moon"), "terrain 'moon'; wanted plane"),
        (("walk", "--terrain", "gone.npz"), "gone.npz"),
        (("walk", "--device", "abacus"), "device 'abacus'; here there is: cpu"),
        (("walk", "--command", "1", "0"), "--command"),
        (("walk", "--command", "nan", "0", "0"), "wanted three numbers"),
        (("walk", "--command", "1", "0", "0", "--random-commands"), "wanted one"),
        (("walk", "-o", "nowhere/result.json"), "there is no folder nowhere"),
    ],
)
def test_what_cannot_be_is_one_line(here, words, told):
    code, out, err = here(*words)
    assert (code, out) == (2, "")
    assert told in one_line(err)


def test_without_the_extra_it_says_what_to_install(here, monkeypatch):
    monkeypatch.setattr(training_extra, "_PACKAGES", ("torch", "no_such_package"))
    code, _, err = here("walk")
    assert code == 2
    assert "pip install 'terrainkit[train]'" in one_line(err)


def test_a_terminal_gets_a_headline(here, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    _, out, err = here("walk", "--seconds", "2.1", "--num-envs", "1", "--command", "0", "0", "0")
    assert json.loads(out)
    assert "quadruped, model_7.pt, on plane: 1 robots, 0 fell; off by 0." in err


def test_what_was_never_measured_is_told_and_is_a_dash():
    from terrainkit_robots.policy.score import Evaluation, Score

    score = Score(
        robots=4,
        falls=4,
        success=0.25,
        lin_vel_error=None,
        lin_vel_error_1s=None,
        ang_vel_error=None,
        ang_vel_error_1s=None,
    )
    found = Evaluation(
        robot="hare", checkpoint="model_1.pt", terrain="hill.npz", seconds=2, seed=1, whole=score
    )
    assert evaluate_command.headline(found) == (
        "hare, model_1.pt, on hill.npz: 4 robots, 4 fell, 25% success; "
        "errors are measured from 2 s after a command on, and none walked so long"
    )
    measured = replace(score, lin_vel_error=0.12345)
    assert evaluate_command.errors(measured)[0] == "0.123 m/s (- averaged over 1 s)"

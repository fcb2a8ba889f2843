import json
from functools import partial

import cv2
import numpy as np
import pytest

pytest.importorskip("torch", reason="the extra `train` is not installed")

from terrainkit_cli.check_task_command import draw_rewards, reward_rows

REWARDS = {"statue": {"track": 0.5, "slip": 0.0}, "moving": {"track": 2.0, "slip": -0.4}}


@pytest.fixture
def here(terrainkit):
    """Run `terrainkit check-task` in an empty folder."""
    return partial(terrainkit, "check-task")


def test_report_and_picture_of_an_environment_of_gymnasium(here, tmp_path):
    pytest.importorskip("gymnasium")
    run = here("Walker2d-v5", "--picture", "rewards.png", "--ignore", "TSK012=it is planar")
    assert run.returncode == 0, run.stderr
    lines = run.stdout.splitlines()
    assert lines[0].split() == ["reward", "statue", "random", "moving", "fall"]
    assert [line.split()[0] for line in lines[1:6]] == ["forward", "ctrl", "survive", "rest", "sum"]
    assert "skipped: TSK012: ignored: it is planar" in run.stdout
    assert (tmp_path / "rewards.png").stat().st_size < 1e6


def test_formats_and_exit_code(here):
    pytest.importorskip("gymnasium")
    run = here("Walker2d-v5", "--format", "json", "--select", "TSK007")
    document = json.loads(run.stdout)
    assert (document["kind"], document["verdict"], run.returncode) == ("task", "pass", 0)
    assert set(document["facts"]["rewards"]["moving"]) == {"forward", "ctrl", "survive", "rest"}
    sarif = json.loads(here("Walker2d-v5", "--format", "sarif").stdout)["runs"][0]
    assert {rule["id"][:3] for rule in sarif["tool"]["driver"]["rules"]} == {"TSK"}


def test_environment_without_states_is_checked_as_far_as_it_goes(here):
    pytest.importorskip("gymnasium")
    run = here("Pendulum-v1")
    assert run.returncode == 0, run.stderr
    assert run.stdout.splitlines()[0].split() == ["reward", "statue", "random"]
    assert "rules: the environment has no set_state" in run.stdout


BROKEN = """
import gymnasium
class Broken(gymnasium.Env):
    action_space = observation_space = gymnasium.spaces.Box(-1, 1, (2,))
    def reset(self, *, seed=None, options=None):
        return self.observation_space.sample(), {}
    def step(self, action):
        raise KeyError("no key")
gymnasium.register("Broken-v0", Broken)
"""


def test_broken_environment_is_one_line(here, tmp_path, monkeypatch):
    pytest.importorskip("gymnasium")
    (tmp_path / "broken_env.py").write_text(BROKEN)
    monkeypatch.syspath_prepend(tmp_path)
    run = here("broken_env:Broken-v0")
    assert run.returncode == 2
    assert "error: broken_env:Broken-v0: KeyError: 'no key'" in run.stderr


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("", "TASK: missing; expected a task, a run, an id, or --task FILE.py"),
        ("walker", "no task or robot folder 'walker'"),
        ("a.urdf", "terrainkit onboard a.urdf makes a folder"),
        ("quadruped --samples 99999", "--samples: got 99999; expected an integer >= 100000"),
        ("Ant-v5 --samples 100000", "--samples: got 100000 for a task of gymnasium; leave it out"),
        ("Walker-v99", "Walker-v99: "),
        ("CartPole-v1", "CartPole-v1: got the space Discrete(2); expected a Box"),
        ("Ant-v5 --terrain plane", "--task, --terrain: got a value for gymnasium; expected none"),
        ("Mjlab-Walk", "missing package: mjlab"),
        ("quadruped --select TSK099", "no rule 'TSK099'"),
    ],
)
def test_check_task_rejects(rejected, words, message):
    assert message in rejected(f"check-task {words}")


def test_table_has_sums():
    rows = [["reward", "statue", "moving"], ["track", "0.5", "2"], ["slip", "0", "-0.4"]]
    assert reward_rows(REWARDS) == [*rows, ["sum", "0.5", "1.6"]]


def test_picture_is_green_where_a_term_pays_and_red_where_it_costs():
    image = cv2.imdecode(np.frombuffer(draw_rewards(REWARDS), np.uint8), cv2.IMREAD_COLOR)
    assert image.shape == (4 * 28, 220 + 2 * 100, 3)
    # 0.4 is a quarter of the sum 1.6 of moving.
    assert image[28 + 3, 320 + 3].tolist() == [75, 255, 75]
    assert image[56 + 3, 320 + 3].tolist() == [75, 75, 255]
    assert image[56 + 3, 220 + 3].tolist() == [255, 255, 255]

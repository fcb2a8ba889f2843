from pathlib import Path

import numpy as np
import pytest

from terrainkit_robots.analysis.task_facts import Rollout, TaskFacts, TaskModel, Training
from terrainkit_robots.description.fix import Source
from terrainkit_robots.lint.rule import get_rule, rules
from terrainkit_robots.lint.runner import lint

TERMS = "tracking", "alive", "torques"
HEALTHY = {
    "statue": (0.2, 1.0, -0.1),
    "random": (0.1, 1.0, -0.5),
    "moving": (3.0, 1.0, -0.2),
    "fall": (0.0, 0.5, 0.0),
    "scattered": (0.0, 0.2, -9.0),
}
"""Rewards by behavior: 1.1 for a statue, and 3.8 for moving, of which 4.0 are positive."""


def rollout(rewards, observations=(0.0, 1.0), *, seconds=1.0, terminated=False, rises=None):
    steps = 50
    running = np.arange(steps)[:, None] < seconds / 0.02
    return Rollout(
        rewards=np.tile(np.asarray(rewards, float), (steps, 1, 1)),
        observations=np.tile(np.asarray(observations, float), (steps, 1, 1)),
        running=running,
        terminated=np.array([terminated]),
        rises=None if rises is None else np.array([rises]),
    )


def training(first=(1.0, -2.0), last=(1.0, -1.5), falls=(0.1, 0.1), terms=("alive", "torques")):
    rewards, falls = np.array([first, last]), np.array(falls)
    return Training(terms=terms, rewards=rewards, falls=falls, robot_seconds=100.0)


def task(rewards=(), rollouts=(), **values):
    table = HEALTHY | dict(rewards)
    made = {name: rollout(row, (k, -k)) for k, (name, row) in enumerate(table.items())}
    made["fall"] = rollout(table["fall"], terminated=True)
    healthy = {
        "clearance": np.array([0.01]),
        "base_height": 0.3,
        "commands": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]),
        "max_speed": 5.0,
        "joints": ("knee",),
        "targets": np.array([[-0.5], [0.0], [0.5]]),
        "limits": np.array([[-1.0], [1.0]]),
        "action_torque": np.array([0.6]),
        "asymmetry": "",
        "responses": {"knee": "", "neck": "overshoots"},
        "training": training(),
    }
    return TaskFacts(
        model=TaskModel("walk", "walk", Path("walk"), Source(file=Path("walk"), line=0)),
        host="terrainkit",
        dt=0.02,
        terms=TERMS,
        observation_names=("gravity", "velocity"),
        rollouts=made | dict(rollouts),
        missing={"climbing": "a plane"},
        **healthy | values,
    )


def found(facts):
    report = lint(facts, rules("task"))
    assert report.crashed == ()
    return {finding.code for finding in report.findings}


def test_healthy_task_has_no_findings():
    report = lint(task(), rules("task"))
    assert report.findings == ()
    assert {skip.code: skip.reason for skip in report.skipped} == {
        "TSK010": "a plane",
        "TSK013": "the task has no levels",
        "TSK014": "the task has no levels",
    }


@pytest.mark.parametrize(
    ("rewards", "codes"),
    [
        ({"random": (np.nan, 1.0, 0.0)}, {"TSK001"}),
        ({name: (*row[:2], 0.0) for name, row in HEALTHY.items()}, {"TSK002"}),
        ({name: (row[0], 1.0, row[2]) for name, row in HEALTHY.items()}, {"TSK003"}),
        # A tenth of the positive 4.0 above the 0 of standing and moving.
        ({"random": (0.1, 1.0, 0.39)}, set()),
        ({"random": (0.1, 1.0, 0.41)}, {"TSK004"}),
        # 20 times the positive 4.0
        ({"random": (0.1, 1.0, -79.0)}, set()),
        ({"random": (0.1, 1.0, -81.0)}, {"TSK005"}),
        # 80 % of 3.8 are 3.04.
        ({"statue": (2.03, 1.0, 0.0)}, set()),
        ({"statue": (2.05, 1.0, 0.0)}, {"TSK006"}),
        ({"stepping": (2.05, 1.0, 0.0)}, {"TSK006"}),
        ({"stepping": (2.9, 1.0, 0.0)}, {"TSK007"}),
        ({"statue": (2.9, 1.0, 0.0)}, {"TSK007"}),
        # A tenth of 3.8 is 0.38.
        ({"statue": (0.0, 1.0, -1.37)}, set()),
        ({"statue": (0.0, 1.0, -1.39)}, {"TSK008"}),
        ({"statue": (0.2, 1.39, -0.1)}, set()),
        ({"statue": (0.2, 1.41, -0.1)}, {"TSK009"}),
        ({"climbing": (2.0, 1.0, -3.0), "staying": (0.0, 0.1, -0.2)}, set()),
        ({"climbing": (2.0, 1.0, -3.2), "staying": (0.0, 0.1, -0.2)}, {"TSK010"}),
    ],
)
def test_rewards(rewards, codes):
    assert found(task(rewards)) == codes


@pytest.mark.parametrize(
    ("rollouts", "codes"),
    [
        ({"statue": rollout(HEALTHY["statue"], seconds=0.26, terminated=True)}, set()),
        ({"statue": rollout(HEALTHY["statue"], seconds=0.22, terminated=True)}, {"TSK011"}),
        ({"fall": rollout(HEALTHY["fall"])}, {"TSK012"}),
        ({"statue": rollout(HEALTHY["statue"], rises=1)}, {"TSK013"}),
        ({"moving": rollout(HEALTHY["moving"], rises=0)}, {"TSK014"}),
        ({"moving": rollout(HEALTHY["moving"], rises=1)}, set()),
        ({"random": rollout(HEALTHY["random"], (0.0, np.inf))}, {"TSK001", "TSK017"}),
        # Half of the numbers of three behaviors: 17.2 / sqrt(3) is 9.9.
        ({"random": rollout(HEALTHY["random"], (0.0, 17.0))}, set()),
        ({"random": rollout(HEALTHY["random"], (0.0, 17.5))}, {"TSK017"}),
    ],
)
def test_episodes_and_observations(rollouts, codes):
    assert found(task(rollouts=rollouts)) == codes


def test_constant_observation_is_named():
    rollouts = {name: rollout(row, (0.0, k)) for k, (name, row) in enumerate(HEALTHY.items())}
    rollouts["fall"] = rollout(HEALTHY["fall"], terminated=True)
    (finding,) = lint(task(rollouts=rollouts), [get_rule("TSK016")]).findings
    assert finding.message == "observation gravity never changes"


@pytest.mark.parametrize(
    ("values", "codes"),
    [
        ({"clearance": np.array([0.0, -0.009])}, set()),
        ({"clearance": np.array([0.0, -0.011])}, {"TSK015"}),
        ({"clearance": np.array([0.29])}, set()),
        ({"clearance": np.array([0.31])}, {"TSK015"}),
        ({"targets": np.array([[0.5], [1.1], [1.7]])}, {"TSK018"}),
        ({"targets": np.array([[-1.1], [0.0], [1.1]])}, {"TSK018"}),
        ({"targets": np.array([[-0.9], [0.0], [1.1]])}, set()),
        ({"action_torque": np.array([1.01])}, {"TSK018"}),
        (
            {
                "joints": (),
                "targets": np.zeros((3, 0)),
                "limits": np.zeros((2, 0)),
                "action_torque": np.zeros(0),
            },
            set(),
        ),
        ({"asymmetry": "left and right differ"}, {"TSK019"}),
        ({"commands": np.zeros((9, 3))}, {"TSK020"}),
        ({"max_speed": 0.9}, {"TSK020"}),
        ({"responses": {"knee": "moves away from its target"}}, {"TSK021"}),
        ({"training": Training(error="the networks have diverged")}, {"TSK022"}),
        ({"training": training(last=(1.0, -2.09))}, {"TSK024"}),
        # 0.1 of 1.0
        ({"training": training((1.0, -0.5), (1.0, -0.59))}, set()),
        ({"training": training((1.0, -0.5), (1.0, -0.61))}, {"TSK023"}),
        # 100 and 146 falls: sqrt(246) is 15.7, and three times that 47.1
        ({"training": training(falls=(1.0, 1.46))}, set()),
        ({"training": training(falls=(1.0, 1.48))}, {"TSK023"}),
        ({"training": training(falls=(0.0, 0.24))}, set()),
        ({"training": training(falls=(0.0, 0.26))}, {"TSK023"}),
        ({"training": training(last=(0.75, -1.49))}, set()),
        ({"training": training(last=(0.75, -1.51))}, {"TSK024"}),
        # Falls may outweigh the rewards.
        ({"training": training(terms=("alive", "termination"), last=(1.0, -2.09))}, set()),
    ],
)
def test_spawns_actions_commands_and_trainings(values, codes):
    assert found(task(**values)) == codes


def test_spawns_in_the_ground_are_counted():
    clearance = np.array([0.0, -0.1, -0.3])
    (finding,) = lint(task(clearance=clearance), [get_rule("TSK015")]).findings
    assert "2 of 3 robots start in the ground, up to 30.0 cm deep" in finding.message

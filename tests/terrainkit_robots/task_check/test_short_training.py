from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from terrainkit_robots.rl import config
from terrainkit_robots.rl.config import Env, Task
from terrainkit_robots.rl.env import make_env
from terrainkit_robots.rl.rewards import REWARDS
from terrainkit_robots.rl.run import PolicySpec
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.task_check import short_training as module
from terrainkit_robots.task_check.check import check_task
from terrainkit_robots.task_check.hosts.terrainkit_host import TerrainkitHost
from terrainkit_robots.task_check.short_training import record_steps, train_briefly

TASK = Task(env=Env(num_envs=8, num_threads=1), runner=config.Runner(num_steps_per_env=4, seed=3))


def test_recorded_rewards_add_up(quadruped):
    env = make_env(TASK, quadruped, Plane())
    recorded = record_steps(env)
    falls, generator = [], torch.Generator().manual_seed(0)
    for _ in range(60):
        actions = 8 * torch.randn(8, 12, generator=generator)
        _, rewards, dones, extras = env.step(actions)
        falls.append(float((dones & ~extras["time_outs"]).float().mean()) / TASK.dt)
        total = sum(recorded[-1][1:])
        assert total == pytest.approx(float(rewards.mean()) / TASK.dt, abs=1e-3)
    assert [step[0] for step in recorded] == pytest.approx(falls)
    assert sum(falls) > 0


def test_training_keeps_the_random_state(quadruped):
    torch.manual_seed(5)
    before, texts = torch.get_rng_state(), []
    training = train_briefly(PolicySpec(task=TASK, robot=quadruped), 1000, texts.append)
    assert torch.equal(torch.get_rng_state(), before)
    assert texts == ["training, 50%", "training, 100%"]  # 1024 samples
    assert training.error == ""
    assert training.robot_seconds == pytest.approx(2 * 128 * 0.02)
    assert training.rewards.shape == (2, len(training.terms))
    assert np.isfinite([*training.rewards.flat, *training.falls]).all()


def test_training_compares_the_first_and_the_last_quarter(quadruped, monkeypatch):
    """The first second is not recorded: 50 steps at 50 Hz."""
    learned, recorded = [], []

    class Runner:
        def __init__(self, *_, **__):
            pass

        def learn(self, iterations, *, init_at_random_ep_len):
            learned.append((iterations, init_at_random_ep_len, torch.initial_seed()))
            recorded[:] = [[k, 2 * k] for k in range(60)]

    monkeypatch.setattr(module, "LeggedRunner", Runner)
    monkeypatch.setattr(module, "record_steps", lambda _: recorded)
    training = train_briefly(PolicySpec(task=TASK, robot=quadruped), 2 * 128 * 4, None)
    assert learned == [(2, True, 3)]
    assert training.falls.tolist() == [51, 58]  # the means of 50 to 52 and of 57 to 59
    assert training.rewards.tolist() == [[102], [116]]
    assert training.robot_seconds == 3 * 128 * 0.02


def test_training_that_stops_is_found(quadruped, monkeypatch):
    host = TerrainkitHost(PolicySpec(task=TASK, robot=quadruped), Plane(), Path("walk"))
    torques = lambda env: np.nan * env.state.base_pos[:, 0]  # noqa: E731
    monkeypatch.setitem(REWARDS, "torques", torques)
    report = check_task(host, samples=1)
    messages = {finding.code: finding.message for finding in report.findings}
    assert messages["TSK022"] == "rewards are not finite: torques"
    skipped = {skip.code for skip in report.skipped}
    assert {"TSK023", "TSK024"} <= skipped


def test_joints_that_do_not_follow_are_found(quadruped):
    task = replace(TASK, control=config.Control(damping=100.0))
    report = check_task(TerrainkitHost(PolicySpec(task=task, robot=quadruped), Plane(), Path("a")))
    assert "TSK021" in {finding.code for finding in report.findings}
    assert "no training was asked for" in {s.code: s.reason for s in report.skipped}["TSK022"]

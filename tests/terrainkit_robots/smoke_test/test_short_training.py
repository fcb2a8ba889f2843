from dataclasses import replace
from unittest.mock import MagicMock

import numpy as np
import pytest
import torch

from terrainkit_robots.rl import config
from terrainkit_robots.rl.config import Env, Task
from terrainkit_robots.rl.env import make_env
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.smoke_test import short_training as module
from terrainkit_robots.smoke_test.short_training import record_rewards, train_briefly

TASK = Task(env=Env(num_envs=8, num_threads=1))


def test_recorded_rewards_add_up(quadruped):
    env = make_env(TASK, quadruped, Plane())
    recorded = record_rewards(env)
    falls, generator = [], torch.Generator().manual_seed(0)
    for _ in range(60):
        actions = 8 * torch.randn(8, 12, generator=generator)
        _, rewards, dones, extras = env.step(actions)
        falls.append(float((dones & ~extras["time_outs"]).float().mean()) / TASK.dt)
        total = sum(recorded[-1][1:])
        assert total == pytest.approx(float(rewards.mean()) / TASK.dt, abs=1e-3)
    assert [step[0] for step in recorded] == pytest.approx(falls)
    assert sum(falls) > 0


def test_train_briefly_keeps_the_random_state(quadruped):
    torch.manual_seed(5)
    before, fractions = torch.get_rng_state(), []
    task = replace(TASK, runner=config.Runner(num_steps_per_env=4))
    record = train_briefly(quadruped, task, 1100, fractions.append)
    assert torch.equal(torch.get_rng_state(), before)
    assert fractions == [0.5, 1.0]  # 1024 samples
    assert len(record.losses) == 2
    assert record.error == ""
    assert record.robot_seconds == pytest.approx(2 * 128 * 0.02)
    assert set(record.first_rewards) == set(record.last_rewards)
    assert np.isfinite([*record.last_rewards.values(), *record.falls, record.noise_std]).all()


def test_record_compares_the_first_and_the_last_quarter(quadruped, monkeypatch):
    """The first second is not recorded: 50 steps at 50 Hz."""
    learned, recorded = [], []

    class Runner:
        def __init__(self, env, **_):
            self.env, self.alg = env, MagicMock()
            self.alg.get_policy().output_std = torch.tensor([0.5, 1.0])

        def learn(self, iterations, *, init_at_random_ep_len):
            learned.append((iterations, init_at_random_ep_len, torch.initial_seed()))
            recorded[:] = [[k, 2 * k] for k in range(60)]
            raise ValueError("two\nlines")

    monkeypatch.setattr(module, "LeggedRunner", Runner)
    monkeypatch.setattr(module, "record_rewards", lambda _: recorded)
    task = replace(TASK, runner=config.Runner(num_steps_per_env=4, seed=3))
    record = train_briefly(quadruped, task, 3 * 128 * 4 - 1, None)
    assert learned == [(2, True, 3)]
    assert record.falls == (51, 58)  # the means of 50 to 52 and of 57 to 59
    name = next(iter(record.first_rewards))
    assert (record.first_rewards, record.last_rewards) == ({name: 102}, {name: 116})
    assert (record.robot_seconds, record.noise_std) == (3 * 128 * 0.02, 0.75)
    assert (record.losses, record.error) == ([], "two lines")
    assert train_briefly(quadruped, task, 1, None).losses == []
    assert learned[1] == (1, True, 3)

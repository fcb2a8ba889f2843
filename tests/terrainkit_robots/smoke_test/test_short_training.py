from dataclasses import replace

import numpy as np
import pytest
import torch

from terrainkit_robots.rl.config import Env, Runner, Task
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.smoke_test.short_training import RecordingEnv, train_briefly

TASK = Task(env=Env(num_envs=8, num_threads=1))


def test_recording_env_adds_up_to_the_rewards(quadruped):
    env = RecordingEnv(TASK, quadruped, Plane())
    falls, generator = [], torch.Generator().manual_seed(0)
    for _ in range(60):
        actions = 8 * torch.randn(8, 12, generator=generator)
        _, rewards, dones, extras = env.step(actions)
        falls.append(float((dones & ~extras["time_outs"]).float().mean()) / TASK.dt)
        total = sum(env.recorded[-1][1:])
        assert total == pytest.approx(float(rewards.mean()) / TASK.dt, abs=1e-3)
    assert [step[0] for step in env.recorded] == pytest.approx(falls)
    assert sum(falls) > 0


def test_train_briefly_keeps_the_random_state(quadruped):
    torch.manual_seed(5)
    before, fractions = torch.get_rng_state(), []
    task = replace(TASK, runner=Runner(num_steps_per_env=4))
    record = train_briefly(quadruped, task, 1100, fractions.append)
    assert torch.equal(torch.get_rng_state(), before)
    assert fractions == [0.5, 1.0]  # 1024 samples
    assert len(record.losses) == 2
    assert record.error == ""
    assert record.robot_seconds == pytest.approx(2 * 128 * 0.02)
    assert set(record.first_rewards) == set(record.last_rewards)
    assert np.isfinite([*record.last_rewards.values(), *record.falls, record.noise_std]).all()

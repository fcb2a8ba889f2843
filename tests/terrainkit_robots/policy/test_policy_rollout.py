import json
from itertools import repeat

import numpy as np
import pytest
import torch

from terrainkit_robots.policy.evaluate import eval_task
from terrainkit_robots.policy.policy_rollout import (
    SETTLING_TIME,
    EvaluationRollout,
    command_schedule,
    rollout,
)
from terrainkit_robots.rl.config import Commands, Env, Task
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.terrain import Plane

FORWARD = np.array([[1, 0, 0]], np.float32)


@pytest.fixture
def env(quadruped):
    task = Task(env=Env(num_envs=2, num_threads=1))
    return LeggedEnv(eval_task(task, 2), quadruped, Plane())


def still(obs):
    return torch.zeros(len(obs["policy"]), 12)


def run(env, seconds, commands, **options):
    measured = EvaluationRollout(env)
    measured.run(still, seconds, commands, **options)
    return measured


def select(*mask):
    return np.array(mask, bool)


def test_rollout_applies_the_schedule(env):
    forward, left = np.zeros((2, 2, 3), np.float32)
    forward[:, 0], left[:, 1] = 0.5, 0.25
    observed = []

    def observe(obs):
        observed.append(obs["policy"][0, :3].tolist())
        return still(obs)

    steps = list(rollout(env, observe, [forward, forward, left]))
    commands = [commands[0].tolist() for commands, _ in steps]
    assert commands == [[0.5, 0, 0], [0.5, 0, 0], [0, 0.25, 0]]
    assert observed == [[1.0, 0, 0], [1.0, 0, 0], [0, 0.5, 0]]  # scaled by 2


def test_rollout_yields_falls_but_not_timeouts(env):
    def collapse(obs):
        actions = still(obs)
        actions[0] = 100.0
        return actions

    falls = [falls for _, falls in rollout(env, collapse, repeat(None, 50))]
    assert np.any(falls, axis=0).tolist() == [True, False]
    env.reset()
    env.episode_length_buf[:] = env.max_episode_length - 1
    ((_, falls),) = rollout(env, still, [None])
    assert env.steps_since_reset.tolist() == [0, 0]
    assert falls.tolist() == [False, False]


def test_command_schedule_splits_the_time_equally():
    commands = np.arange(12, dtype=np.float32).reshape(2, 2, 3)
    schedule = command_schedule(commands, 5)
    assert [int(each[0, 0]) for each in schedule] == [0, 0, 0, 6, 6]
    assert schedule[0] is schedule[2]
    assert command_schedule(None, 3) == [None] * 3


def test_errors_are_measured_after_settling(make_sliding):
    env = make_sliding([[0.6, 0.3, 0.5], [1, 0, 0]])
    measured = run(env, 4.0, np.array([[1, 0, 0.3], [1, 0, 0]], np.float32))
    first = measured.metrics(select(1, 0))
    assert (first.lin_vel_error, first.lin_vel_error_1s) == (pytest.approx(0.5), pytest.approx(0.5))
    assert first.ang_vel_error == pytest.approx(0.2)
    assert first.success is None
    assert measured.metrics(select(1, 1)).lin_vel_error == pytest.approx(0.25)
    steps = round((4.0 - SETTLING_TIME) / env.cfg.dt)
    counts = {name: each.count.tolist() for name, each in measured.errors.items()}
    expected = {"lin_vel_error": [steps] * 2, "lin_vel_error_1s": [steps - 49] * 2}
    expected |= {"ang_vel_error": [steps] * 2, "ang_vel_error_1s": [steps - 49] * 2}
    assert counts == expected


def test_averaged_errors_ignore_sway(make_sliding):
    env = make_sliding([[1, 0, 0]])
    step = env.step

    def sway(actions):
        env.velocities = np.array([[1, 0.4 * (-1) ** env.num_steps, 0]], np.float32)
        return step(actions)

    env.step = sway
    metrics = run(env, 4.0, FORWARD).metrics(select(1))
    assert metrics.lin_vel_error == pytest.approx(0.4)
    assert metrics.lin_vel_error_1s == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("headings", [False, True])
def test_each_new_command_settles(make_sliding, headings):
    env = make_sliding([[1, 0, 0]], commands=Commands(heading_command=headings))
    measured = run(env, 6.0, np.array([[[1, 0, 0]], [[1, 0, 0.5]]], np.float32))
    assert measured.errors["lin_vel_error"].count[0] == 2 * round((3 - SETTLING_TIME) / env.cfg.dt)
    assert measured.metrics(select(1)).ang_vel_error == pytest.approx(0.25)


def test_heading_command_is_one_command(make_sliding):
    commands = Commands(heading_command=True, ang_vel_yaw=(-9, 9), min_norm=0.0, standing=0.0)
    env = make_sliding([[1, 0, 0]], commands=commands)
    yaw_rates = []
    measured = run(env, 3.0, None, progress=lambda _: yaw_rates.append(float(env.commands[0, 2])))
    assert len(set(yaw_rates)) > 1
    assert measured.errors["lin_vel_error"].count[0] == round((3 - SETTLING_TIME) / env.cfg.dt)


def test_fall_ends_the_measurement(make_sliding):
    env = make_sliding([[0, 0, 0]] * 3, fall_times=[0, 3.0, 1.0])
    measured = run(env, 4.0, np.tile(FORWARD, (3, 1)))
    assert measured.falls.tolist() == [False, True, True]
    assert measured.errors["lin_vel_error"].count.tolist() == [100, 49, 0]
    metrics = measured.metrics(select(0, 0, 1))
    assert (metrics.falls, metrics.robots, metrics.lin_vel_error) == (1, 1, None)


def test_success_is_half_a_patch(make_sliding, map_terrain):
    # Patches are 6 m long: half is crossed after 2.7 s at 1.1 m/s.
    velocities = [[1.1, 0, 0], [1.1, 0, 0], [0.3, 0, 0], [0.7, 0, 0], [1, 0, 0]]
    env = make_sliding(velocities, fall_times=[0, 3.5, 0, 0, 2.0], terrain=map_terrain)
    measured = run(env, 4.0, np.tile(FORWARD, (5, 1)))
    assert measured.falls.tolist() == [False, False, False, False, True]
    success = [measured.metrics(np.arange(5) == k).success for k in range(5)]
    assert success == [1, 1, 0, 0, 0]
    counts = measured.errors["lin_vel_error"].count
    assert counts[1] == counts[0] < 100
    metrics = measured.metrics(np.ones(5, bool))
    assert (metrics.success, metrics.falls) == (0.4, 1)
    assert metrics.drift == pytest.approx(0, abs=1e-6)


def test_sideways_drift_does_not_cross(make_sliding, map_terrain):
    # 3 m forward, in 3 s with 0.75 m to the side, and in 4.3 s with 3 m, after the end.
    env = make_sliding([[1, 0.25, 0], [0.7, 0.7, 0]], terrain=map_terrain)
    measured = run(env, 4.0, np.tile(FORWARD, (2, 1)))
    metrics = measured.metrics(select(1, 1))
    assert (metrics.success, metrics.drift) == (0.5, pytest.approx(0.25, abs=0.01))


def test_commands_that_do_not_cross_a_patch_measure_no_success(make_sliding, map_terrain):
    # 2 m in 4 s, where half a patch is 3 m; the last robot falls, and the first is faster.
    env = make_sliding([[0.9, 0, 0], [0.5, 0, 0], [0, 0, 0]], [0, 0, 2.0], terrain=map_terrain)
    measured = run(env, 4.0, np.tile(0.5 * FORWARD, (3, 1)))
    assert [measured.metrics(np.arange(3) == k).success for k in range(3)] == [1, None, 0]
    assert measured.metrics(np.ones(3, bool)).success == 0.5


@pytest.mark.parametrize(("stop_early", "steps"), [(True, 5), (False, 20)])
def test_rollout_stops_when_all_robots_have_fallen(make_sliding, stop_early, steps):
    fractions = []
    env = make_sliding([[0, 0, 0]], fall_times=[0.1])
    run(env, 0.4, 0 * FORWARD, progress=fractions.append, stop_early=stop_early)
    assert (len(fractions), fractions[-1]) == (steps, pytest.approx(steps / 20))


def test_commands_are_followed_from_half_of_their_velocity(make_sliding):
    velocities = [[0.6, 0, 0], [0.4, 0, 0], [0.6, 0, 0], [0.6, 0, 0.3], [0, 0, 0]]
    commands = np.array([[1, 0, 0]] * 2 + [[1, 0, 0.5]] * 2 + [[0, 0, 0]], np.float32)
    measured = run(make_sliding(velocities), 2.2, commands)
    followed = [measured.metrics(np.arange(5) == k).followed for k in range(5)]
    assert followed == [1, 0, 0, 1, None]
    assert measured.metrics(np.ones(5, bool)).followed == 0.5


def test_gait_of_standing_robots(env):
    metrics = run(env, 2.2, np.tile(FORWARD, (2, 1))).metrics(select(1, 1))
    assert (metrics.followed, metrics.duty_factor) == (0, (1, 1, 1, 1))
    assert metrics.swing_height == (None,) * 4
    assert (metrics.step_frequency, metrics.asymmetry) == (0, 0)
    assert metrics.base_pitch == pytest.approx(-0.0204, abs=2e-3)


def test_gait_without_contacts_has_no_nan(make_sliding, monkeypatch):
    monkeypatch.setattr("terrainkit_robots.rl.state.CONTACT_FORCE", np.inf)
    metrics = run(make_sliding([[0.6, 0, 0]]), 2.2, FORWARD).metrics(select(1))
    assert metrics.followed == 1
    assert metrics.foot_slip is None
    json.dumps(metrics.as_dict(), allow_nan=False)

from itertools import repeat

import numpy as np
import pytest
import torch

from terrainkit_robots.policy.rollout import timetable, walk
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.terrain import Plane


@pytest.fixture
def env(quadruped, calm):
    return LeggedEnv(calm(2), quadruped, Plane())


def still(seen):
    return torch.zeros(len(seen["policy"]), 12)


def test_what_is_asked_for_is_followed_in_the_step_that_it_is_asked_for(env):
    ahead, left = np.zeros((2, 2, 3), np.float32)
    ahead[:, 0], left[:, 1] = 0.5, 0.25
    steps = list(walk(env, still, [ahead, ahead, left]))
    assert [step.commands[0].tolist() for step in steps] == [[0.5, 0, 0], [0.5, 0, 0], [0, 0.25, 0]]
    told = [step.observed["policy"][0, :3].tolist() for step in steps]
    assert told == [[1.0, 0, 0], [1.0, 0, 0], [0, 0.5, 0]]  # scaled by 2
    assert env.steps_since_reset.tolist() == [3, 3]


def test_it_makes_no_step_that_nobody_asks_for(env):
    walking = walk(env, still, repeat(None))
    assert env.steps_since_reset.tolist() == [0, 0]
    next(walking)
    assert env.steps_since_reset.tolist() == [1, 1]


def test_commands_are_random_again_once_none_are_held(env):
    held = np.full((2, 3), 0.1, np.float32)
    list(walk(env, still, [held]))
    assert env.velocity_command.held is held
    list(walk(env, still, [None]))
    assert env.velocity_command.held is None


def test_who_falls_is_told_but_not_who_runs_out_of_time(quadruped, calm):
    env = LeggedEnv(calm(2), quadruped, Plane())

    def limp(_):
        actions = torch.zeros(2, 12)
        actions[0] = 100.0
        return actions

    fallen = [step.fallen for step in walk(env, limp, repeat(None, 50))]
    assert np.any(fallen, axis=0).tolist() == [True, False]
    env.reset()
    env.episode_length_buf[:] = env.max_episode_length - 1
    (step,) = walk(env, still, [None])
    assert env.steps_since_reset.tolist() == [0, 0]
    assert step.fallen.tolist() == [False, False]


def test_each_of_several_commands_has_the_same_part_of_the_time():
    commands = np.arange(12, dtype=np.float32).reshape(2, 2, 3)
    told = timetable(commands, 5)
    assert [int(each[0, 0]) for each in told] == [0, 0, 0, 6, 6]
    assert told[0] is told[2]
    (one,) = timetable(commands[0], 1)
    np.testing.assert_array_equal(one, commands[0])
    assert timetable(None, 3) == [None] * 3

import shutil
import warnings

import pytest
import torch

from terrainkit.errors import ConfigError, TerrainkitWarning
from terrainkit_robots.policy.actor import actor_of, policy_of
from terrainkit_robots.rl.config import Env, Task
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.run import create_run, open_run
from terrainkit_robots.rl.runner import LeggedRunner
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.rl.terrain import Plane


@pytest.fixture
def env(trained):
    run = open_run(trained)
    return LeggedEnv(run.task, run.robot, Plane())


def test_a_policy_acts_always_the_same_and_changes_nothing(trained, env):
    runner = LeggedRunner(env)
    runner.load(open_run(trained).checkpoint)
    before, state = env.get_observations(), torch.get_rng_state()
    act = policy_of(open_run(trained), env)
    actions = act(before)
    torch.testing.assert_close(actions, act(before), rtol=0, atol=0)
    expected = runner.alg.get_policy()(before)
    torch.testing.assert_close(actions, expected.detach(), rtol=0, atol=0)
    assert not actions.requires_grad
    assert torch.is_grad_enabled()
    for _ in range(3):
        env.step(act(env.get_observations()))
    assert runner.alg.get_policy().training
    assert state.shape == torch.get_rng_state().shape


def test_a_checkpoint_is_the_one_that_was_asked_for(trained, env):
    first, second = (
        policy_of(open_run(trained, iteration), env)(env.get_observations()) for iteration in (1, 2)
    )
    assert not torch.equal(first, second)


def test_the_network_is_ready_to_be_used(trained, env):
    assert not actor_of(open_run(trained), env).training


def test_a_run_without_a_checkpoint_has_no_policy(env, tmp_path):
    run = create_run(tmp_path / "run", Task(), "quadruped", "plane")
    with pytest.raises(ConfigError, match="has no checkpoint yet"):
        policy_of(run, env)


@pytest.mark.parametrize(("name", "told"), [("quadruped.xml", True), ("robot.toml", False)])
def test_a_robot_that_moves_otherwise_than_in_training_is_told(trained, env, tmp_path, name, told):
    mine = tmp_path / "mine"
    shutil.copytree(get_task("quadruped").folder, mine)
    folder = create_run(tmp_path / "run", Task(policy=env.cfg.policy), mine, "plane").folder
    shutil.copy(trained / "model_2.pt", folder)
    (mine / name).write_text((mine / name).read_text() + "\n")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        policy_of(open_run(folder), env)
    said = [str(each.message) for each in caught if each.category is TerrainkitWarning]
    assert said == [f"{mine} has another {name} than {folder} was trained with"] * told


def test_a_policy_of_another_robot_is_told(trained, biped):
    env = LeggedEnv(Task(env=Env(num_envs=1, num_threads=1)), biped, Plane())
    with pytest.raises(ConfigError, match=r"is of another robot, quadruped, whose joints are: .*_"):
        policy_of(open_run(trained), env)


def test_a_policy_that_sees_more_or_less_is_told(trained, quadruped, map_ground):
    env = LeggedEnv(Task(env=Env(num_envs=1, num_threads=1)), quadruped, map_ground)
    with pytest.raises(ConfigError, match="observations policy are 45 numbers; here they are 232"):
        policy_of(open_run(trained), env)

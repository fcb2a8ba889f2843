from dataclasses import replace

import pytest
import torch

from terrainkit.errors import ConfigError
from terrainkit_robots.checkpoint import read_checkpoint, save_checkpoint
from terrainkit_robots.policy.load_policy import load_policy
from terrainkit_robots.rl.config import Env, Observations, Task
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.runner import LeggedRunner
from terrainkit_robots.rl.terrain import Plane


@pytest.fixture
def env(trained):
    return LeggedEnv(trained.task, trained.robot, Plane())


def test_load_policy_acts_as_the_runner(trained, env):
    runner = LeggedRunner(env)
    runner.load(trained.checkpoint)
    obs = env.get_observations()
    policy = load_policy(trained, env)
    assert not policy.training
    assert torch.equal(policy(obs), runner.alg.get_policy()(obs))
    assert torch.equal(policy(obs), policy(obs))


def test_load_policy_requires_a_checkpoint(make_run, env):
    with pytest.raises(ConfigError, match="got no checkpoint; expected a trained run"):
        load_policy(make_run(), env)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (torch.Tensor.double, r"got float64 \(16, 47\); expected float32 \(16, 47\)"),
        (torch.Tensor.t, r"got float32 \(47, 16\); expected float32 \(16, 47\)"),
        (lambda weight: weight / 0, "got .*(nan|inf); expected finite numbers"),
    ],
)
def test_load_policy_rejects_changed_weights(trained, env, tmp_path, change, told):
    state = read_checkpoint(trained.checkpoint)
    actor = state["actor_state_dict"]
    actor["mlp.0.weight"] = change(actor["mlp.0.weight"])
    save_checkpoint(tmp_path / "model.pt", state)
    with pytest.raises(ConfigError, match=rf"actor_state_dict\.mlp\.0\.weight: {told}"):
        load_policy(replace(trained, checkpoint=tmp_path / "model.pt"), env)


def test_load_policy_rejects_another_robot_or_other_observations(
    trained, quadruped, biped, map_terrain
):
    task = Task(env=Env(num_envs=1, num_threads=1), observations=Observations(history_length=1))
    with pytest.raises(ConfigError, match="another robot, quadruped"):
        load_policy(trained, LeggedEnv(task, biped, Plane()))
    with pytest.raises(ConfigError, match=r"47 .* 234"):
        load_policy(trained, LeggedEnv(task, quadruped, map_terrain))

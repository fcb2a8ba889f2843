import shutil
import warnings
from dataclasses import replace

import pytest
import torch

from terrainkit.errors import ConfigError
from terrainkit_robots.checkpoint import read_checkpoint, save_checkpoint
from terrainkit_robots.policy.load_policy import load_policy
from terrainkit_robots.rl.config import Env, Observations, Task
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.run import create_run, open_run
from terrainkit_robots.rl.runner import LeggedRunner
from terrainkit_robots.rl.tasks import get_task
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


@pytest.mark.parametrize(("name", "warns"), [("quadruped.xml", True), ("robot.toml", False)])
def test_load_policy_warns_about_a_changed_model(trained, env, tmp_path, name, warns):
    robot = shutil.copytree(get_task("quadruped").folder, tmp_path / "robot")
    folder = create_run(tmp_path / "run", trained.task, robot, "plane").folder
    shutil.copy(trained.checkpoint, folder)
    (robot / name).write_text((robot / name).read_text() + "\n")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        load_policy(open_run(folder), env)
    told = [str(each.message) for each in caught]
    assert told == warns * [f"{robot}: quadruped.xml changed after {folder} was trained"]


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

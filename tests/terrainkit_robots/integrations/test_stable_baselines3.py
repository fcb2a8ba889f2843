import warnings
from dataclasses import replace

import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.integrations.gymnasium import TaskVectorEnv
from terrainkit_robots.rl.tasks import get_task

# `make integrations` installs it and runs this file.
pytest.importorskip("stable_baselines3")

from stable_baselines3 import PPO
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize, is_vecenv_wrapped

from terrainkit_robots.integrations.stable_baselines3 import Sb3VecEnvWrapper

FALL = np.tile(np.array([0, 3.0, 0] * 4, np.float32), (3, 1))


@pytest.fixture
def env():
    """Three robots with episodes of five steps."""
    task = get_task("quadruped").task
    short = replace(task, env=replace(task.env, episode_length_s=5 * task.dt))
    return Sb3VecEnvWrapper(TaskVectorEnv("quadruped", num_envs=3, task=short))


def test_step_reports_truncated_episodes(env):
    assert env.reset().shape == (3, 47)
    rewards = 0
    for _ in range(5):
        observations, reward, dones, infos = env.step(np.zeros((3, 12), np.float32))
        rewards += reward
    assert dones.all()
    for index, info in enumerate(infos):
        assert info["TimeLimit.truncated"] is True
        assert info["terminal_observation"].shape == (47,)
        assert not np.allclose(info["terminal_observation"], observations[index])
        assert info["episode"]["l"] == 5
        assert info["episode"]["r"] == pytest.approx(rewards[index])
    *_, dones, infos = env.step(np.zeros((3, 12), np.float32))
    assert not dones.any()
    assert infos == [{}, {}, {}]


def test_step_reports_terminated_episodes():
    env = Sb3VecEnvWrapper(TaskVectorEnv("quadruped", num_envs=3))
    env.reset()
    steps, dones = 0, np.zeros(3, bool)
    while steps < 200 and not dones.any():
        *_, dones, infos = env.step(FALL)
        steps += 1
    index = int(np.flatnonzero(dones)[0])
    assert infos[index]["TimeLimit.truncated"] is False
    assert infos[index]["episode"]["l"] == steps
    assert (infos[index]["terminal_observation"] == 3.0).sum() == 4  # its last action


def test_seed_determines_episodes(env):
    runs = []
    for seed in (3, 3, 4):
        env.seed(seed)
        runs.append(np.concatenate([env.reset(), env.step(FALL)[0]]))
    np.testing.assert_array_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0], runs[2])


def test_attributes_are_those_of_the_vector_env(env):
    assert env.get_attr("num_envs") == [3, 3, 3]
    assert env.get_attr("num_envs", indices=1) == [3]
    assert not env.has_attr("nothing")
    env.set_attr("tag", "mine")
    assert env.get_attr("tag", [0, 2]) == ["mine", "mine"]
    with pytest.raises(ConfigError, match=r"got \[1\]; expected all 3 environments"):
        env.set_attr("tag", "other", indices=1)
    assert env.env_method("render", indices=[0, 1]) == [None, None]
    assert is_vecenv_wrapped(env, VecMonitor)
    assert env.env_is_wrapped(Monitor, indices=0) == [False]


def test_ppo_learns_saves_and_loads_without_warnings(env, tmp_path):
    normalized = VecNormalize(env)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model = PPO("MlpPolicy", normalized, n_steps=8, batch_size=24, seed=1, device="cpu")
        model.learn(48)
        assert len(model.ep_info_buffer) > 0
        model.save(tmp_path / "policy.zip")
        normalized.save(str(tmp_path / "scales.pkl"))
        loaded = VecNormalize.load(str(tmp_path / "scales.pkl"), env)
        loaded.training = False
        policy = PPO.load(tmp_path / "policy.zip", env=loaded, device="cpu")
        rewards, lengths = evaluate_policy(policy, loaded, 3, return_episode_rewards=True)
    assert lengths == [5, 5, 5]
    assert np.isfinite(rewards).all()
    observations = loaded.normalize_obs(env.reset())
    np.testing.assert_array_equal(
        model.predict(observations, deterministic=True)[0],
        policy.predict(observations, deterministic=True)[0],
    )


def test_vec_monitor_writes_episodes(env, tmp_path):
    monitored = VecMonitor(env, str(tmp_path / "log"))
    monitored.reset()
    for _ in range(5):
        *_, infos = monitored.step(np.zeros((3, 12), np.float32))
    monitored.close()
    assert [info["episode"]["l"] for info in infos] == [5, 5, 5]
    assert len((tmp_path / "log.monitor.csv").read_text().splitlines()) == 2 + 3

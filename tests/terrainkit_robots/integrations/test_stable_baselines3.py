import warnings
from dataclasses import replace

import numpy as np
import pytest

from terrainkit_robots.integrations.gymnasium import TaskVectorEnv
from terrainkit_robots.rl.tasks import get_task

# `make integrations` installs it and runs this file.
pytest.importorskip("stable_baselines3")

from stable_baselines3 import PPO
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import VecNormalize

from terrainkit_robots.integrations.stable_baselines3 import Sb3VecEnvWrapper


@pytest.fixture
def env():
    """Three robots with episodes of five steps."""
    task = get_task("quadruped").task
    short = replace(task, env=replace(task.env, episode_length_s=5 * task.dt))
    return Sb3VecEnvWrapper(TaskVectorEnv("quadruped", num_envs=3, task=short))


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

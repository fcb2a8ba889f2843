"""The wrapper around what it uses of Stable-Baselines3, which need not be installed."""

import importlib
import sys
from types import ModuleType

import numpy as np
import pytest

from terrainkit.errors import ConfigError

MODULE = "terrainkit_robots.integrations.stable_baselines3"


class VecEnv:
    def __init__(self, num_envs, observation_space, action_space):
        self.num_envs, self.metadata, self._seeds = num_envs, {}, [7, 8, 9]
        self.observation_space, self.action_space = observation_space, action_space

    def _reset_seeds(self):
        self._seeds = [None] * self.num_envs

    def _get_indices(self, indices):
        return range(self.num_envs) if indices is None else np.atleast_1d(indices).tolist()


class VecMonitor:
    def __init__(self, venv):
        self.venv = venv


class Vector:
    """A vector environment whose episode 1 is truncated and 2 terminated."""

    num_envs, single_observation_space, single_action_space = 3, "observations", "actions"
    metadata = {"render_fps": 50}  # noqa: RUF012
    images = None

    def __init__(self):
        self.calls = []

    def reset(self, *, seed):
        self.calls.append(seed)
        return "first", {}

    def step(self, actions):
        terminated, truncated = np.array([False, False, True]), np.array([False, True, False])
        return "next", actions.sum(axis=1), terminated, truncated, {"final_obs": ["a", "b", "c"]}

    def render(self):
        return self.images

    def close(self):
        self.calls.append("close")


@pytest.fixture
def env(monkeypatch):
    module = ModuleType("stable_baselines3.common.vec_env")
    module.VecEnv, module.VecMonitor = VecEnv, VecMonitor
    for name in ("stable_baselines3", "stable_baselines3.common"):
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.delitem(sys.modules, MODULE, raising=False)
    wrapper = importlib.import_module(MODULE).Sb3VecEnvWrapper
    monkeypatch.delitem(sys.modules, MODULE)
    return wrapper(Vector()).venv


def test_spaces_and_frame_rate_are_those_of_the_vector_env(env):
    assert (env.num_envs, env.observation_space, env.action_space) == (3, "observations", "actions")
    assert env.metadata == {"render_fps": 50}


def test_step_describes_the_ends_of_episodes(env):
    env.step_async(np.array([[1, 2], [3, 4], [5, 6]]))
    observations, rewards, dones, infos = env.step_wait()
    assert observations == "next"
    assert (rewards.tolist(), dones.tolist()) == ([3, 7, 11], [False, True, True])
    assert infos == [
        {},
        {"terminal_observation": "b", "TimeLimit.truncated": True},
        {"terminal_observation": "c", "TimeLimit.truncated": False},
    ]


def test_first_seed_is_used_once(env):
    assert [env.reset(), env.reset()] == ["first", "first"]
    env.close()
    assert env.env.calls == [7, None, "close"]


def test_images_are_none_without_a_render_mode(env):
    assert env.get_images() == [None] * 3
    env.env.images = ("x", "y", "z")
    assert env.get_images() == ("x", "y", "z")


def test_attributes_and_methods_are_shared(env):
    assert env.get_attr("num_envs") == [3, 3, 3]
    assert env.get_attr("num_envs", [0, 2]) == [3, 3]
    env.set_attr("tag", "mine")
    assert env.env.tag == "mine"
    for indices in (1, [0, 0, 1]):
        with pytest.raises(ConfigError, match=r"indices of set_attr: got \[.*1\]; expected all 3 "):
            env.set_attr("tag", "other", indices)
    assert env.env.tag == "mine"
    env.env.images = "image"
    assert env.env_method("render", indices=[0, 2]) == ["image"] * 2
    assert env.env_is_wrapped(object, [1]) == [False]

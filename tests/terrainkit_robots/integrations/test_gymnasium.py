import importlib
import sys
import warnings
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import terrainkit as tk
from terrainkit.errors import ConfigError
from terrainkit_robots.integrations.gymnasium import TaskEnv, TaskVectorEnv
from terrainkit_robots.rendering.child_process import RenderError
from terrainkit_robots.rendering.pose_renderer import PoseRenderer
from terrainkit_robots.rl.tasks import get_task

MODULE = "terrainkit_robots.integrations.gymnasium"


@pytest.fixture
def short_task():
    """A task with episodes of five steps."""
    task = get_task("quadruped").task
    return replace(task, env=replace(task.env, episode_length_s=5 * task.dt))


@pytest.fixture(scope="module")
def map_file(tmp_path_factory):
    config = tk.MapConfig(rows=3, cols=3, border=1.0, preset="stairs")
    return tk.generate(config).save(tmp_path_factory.mktemp("maps") / "map.npz")


@pytest.mark.parametrize("robot", ["quadruped", "biped"])
def test_registered_env_passes_check(robot):
    env = gymnasium.make(f"{MODULE}:terrainkit/{robot}-v0")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check_env(env.unwrapped, skip_render_check=True)
    # The actions are the same as in training, where they are not normalized.
    others = [str(each.message) for each in caught if "normalized space" not in str(each.message)]
    assert not others


def test_env_on_map_passes_check(map_file):
    env = gymnasium.make(f"{MODULE}:terrainkit/quadruped-v0", terrain=map_file).unwrapped
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        check_env(env, skip_render_check=True)
    env.reset(seed=4)
    level = env.env.curriculum.levels.copy()
    env.env.curriculum.levels[:] = 2 - level
    env.reset(seed=4)
    assert env.env.curriculum.levels == level


def test_env_is_truncated_when_time_is_over(short_task):
    env = TaskEnv("quadruped", task=short_task)
    env.reset(seed=0)
    ends = [env.step(np.zeros(12))[2:4] for _ in range(6)]
    assert ends == [(False, False)] * 4 + [(False, True), (False, False)]


def test_env_is_terminated_by_fall_with_its_last_observation():
    env = TaskEnv("quadruped")
    env.reset(seed=0)
    push = np.array([0, 3.0, 0] * 4)
    for _ in range(200):
        observation, reward, terminated, truncated, _ = env.step(push)
        if terminated:
            break
    assert terminated
    assert not truncated
    assert reward < -0.5  # rewards.termination
    # The policy observes its last three actions, which are 0 after a reset.
    assert (observation == 3.0).sum() == 3 * 4
    assert not (env.reset()[0] == 3.0).any()


def test_vector_env_steps_like_single_env(short_task):
    vector, twin = (TaskVectorEnv("quadruped", num_envs=3, task=short_task) for _ in "ab")
    observations, _ = vector.reset(seed=5)
    np.testing.assert_array_equal(twin.reset(seed=5)[0], observations)
    assert not np.array_equal(twin.reset(seed=6)[0], observations)
    assert observations.shape == vector.observation_space.shape == (3, 141)
    assert vector.observation_space.contains(observations)
    for step in range(5):
        observations, rewards, terminated, truncated, infos = vector.step(np.zeros((3, 12)))
        assert rewards.shape == terminated.shape == (3,)
        assert truncated.all() == (step == 4)
    assert infos["_final_obs"].all()
    assert not np.allclose(infos["final_obs"], observations)  # of the next episode
    assert vector.observation_space.contains(infos["final_obs"])


def test_vector_env_observes_the_heights_of_a_map(map_file):
    task = get_task("quadruped_map").task
    task = replace(task, noise=replace(task.noise, noise_level=0.0))
    vector = TaskVectorEnv("quadruped_map", num_envs=16, terrain=map_file, task=task)
    observations, _ = vector.reset(seed=0)
    state, scale = vector.env.state, task.normalization.obs_scales.height_measurements
    expected = np.clip(state.height_scan - 0.5, -1, 1) * scale
    np.testing.assert_allclose(observations[:, -expected.shape[1] :], expected, atol=1e-5)
    assert np.ptp(expected) > 0.5


def render(env):
    try:
        return env.render()
    except RenderError as error:
        pytest.skip(str(error))


def test_env_renders_without_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make(f"{MODULE}:terrainkit/quadruped-v0", render_mode="rgb_array")
        assert env.metadata["render_fps"] == 50
        env.reset(seed=0)
        first = render(env)
        assert first.shape == (360, 640, 3)
        assert first.dtype == np.uint8
        for _ in range(5):
            env.step(np.full(12, 0.5, np.float32))
        assert (render(env) != first).any()
        env.close()
        env.close()


def test_env_renders_last_pose_of_episode(short_task):
    env = TaskEnv("quadruped", task=short_task, render_mode="rgb_array")
    env.reset(seed=0)
    for _ in range(4):
        env.step(np.zeros(12))
    before = render(env).astype(int)
    assert env.step(np.zeros(12))[3]
    last = render(env).astype(int)
    env.reset()
    first = render(env).astype(int)
    assert np.abs(last - before).mean() < np.abs(last - first).mean() / 2
    env.close()
    vector = TaskVectorEnv("quadruped", num_envs=2, render_mode="rgb_array")
    vector.reset(seed=0)
    one, other = render(vector)
    assert one.shape == other.shape == (360, 640, 3)
    assert (one != other).any()
    vector.close()


@pytest.mark.parametrize(("make", "options"), [(TaskEnv, {}), (TaskVectorEnv, {"num_envs": 1})])
def test_closing_ends_the_process_that_renders(monkeypatch, make, options):
    closed = []
    monkeypatch.setattr(PoseRenderer, "close", lambda renderer: closed.append(renderer))
    env = make("quadruped", render_mode="rgb_array", **options)
    env.close()
    assert len(closed) == 1


def test_spaces_have_the_limits_of_the_task(short_task):
    limits = replace(short_task.normalization, clip_observations=7.0, clip_actions=3.0)
    task = replace(short_task, normalization=limits, sim=replace(short_task.sim, dt=0.004))
    env, vector = TaskEnv("quadruped", task=task), TaskVectorEnv("quadruped", task=task, num_envs=2)
    for observation, action in (
        (env.observation_space, env.action_space),
        (vector.single_observation_space, vector.single_action_space),
    ):
        assert observation == gymnasium.spaces.Box(-7, 7, (141,), np.float32)
        assert action == gymnasium.spaces.Box(-3, 3, (12,), np.float32)
    assert vector.action_space.shape == (2, 12)
    assert env.metadata["render_fps"] == vector.metadata["render_fps"] == 62  # 1 / (4 * 0.004)
    assert env.render() is vector.render() is None
    env.close()


def test_env_rejects_unknown_render_mode():
    with pytest.raises(ConfigError, match="render_mode: got 'human'; expected 'rgb_array' or None"):
        TaskEnv("quadruped", render_mode="human")


def test_missing_gymnasium_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    monkeypatch.delitem(sys.modules, MODULE)
    message = r"Gymnasium is not installed; install it with: pip install '\.\[gymnasium\]'"
    with pytest.raises(ModuleNotFoundError, match=message):
        importlib.import_module(MODULE)

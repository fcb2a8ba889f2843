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
    # The policy observes its last action, which is 0 after a reset.
    assert (observation == 3.0).sum() == 4
    assert not (env.reset()[0] == 3.0).any()


def test_vector_env_steps_like_single_env(short_task):
    vector = TaskVectorEnv("quadruped", num_envs=3, task=short_task)
    observations, _ = vector.reset(seed=5)
    assert observations.shape == vector.observation_space.shape == (3, 47)
    assert vector.observation_space.contains(observations)
    for step in range(5):
        observations, rewards, terminated, truncated, infos = vector.step(np.zeros((3, 12)))
        assert rewards.shape == terminated.shape == (3,)
        assert truncated.all() == (step == 4)
    assert infos["_final_obs"].all()
    assert not np.allclose(infos["final_obs"], observations)  # of the next episode
    assert vector.observation_space.contains(infos["final_obs"])


def test_vector_env_observes_the_heights_of_a_map(tmp_path):
    config = tk.MapConfig(rows=4, cols=3, patch_size=(8.0, 6.0), border=2.0, preset="stairs")
    terrain_map = tk.generate(config)
    task = get_task("quadruped_map").task
    task = replace(task, noise=replace(task.noise, noise_level=0.0))
    file = terrain_map.save(tmp_path / "map.npz")
    vector = TaskVectorEnv("quadruped_map", num_envs=16, terrain=file, task=task)
    vector.reset(seed=0)
    for _ in range(50):
        observations = vector.step(np.zeros((16, 12)))[0]
    state = vector.env.state
    x, y = np.meshgrid(
        task.terrain.measured_points_x, task.terrain.measured_points_y, indexing="ij"
    )
    w, i, j, k = state.base_quat.astype(float).T[..., None]
    yaw = np.arctan2(2 * (w * k + i * j), 1 - 2 * (j**2 + k**2))
    base = state.base_pos.astype(float)[:, :, None]
    points = np.stack(
        [
            base[:, 0] + np.cos(yaw) * x.ravel() - np.sin(yaw) * y.ravel(),
            base[:, 1] + np.sin(yaw) * x.ravel() + np.cos(yaw) * y.ravel(),
            np.broadcast_to(base[:, 2], (16, x.size)),
        ],
        axis=-1,
    )
    heights = (
        base[:, 2]
        - observations[:, -x.size :] / task.normalization.obs_scales.height_measurements
        - 0.5
    )
    is_off = np.abs(heights - terrain_map.scan(points)) > 1e-3
    assert is_off.mean() < 0.01, is_off.mean()
    assert np.ptp(heights) > 0.3


def test_make_vec_makes_vector_env():
    vector = gymnasium.make_vec(f"{MODULE}:terrainkit/biped-v0", num_envs=2)
    assert isinstance(vector.unwrapped, TaskVectorEnv)
    assert vector.reset(seed=0)[0].shape[0] == 2


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


def test_vector_env_renders_each_robot():
    vector = gymnasium.make_vec(
        f"{MODULE}:terrainkit/quadruped-v0", num_envs=2, render_mode="rgb_array"
    )
    vector.reset(seed=0)
    frames = render(vector)
    assert [frame.shape for frame in frames] == [(360, 640, 3)] * 2
    assert (frames[0] != frames[1]).any()
    vector.close()


def test_env_without_render_mode_renders_nothing():
    env = TaskEnv("quadruped")
    assert env.render() is None
    env.close()


def test_env_rejects_unknown_render_mode():
    with pytest.raises(ConfigError, match="render_mode: got 'human'; expected 'rgb_array' or None"):
        TaskEnv("quadruped", render_mode="human")


def test_vector_env_is_deterministic():
    rewards = []
    for _ in range(2):
        vector = TaskVectorEnv("quadruped", num_envs=2)
        vector.reset(seed=3)
        rewards.append([vector.step(np.full((2, 12), 0.3))[1] for _ in range(20)])
    np.testing.assert_array_equal(*rewards)


def test_env_rejects_unknown_robot():
    with pytest.raises(ConfigError, match="Tasks are"):
        TaskEnv("quadrupde")


def test_missing_gymnasium_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    monkeypatch.delitem(sys.modules, MODULE)
    message = r"Gymnasium is not installed; install it with: pip install '\.\[gymnasium\]'"
    with pytest.raises(ModuleNotFoundError, match=message):
        importlib.import_module(MODULE)

import numpy as np
import pytest
import torch

from terrainkit.errors import ConfigError
from terrainkit_robots.policy import play as module
from terrainkit_robots.policy.evaluate import EvaluationConfig, make_eval_env
from terrainkit_robots.policy.play import (
    PoseRecorder,
    demo_commands,
    play,
    select_tracked_robots,
)
from terrainkit_robots.rl.config import Commands, Terrain


@pytest.fixture(autouse=True)
def still(monkeypatch):
    """Load policies that do not move."""
    monkeypatch.setattr(
        module, "load_policy", lambda _, env: lambda _: torch.zeros(env.num_envs, env.num_actions)
    )


def test_demo_commands_respect_the_limits():
    commands = Commands(lin_vel_x=(0, 2), lin_vel_y=(0, 0), ang_vel_yaw=(-1, 1))
    expected = [[1.5, 0, 0], [1.5, 0, 0.75], [0, 0, 0], [0, 0, -0.75]]
    np.testing.assert_allclose(demo_commands(commands), expected)


@pytest.mark.parametrize("flat_map", [False, True])
def test_play_on_a_plane_shows_demo_commands(make_run, map_file, flat_map):
    fractions = []
    run = make_run(map_file, terrain=Terrain(collision="plane")) if flat_map else make_run()
    result = play(run, EvaluationConfig(seconds=0.8), progress=fractions.append)
    assert (len(fractions), fractions[-1]) == (40, 1)
    assert result.evaluation.about["all"].robots == 9
    video = result.video
    assert (video.poses.shape, video.fps) == ((20, 9, 19), 25)
    (shot,) = video.shots
    assert (shot.robot, len(shot.captions)) == (4, 20)
    captions = list(dict.fromkeys(shot.captions))
    assert captions[0] == "forward 0.75 m/s"
    assert (captions[1], len(captions)) == ("forward 0.75 m/s, turning left 0.75 rad/s", 4)


def test_play_arranges_robots_in_a_formation(make_run):
    poses = play(make_run(), EvaluationConfig(seconds=0.02, num_envs=4)).video.poses[0]
    x, y = poses[:, 0].reshape(2, 2), poses[:, 1].reshape(2, 2)
    assert np.ptp(x, axis=1).max() < 0.01
    assert np.ptp(y, axis=0).max() < 0.01
    assert x[0, 0] - x[1, 0] == pytest.approx(y[0, 1] - y[0, 0], abs=0.01)
    assert x[0, 0] - x[1, 0] > 0.5
    np.testing.assert_allclose(poses[:, 6], 0, atol=0.01)  # they face along x


@pytest.mark.parametrize(
    ("command", "caption"),
    [((-0.5, -0.25, 0), "backward 0.5 m/s, right 0.25 m/s"), ((0, 0, 0), "standing")],
)
def test_play_uses_a_given_command(make_run, command, caption):
    config = EvaluationConfig(seconds=0.04, num_envs=1, command=command)
    assert play(make_run(), config).video.shots[0].captions == (caption,)


def test_play_on_a_map_follows_robots_on_each_terrain(make_run, map_file):
    run, config = make_run(map_file), EvaluationConfig(seconds=0.8)
    result = play(run, config, robots=2, size=(128, 72))
    assert result.evaluation.about["all"].robots == 6  # one per patch
    video = result.video
    assert (video.poses.shape[:2], video.size) == ((20, 6), (128, 72))
    captions = [shot.captions[0] for shot in video.shots]
    assert captions == ["stairs, level 1 of 2", "rough_slope, level 1 of 2"]
    assert [len(shot.captions) for shot in video.shots] == [10, 10]


def test_shot_ends_at_the_first_fall(make_run, map_file, monkeypatch):
    env, _ = make_eval_env(make_run(map_file), EvaluationConfig(num_envs=2))
    recorder = PoseRecorder(env)
    for step in range(20):
        env.step(torch.zeros(2, 12))
        if step in (11, 15):
            env.steps_since_reset[1] = 0  # as after a fall
        recorder.record()
    monkeypatch.setattr(module, "select_tracked_robots", lambda *_: [0])
    assert len(recorder.make_video(1, (128, 72)).shots[0].captions) == 10
    monkeypatch.setattr(module, "select_tracked_robots", lambda *_: [1])
    assert len(recorder.make_video(1, (128, 72)).shots[0].captions) == 6


def test_tracked_robots_cover_all_terrains_first(make_run, map_file):
    env, _ = make_eval_env(make_run(map_file), EvaluationConfig(num_envs=12))
    robots = select_tracked_robots(env, 3)
    assert env.curriculum.columns[robots].tolist() == [0, 1, 0]
    assert env.curriculum.levels[robots].tolist() == [1, 1, 1]
    assert select_tracked_robots(env, 1) == robots[:1]
    assert sorted(select_tracked_robots(env, 100)) == list(range(12))


def test_play_without_video_records_nothing(make_run):
    result = play(make_run(), EvaluationConfig(seconds=0.04, num_envs=1), video=False)
    assert result.video is None
    assert result.evaluation.about["all"].falls == 0


def test_play_rejects_zero_robots(make_run):
    with pytest.raises(ConfigError, match="robots: got 0; expected 1 or more"):
        play(make_run(), robots=0)

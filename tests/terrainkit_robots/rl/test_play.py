import copy
from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from terrainkit.errors import ConfigError
from terrainkit_robots.rl import play as playing
from terrainkit_robots.rl import runner
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.evaluation import Asked
from terrainkit_robots.rl.ground import Plane
from terrainkit_robots.rl.play import Recorder, play, tour_of, view, visited
from terrainkit_robots.rl.rotation import yaw_of
from terrainkit_robots.rl.task import Commands, Env, InitState


@pytest.fixture
def run_of(quadruped, lively, monkeypatch):
    """Return a run whose policy stands still."""

    def policy(_, env):
        return lambda _: torch.zeros(env.num_envs, env.num_actions)

    monkeypatch.setattr(runner, "policy_of", policy)

    def make(ground="plane", **sections):
        return SimpleNamespace(
            task=lively(**sections), robot=quadruped, terrain=str(ground), checkpoint=None
        )

    return make


@pytest.fixture
def marching(quadruped, calm):
    start = InitState(reset_range=(1.0, 1.0), lin_vel=0.0, ang_vel=0.0)  # any place, any heading
    return LeggedEnv(calm(4, init_state=start), quadruped, Plane())


def test_the_tour_keeps_to_the_task():
    tour = tour_of(Commands(lin_vel_x=(0, 2), lin_vel_y=(0, 0), ang_vel_yaw=(-1, 1)))
    np.testing.assert_allclose(tour, [[1.5, 0, 0], [1.5, 0, 0.75], [0, 0, 0], [0, 0, -0.75]])


def test_on_a_plane_robots_go_through_a_tour_together(run_of):
    parts = []
    done = play(run_of(), Asked(seconds=0.8), progress=parts.append)
    assert len(parts) == 40
    assert parts[-1] == 1
    assert done.evaluation.whole.robots == 9
    film = done.film
    assert film.poses.shape == (20, 9, 19)
    assert film.fps == 25
    (shot,) = film.shots
    assert (shot.robot, shot.start, shot.stop) == (4, 0, 20)
    assert len(shot.captions) == len(film) == 20
    told = list(dict.fromkeys(shot.captions))
    assert told[0] == "forward 0.75 m/s"
    assert told[1] == "forward 0.75 m/s, turning left 0.75 rad/s"
    assert len(told) == 4


def test_a_command_goes_before_the_tour(run_of):
    asked = Asked(seconds=0.04, num_envs=1, command=(-0.5, -0.25, 0))
    film = play(run_of(), asked).film
    assert film.shots[0].captions == ("backward 0.5 m/s, right 0.25 m/s",)
    film = play(run_of(), Asked(seconds=0.04, num_envs=1, command=(0, 0, 0))).film
    assert film.shots[0].captions == ("standing",)


def test_robots_on_a_plane_start_in_formation_looking_ahead(marching):
    recorder = Recorder(marching)
    recorder.record()
    (poses,) = recorder._poses
    assert np.ptp(marching.physics.qpos[:, 3]) > 0.01  # they really look all over
    np.testing.assert_allclose(yaw_of(poses[:, 3:7]), 0, atol=1e-5)
    x, y = poses[:, 0].reshape(2, 2), poses[:, 1].reshape(2, 2)
    assert np.ptp(x, axis=1).max() < 1e-5
    assert np.ptp(y, axis=0).max() < 1e-5
    assert x[0, 0] - x[1, 0] == pytest.approx(y[0, 1] - y[0, 0], abs=1e-5)
    assert x[0, 0] - x[1, 0] > 0.5
    np.testing.assert_allclose(poses[:, 7:], marching.physics.qpos[:, 7:], atol=1e-6)


def test_a_way_ahead_is_seen_as_one_along_x(marching):
    recorder = Recorder(marching)
    recorder.record()
    before = recorder._poses[0]
    yaw = yaw_of(marching.physics.qpos[:, 3:7].astype(np.float32))
    marching.physics.qpos[:, 0] += np.cos(yaw)
    marching.physics.qpos[:, 1] += np.sin(yaw)
    marching.steps[:] = 1
    recorder._steps = recorder._stride
    recorder.record()
    way = recorder._poses[1][:, :3] - before[:, :3]
    np.testing.assert_allclose(way, np.tile([1, 0, 0], (4, 1)), atol=1e-5)


def test_who_falls_on_a_plane_goes_back_to_his_place(marching):
    recorder = Recorder(marching)
    recorder.record()
    marching.begin_all()
    recorder._steps = recorder._stride
    recorder.record()
    np.testing.assert_allclose(recorder._poses[1][:, :2], recorder._poses[0][:, :2], atol=1e-5)
    np.testing.assert_allclose(yaw_of(recorder._poses[1][:, 3:7]), 0, atol=1e-5)


def test_on_a_map_different_terrains_are_visited(run_of, mixed_map, tmp_path):
    path = mixed_map.save(tmp_path / "map.npz")
    done = play(run_of(path), Asked(seconds=0.8), robots=2, size=(128, 72))
    film = done.film
    assert done.evaluation.whole.robots == 6  # one on each patch
    assert film.poses.shape[:2] == (20, 6)
    assert film.size == (128, 72)
    assert [shot.captions[0] for shot in film.shots] == [
        "stairs, level 1 of 2",
        "rough_slope, level 1 of 2",
    ]
    assert [(shot.start, shot.stop) for shot in film.shots] == [(0, 10), (0, 10)]


def test_a_shot_ends_when_its_robot_falls(quadruped, calm, map_ground):
    env = LeggedEnv(calm(4), quadruped, map_ground)
    recorder = Recorder(env)
    for step in range(20):
        env.step(torch.zeros(4, 12))
        if step == 11:
            env.steps[1] = 0  # as after a new start
        recorder.record()
    film = recorder.film(4, (128, 72))
    assert {shot.robot: shot.stop for shot in film.shots} == {0: 2, 1: 2, 2: 2, 3: 2}
    assert recorder._visit(1, 10).stop == 6
    assert recorder._visit(0, 10).stop == 10


def test_visits_are_of_all_terrains_before_a_second_of_any(quadruped, calm, map_ground):
    env = LeggedEnv(calm(12), quadruped, map_ground)
    env.careers.levels[:], env.careers.columns[:] = np.divmod(np.arange(12) % 6, 2)
    chosen = visited(env, 3)
    assert env.careers.columns[chosen].tolist() == [0, 1, 0]
    assert env.careers.levels[chosen].tolist() == [1, 1, 1]
    assert visited(env, 1) == chosen[:1]
    assert len(set(visited(env, 100))) == 12


def test_on_a_map_of_mixed_columns_the_terrain_below_is_told(quadruped, calm, map_ground):
    ground = copy.copy(map_ground)
    ground.terrain_names = np.array([["a", "b"], ["b", "c"], ["c", "a"]])
    env = LeggedEnv(calm(6), quadruped, ground)
    env.careers.levels[:], env.careers.columns[:] = np.divmod(np.arange(6), 2)
    recorder = Recorder(env)
    recorder.record()
    film = recorder.film(3, (128, 72))
    told = [shot.captions[0] for shot in film.shots]
    assert told == ["a, level 0 of 2", "b, level 1 of 2", "c, level 1 of 2"]


def test_without_a_film_nothing_is_recorded(run_of):
    done = play(run_of(), Asked(seconds=0.04, num_envs=1), filmed=False)
    assert done.film is None
    assert done.evaluation.whole.falls == 0


def test_no_robots_to_follow_are_an_error(run_of):
    with pytest.raises(ConfigError, match="robots is 0; wanted 1 or more"):
        play(run_of(), robots=0)


def test_no_viewer_without_a_display(run_of, monkeypatch):
    monkeypatch.setattr(playing.sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(ConfigError, match="--viewer needs a display"):
        view(run_of())


def test_the_viewer_shows_a_robot_until_it_is_closed(run_of, monkeypatch):
    mujoco = pytest.importorskip("mujoco")
    shown = []

    class Window:
        cam = SimpleNamespace(type=None, trackbodyid=None)

        def __init__(self, _, data):
            self.data = data

        def __enter__(self):
            return self

        def __exit__(self, *_):
            return None

        def lock(self):
            return nullcontext()

        def is_running(self):
            return len(shown) < 3

        def sync(self):
            shown.append(self.data.qpos.copy())

    monkeypatch.setenv("DISPLAY", ":0")
    viewer = SimpleNamespace(launch_passive=Window)
    monkeypatch.setitem(playing.sys.modules, "mujoco.viewer", viewer)
    monkeypatch.setattr(mujoco, "viewer", viewer, raising=False)
    view(run_of(env=Env(num_threads=1)), Asked(seconds=0.04))
    assert len(shown) == 3
    assert not np.array_equal(shown[0], shown[2])
    assert Window.cam.trackbodyid == 1


def test_a_task_with_one_terrain_tells_no_level(quadruped, calm):
    env = LeggedEnv(calm(1), quadruped, OneOrigin())
    recorder = Recorder(env)
    recorder.record()
    assert recorder.film(3, (128, 72)).shots[0].captions == ("plane",)


class OneOrigin(Plane):
    """A ground that is not known to be level."""

    level = False

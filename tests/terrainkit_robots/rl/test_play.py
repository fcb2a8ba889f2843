from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from terrainkit.errors import ConfigError
from terrainkit_robots.policy import play as playing
from terrainkit_robots.policy.evaluate import Asked
from terrainkit_robots.policy.play import play, tour_of, view
from terrainkit_robots.rl.config import Commands, Env, Terrain


@pytest.fixture(autouse=True)
def still(monkeypatch):
    """Let every policy stand still."""

    def policy(_, env):
        return lambda _: torch.zeros(env.num_envs, env.num_actions)

    monkeypatch.setattr(playing, "policy_of", policy)


def test_the_tour_keeps_to_the_task():
    tour = tour_of(Commands(lin_vel_x=(0, 2), lin_vel_y=(0, 0), ang_vel_yaw=(-1, 1)))
    np.testing.assert_allclose(tour, [[1.5, 0, 0], [1.5, 0, 0.75], [0, 0, 0], [0, 0, -0.75]])


@pytest.mark.parametrize("flat", [False, True])
def test_on_a_plane_robots_go_through_a_tour_together(run_of, map_file, flat):
    parts = []
    run = run_of(map_file, terrain=Terrain(collision="plane")) if flat else run_of()
    done = play(run, Asked(seconds=0.8), progress=parts.append)
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

import copy

import numpy as np
import pytest
import torch

from terrainkit_robots.policy.recorder import Recorder, visited
from terrainkit_robots.rl.config import InitState
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.transforms import quat_to_yaw


@pytest.fixture
def marching(quadruped, calm):
    start = InitState(reset_range=(1.0, 1.0), lin_vel=0.0, ang_vel=0.0)  # any place, any heading
    return LeggedEnv(calm(4, init_state=start), quadruped, Plane())


def test_robots_on_a_plane_start_in_formation_looking_ahead(marching):
    recorder = Recorder(marching)
    recorder.record()
    (poses,) = recorder._poses
    assert np.ptp(marching.physics.qpos[:, 3]) > 0.01  # they really look all over
    np.testing.assert_allclose(quat_to_yaw(poses[:, 3:7]), 0, atol=1e-5)
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
    yaw = quat_to_yaw(marching.physics.qpos[:, 3:7].astype(np.float32))
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
    marching.reset()
    recorder._steps = recorder._stride
    recorder.record()
    np.testing.assert_allclose(recorder._poses[1][:, :2], recorder._poses[0][:, :2], atol=1e-5)
    np.testing.assert_allclose(quat_to_yaw(recorder._poses[1][:, 3:7]), 0, atol=1e-5)


def test_a_shot_ends_when_its_robot_falls(quadruped, calm, map_ground):
    env = LeggedEnv(calm(4), quadruped, map_ground)
    recorder = Recorder(env)
    for step in range(20):
        env.step(torch.zeros(4, 12))
        if step == 11:
            env.steps_since_reset[1] = 0  # as after a new start
        recorder.record()
    film = recorder.film(4, (128, 72))
    assert {shot.robot: shot.stop for shot in film.shots} == {0: 2, 1: 2, 2: 2, 3: 2}
    assert recorder._visit(1, 10).stop == 6
    assert recorder._visit(0, 10).stop == 10


def test_visits_are_of_all_terrains_before_a_second_of_any(quadruped, calm, map_ground):
    env = LeggedEnv(calm(12), quadruped, map_ground)
    env.curriculum.levels[:], env.curriculum.columns[:] = np.divmod(np.arange(12) % 6, 2)
    chosen = visited(env, 3)
    assert env.curriculum.columns[chosen].tolist() == [0, 1, 0]
    assert env.curriculum.levels[chosen].tolist() == [1, 1, 1]
    assert visited(env, 1) == chosen[:1]
    assert len(set(visited(env, 100))) == 12


def test_on_a_map_of_mixed_columns_the_terrain_below_is_told(quadruped, calm, map_ground):
    ground = copy.copy(map_ground)
    ground.terrain_names = np.array([["a", "b"], ["b", "c"], ["c", "a"]])
    env = LeggedEnv(calm(6), quadruped, ground)
    env.curriculum.levels[:], env.curriculum.columns[:] = np.divmod(np.arange(6), 2)
    recorder = Recorder(env)
    recorder.record()
    film = recorder.film(3, (128, 72))
    told = [shot.captions[0] for shot in film.shots]
    assert told == ["a, level 0 of 2", "b, level 1 of 2", "c, level 1 of 2"]


def test_a_task_with_one_terrain_tells_no_level(quadruped, calm):
    env = LeggedEnv(calm(1), quadruped, OneOrigin())
    recorder = Recorder(env)
    recorder.record()
    assert recorder.film(3, (128, 72)).shots[0].captions == ("plane",)


class OneOrigin(Plane):
    """A ground that is not known to be level."""

    level = False

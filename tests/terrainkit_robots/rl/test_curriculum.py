"""The terrain curriculum in training; tests/terrainkit/curriculum has its rules."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from terrainkit.errors import ConfigError
from terrainkit_robots.description import bundled
from terrainkit_robots.rl.config import Commands, DomainRand, Env, InitState, Task, Terrain
from terrainkit_robots.rl.curriculum import TerrainCurriculum
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.spec.robot import Robot

torch.set_num_threads(1)


class Patches(Plane):
    """A plane that is divided into patches of 8 m."""

    is_flat = False

    def __init__(self, rows: int = 10, names: tuple[str, ...] = ("flat", "rough")) -> None:
        self.spawns = np.zeros((rows, len(names), 1, 4), np.float32)
        self.env_origins = self.spawns[:, :, 0, :3]
        self.env_origins[..., 0] = 8 * np.arange(rows)[:, None] + 4
        self.env_origins[..., 1] = 8 * np.arange(len(names)) + 4
        self.terrain_names = np.tile(np.array(names), (rows, 1))


def make(terrain: Plane | None = None, num_envs: int = 4, **options: Any) -> TerrainCurriculum:
    return TerrainCurriculum(terrain or Patches(), num_envs, Terrain(**options), seed=1)


def test_robots_of_a_patch_have_different_spawns() -> None:
    terrain = Patches(rows=2)
    terrain.spawns = np.repeat(terrain.spawns, 3, axis=2)
    terrain.spawns[:, :, :, 0] += [0, 1, 2]
    curriculum = make(terrain, 8, max_init_level=0)
    assert curriculum.env_origins[:, 0].tolist() == [4, 5, 6, 4, 4, 5, 6, 4]
    assert curriculum.env_origins[:, 1].tolist() == [4] * 4 + [12] * 4


def test_initial_levels_fit_the_map() -> None:
    assert set(make(Patches(rows=3), 100, max_init_level=5).levels.tolist()) == {0, 1, 2}


def test_plane_has_one_level() -> None:
    curriculum = make(Plane())
    curriculum.sampler.update(np.arange(4), np.ones(4))
    assert curriculum.levels.tolist() == [0] * 4


@pytest.mark.parametrize(
    ("name", "levels"), [("levels", {1}), ("uniform", set(range(10))), (None, {0})]
)
def test_option_selects_the_sampler(name: Any, levels: set[int]) -> None:
    curriculum = make(num_envs=100, curriculum=name, max_init_level=0)
    curriculum.sampler.update(np.arange(100), np.ones(100))
    assert set(curriculum.levels.tolist()) == levels


class TestLog:
    def test_log_has_values_of_each_terrain(self) -> None:
        curriculum = make()
        curriculum.levels[:] = [2, 3, 9, 7]
        statistics = curriculum.sampler.statistics
        statistics.success[2, 0], statistics.success[3, 0] = 0.5, 0.25
        statistics.returns[3, 0], statistics.visits[2:4, 0] = 12.0, [2, 1]
        assert curriculum.log() == {
            "Curriculum/level": 5.25,
            "Curriculum/level_flat": 2.5,
            "Curriculum/success_flat": 0.375,
            "Curriculum/return_flat": 12,
            "Curriculum/visits_flat": 3,
            "Curriculum/level_rough": 8.0,
            "Curriculum/visits_rough": 0,
        }

    def test_log_combines_patches_of_the_same_terrain(self) -> None:
        terrain = Patches(rows=2)
        terrain.terrain_names = np.array([["flat", "rough"], ["rough", "flat"]])
        curriculum = make(terrain)
        curriculum.levels[:], curriculum.columns[:] = [0, 1, 1, 1], [0, 0, 1, 1]
        curriculum.sampler.statistics.success[:] = [[0.1, 0.2], [0.4, 0.7]]
        log = curriculum.log()
        assert log["Curriculum/level_flat"] == pytest.approx(2 / 3)
        assert log["Curriculum/success_flat"] == pytest.approx(0.4)
        assert log["Curriculum/level_rough"] == 1
        assert log["Curriculum/success_rough"] == pytest.approx(0.3)

    def test_log_leaves_out_levels_without_robots(self) -> None:
        log = make(num_envs=1, max_init_level=0).log()
        assert "Curriculum/level_flat" in log
        assert "Curriculum/level_rough" not in log


class TestCheckpoint:
    def test_state_dict_has_tensors_and_restores(self) -> None:
        curriculum, other = (
            make(curriculum="learning_progress"),
            make(curriculum="learning_progress"),
        )
        curriculum.sampler.update(np.arange(4), np.array([1.0, 0, 0, 1]), np.ones(4))
        state = curriculum.state_dict()
        assert {type(value) for value in state.values()} == {torch.Tensor, int}
        other.sampler.load_state_dict(state)
        assert other.levels.tolist() == curriculum.levels.tolist()
        assert other.columns.tolist() == curriculum.columns.tolist()
        np.testing.assert_array_equal(other.log(), curriculum.log())

    @pytest.mark.parametrize("other", [Patches(rows=9), Patches(names=("flat",))])
    def test_load_rejects_another_map(self, other: Patches) -> None:
        with pytest.raises(ConfigError, match="curriculum: got 10 x 2 patches; expected"):
            make(other).sampler.load_state_dict(make().state_dict())


class TestInEnvironment:
    """The curriculum in an environment whose robots only stand."""

    def make(self, **terrain: Any) -> LeggedEnv:
        task = Task(
            env=Env(num_envs=6, num_threads=1, episode_length_s=0.2),
            terrain=Terrain(measure_heights=False, **terrain),
            commands=Commands(lin_vel_x=(1, 1), lin_vel_y=(0, 0), ang_vel_yaw=(0, 0), standing=0),
            init_state=InitState(lin_vel=0, ang_vel=0, yaw=0),
            domain_rand=DomainRand(push_interval_s=0),
        )
        env = LeggedEnv(
            task, Robot.load(Path(str(bundled.urdf_path("quadruped"))).parent), Patches()
        )
        env.curriculum.levels[:] = 4
        env.reset()
        return env

    def walk(self, env: LeggedEnv, steps: int) -> dict[str, float]:
        extras: dict[str, Any] = {}
        for _ in range(steps):
            *_, extras = env.step(torch.zeros(6, 12))
        log: dict[str, float] = extras.get("log", {})
        return log

    def test_robots_start_at_their_level(self) -> None:
        env = self.make()
        off = env.state.base_pos[:, :2] - env.curriculum.env_origins[:, :2]
        assert np.abs(off).max() <= 0.5
        assert (env.curriculum.env_origins[:, 0] == 36).all()

    def test_commanded_displacement_in_env(self) -> None:
        env = self.make()
        self.walk(env, 5)
        progress = env.curriculum.progress
        np.testing.assert_allclose(progress.target, [[0.1, 0]] * 6, atol=1e-3)
        np.testing.assert_allclose(progress.commanded, 0.1, atol=1e-6)
        moved = env.state.base_pos[:, 0] - env.curriculum.progress.start[:, 0]
        np.testing.assert_allclose(progress.along, moved, atol=1e-3)

    def test_idle_robots_move_down(self) -> None:
        env = self.make()
        self.walk(env, 9)
        assert env.curriculum.levels.tolist() == [4] * 6
        log = self.walk(env, 1)
        assert env.curriculum.levels.tolist() == [3] * 6
        assert log["Curriculum/level"] == log["Curriculum/level_rough"] == 3
        assert log["Curriculum/success_flat"] == 0
        assert (env.curriculum.progress.commanded == 0).all()
        statistics = env.curriculum.sampler.statistics
        assert statistics.visits[4].tolist() == [3, 3]
        assert statistics.returns[4, 0] < 0
        assert log["Curriculum/visits_flat"] == 3
        assert np.abs(env.state.base_pos[:, 0] - 28).max() <= 0.55

    def test_cut_episodes_keep_levels(self) -> None:
        """rsl-rl cuts the first episodes with `init_at_random_ep_len`."""
        env = self.make()
        env.episode_length_buf = torch.tensor([0, 1, 2, 3, 5, 9])
        self.walk(env, 10)
        assert env.curriculum.levels.tolist() == [3, 4, 4, 4, 4, 4]
        # From here on the episodes are complete.
        self.walk(env, 10)
        assert env.curriculum.levels.tolist() == [2, 3, 3, 3, 3, 3]

    def test_crossing_a_patch_moves_up(self) -> None:
        env = self.make()
        env.terrain.patch_length = 0.2
        for _ in range(10):
            env.sim.qpos[2, 0] += 0.015
            env.sim.qpos[3, 1] += 0.015  # to the side
            self.walk(env, 1)
        assert env.curriculum.levels.tolist() == [3, 3, 5, 3, 3, 3]
        assert env.curriculum.sampler.statistics.success[4].tolist() == pytest.approx([1 / 3, 0])

    def test_jump_is_no_progress(self) -> None:
        env = self.make()
        env.sim.qpos[2, 0] += 5
        self.walk(env, 10)
        assert env.curriculum.levels.tolist() == [3] * 6

    def test_leaving_the_map_moves_up(self) -> None:
        """An edge of the map may be closer than half of a patch."""
        env = self.make()
        first = env.curriculum.progress.start[:, 0].argmax()
        env.terrain.upper = (float(env.curriculum.progress.start[first, 0]) + 0.05, np.inf)
        for _ in range(3):
            env.sim.qpos[first, 0] += 0.02
            *_, extras = env.step(torch.zeros(6, 12))
        assert extras["log"]["Episode/falls"] == 1
        assert env.curriculum.levels.tolist() == [4 + (robot == first) for robot in range(6)]

    def test_falls_move_down(self) -> None:
        env = self.make()
        self.walk(env, 2)
        env.sim.qpos[1, 3:7] = (0, 1, 0, 0)
        self.walk(env, 1)
        assert env.curriculum.levels.tolist() == [4, 3, 4, 4, 4, 4]

    def test_levels_are_fixed_without_curriculum(self) -> None:
        env = self.make(curriculum=None)
        log = self.walk(env, 10)
        assert env.curriculum.levels.tolist() == [4] * 6
        assert log["Curriculum/success_flat"] == 0

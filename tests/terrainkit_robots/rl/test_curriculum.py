"""The terrain curriculum in training; tests/terrainkit/curriculum has its rules."""

import copy

import numpy as np
import pytest
import torch

from terrainkit.errors import ConfigError
from terrainkit_robots.checkpoint import save_checkpoint
from terrainkit_robots.rl.config import Commands, Env, InitState, Terrain
from terrainkit_robots.rl.curriculum import TerrainCurriculum
from terrainkit_robots.rl.terrain import Plane
from tests.tables import read_table


class Patches(Plane):
    """A plane that is divided into patches of 8 m."""

    is_plane = False

    def __init__(self, rows=10, names=("flat", "rough")):
        self.spawns = np.zeros((rows, len(names), 1, 4), np.float32)
        self.env_origins = self.spawns[:, :, 0, :3]
        self.env_origins[..., 0] = 8 * np.arange(rows)[:, None] + 4
        self.env_origins[..., 1] = 8 * np.arange(len(names)) + 4
        self.terrain_names = np.tile(np.array(names), (rows, 1))


def make(terrain=None, num_envs=4, **options):
    return TerrainCurriculum(terrain or Patches(), num_envs, Terrain(**options), seed=1)


def test_initial_levels_fit_the_map():
    assert set(make(Patches(rows=3), 100, max_init_level=5).levels.tolist()) == {0, 1, 2}


@pytest.mark.parametrize(
    ("name", "levels"), [("levels", {1}), ("uniform", set(range(10))), (None, {0})]
)
def test_option_selects_the_sampler(name, levels):
    assert make(Plane(), 1, curriculum=name).log()["Curriculum/level"] == 0
    curriculum = make(num_envs=100, curriculum=name, max_init_level=0)
    curriculum.sampler.update(np.arange(100), np.ones(100))
    assert set(curriculum.levels.tolist()) == levels


class TestLog:
    def test_log_has_values_of_each_terrain(self):
        curriculum = make()
        curriculum.levels[:] = [2, 3, 9, 7]
        statistics = curriculum.sampler.statistics
        statistics.success[2, 0], statistics.success[3, 0] = 0.5, 0.25
        statistics.returns[3, 0], statistics.visits[2:4, 0] = 12.0, [2, 1]
        assert curriculum.log() == read_table(__file__, "log_has_values_of_each_terrain")

    def test_log_combines_patches_of_the_same_terrain(self):
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


class TestCheckpoint:
    def test_state_of_a_file_restores_exactly(self, tmp_path):
        one, other = (make(curriculum="learning_progress") for _ in "ab")
        one.sampler.update(np.arange(4), np.array([1.0, 1 / 3, 0, 0.7]), np.full(4, 0.1))
        before = copy.deepcopy(one.sampler.state_dict())
        save_checkpoint(tmp_path / "model_1.pt", one.state_dict())
        other.load_state_dict(torch.load(tmp_path / "model_1.pt", weights_only=True))
        one.sampler.update(np.arange(4), np.ones(4), np.ones(4))  # what is saved is no view
        for name, value in other.sampler.state_dict().items():
            np.testing.assert_array_equal(value, before[name], err_msg=name, strict=True)

    @pytest.mark.parametrize(
        ("other", "expected"), [(Patches(rows=9), "9, 2"), (Patches(names=("flat",)), "10, 1")]
    )
    def test_load_rejects_another_map(self, other, expected):
        message = rf"curriculum\.visits: got float64 \(10, 2\); expected float64 \({expected}\)"
        with pytest.raises(ConfigError, match=message):
            make(other).load_state_dict(make().state_dict())


class TestInEnvironment:
    """The curriculum in an environment whose robots only stand."""

    @pytest.fixture
    def make_env(self, nominal_env):
        forward = Commands(lin_vel_x=(1, 1), lin_vel_y=(0, 0), ang_vel_yaw=(0, 0), standing=0)

        def make(**terrain):
            env = nominal_env(
                6,
                Patches(),
                env=Env(num_envs=6, num_threads=1, episode_length_s=0.2),
                terrain=Terrain(measure_heights=False, **terrain),
                commands=forward,
                init_state=InitState(lin_vel=0, ang_vel=0, yaw=0),
            )
            env.curriculum.levels[:] = 4
            env.reset()
            return env

        return make

    @pytest.fixture
    def env(self, make_env):
        return make_env()

    def walk(self, env, steps):
        """Return the log of the last step."""
        for _ in range(steps):
            *_, extras = env.step(torch.zeros(6, 12))
        return extras.get("log", {})

    def test_idle_robots_move_down(self, env):
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

    def test_cut_episodes_keep_levels(self, env):
        """rsl-rl cuts the first episodes with `init_at_random_ep_len`."""
        env.episode_length_buf = torch.tensor([0, 1, 2, 3, 5, 9])
        self.walk(env, 10)
        assert env.curriculum.levels.tolist() == [3, 4, 4, 4, 4, 4]
        # From here on the episodes are complete.
        self.walk(env, 10)
        assert env.curriculum.levels.tolist() == [2, 3, 3, 3, 3, 3]

    def test_crossing_a_patch_moves_up(self, env):
        env.terrain.patch_length = 0.2
        for _ in range(10):
            env.sim.qpos[2, 0] += 0.015
            env.sim.qpos[3, 1] += 0.015  # to the side
            self.walk(env, 1)
        assert env.curriculum.levels.tolist() == [3, 3, 5, 3, 3, 3]
        assert env.curriculum.sampler.statistics.success[4].tolist() == pytest.approx([1 / 3, 0])

    def test_leaving_the_map_moves_up(self, env):
        """An edge of the map may be closer than half of a patch."""
        first = env.curriculum.progress.start[:, 0].argmax()
        env.terrain.upper = (float(env.curriculum.progress.start[first, 0]) + 0.05, np.inf)
        for _ in range(3):
            env.sim.qpos[first, 0] += 0.02
            *_, extras = env.step(torch.zeros(6, 12))
        assert extras["log"]["Episode/falls"] == 1
        assert env.curriculum.levels.tolist() == [4 + (robot == first) for robot in range(6)]

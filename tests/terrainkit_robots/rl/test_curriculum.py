"""The terrain curriculum, with simulated skills and in the environment."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit_robots.description import bundled
from terrainkit_robots.rl.commands import VelocityCommand, sample_commands
from terrainkit_robots.rl.config import Commands, DomainRand, Env, InitState, Task, Terrain
from terrainkit_robots.rl.curriculum import TerrainCurriculum
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.spec.robot import Robot

torch.set_num_threads(1)

_STEP = 1.0
"""Time step of the simulated episodes [s]."""


class Patches(Plane):
    """A plane that is divided into patches of 8 m."""

    is_flat = False

    def __init__(self, rows: int = 10, names: tuple[str, ...] = ("flat", "rough")) -> None:
        self.spawns = np.zeros((rows, len(names), 1, 4), np.float32)
        self.env_origins = self.spawns[:, :, 0, :3]
        self.env_origins[..., 0] = 8 * np.arange(rows)[:, None] + 4
        self.env_origins[..., 1] = 8 * np.arange(len(names)) + 4
        self.terrain_names = np.tile(np.array(names), (rows, 1))


def simulate(
    curriculum: TerrainCurriculum,
    skill: NDArray[np.float64],
    episodes: int,
    commands: Commands,
    *,
    noise: float,
) -> None:
    """Simulate episodes of 20 s: robots follow their commands up to the level of their skill.

    Above that level a robot falls at once. Robots walk at nine tenths of the commanded speed.
    """
    n, rng = len(skill), np.random.default_rng(7)
    steering = VelocityCommand(commands, n, 1.0, heading_command=True)
    everyone = np.arange(n)
    for _ in range(episodes):
        curriculum.reset(everyone)
        fails = curriculum.levels > skill + rng.normal(0, noise, n)
        pos, yaw = np.zeros((n, 2)), rng.uniform(-np.pi, np.pi, n).astype(np.float32)
        for step in range(20):
            if step % 10 == 0:
                command, heading = sample_commands(rng, n, commands)
            if commands.heading_command:
                steering.heading, steering.commands = heading, command
                steering.update_heading(yaw)
            curriculum.accumulate_command(command, yaw, _STEP)
            c, s = np.cos(yaw), np.sin(yaw)
            pos[:, 0] += 0.9 * _STEP * (c * command[:, 0] - s * command[:, 1])
            pos[:, 1] += 0.9 * _STEP * (s * command[:, 0] + c * command[:, 1])
            yaw += np.float32(_STEP) * command[:, 2]
        distance = np.where(fails, 0.1, np.linalg.norm(pos, axis=1))
        curriculum.on_episode_end(everyone, distance, fails, update_levels=True)


def walk(curriculum: TerrainCurriculum, forward: float, seconds: float) -> None:
    """Command every robot to walk along x."""
    n = len(curriculum.levels)
    command = np.tile(np.array([forward, 0, 0], np.float32), (n, 1))
    for _ in range(round(seconds / _STEP)):
        curriculum.accumulate_command(command, np.zeros(n, np.float32), _STEP)


def end_all(curriculum: TerrainCurriculum, distance: float, *, fallen: bool = False) -> None:
    n = len(curriculum.levels)
    curriculum.on_episode_end(
        np.arange(n), np.full(n, distance), np.full(n, fallen), update_levels=True
    )


@pytest.fixture
def curriculum() -> TerrainCurriculum:
    """Return the curriculum of four robots at level 4 of 10, with patches of 8 m."""
    made = TerrainCurriculum(Patches(), 4, 5, 1)
    made.levels[:] = 4
    return made


class TestConvergence:
    @pytest.mark.parametrize("heading", [False, True])
    @pytest.mark.parametrize("skill", [2, 5, 7])
    def test_levels_converge_to_skill(self, skill: int, *, heading: bool) -> None:
        curriculum = TerrainCurriculum(Patches(), 100, 5, 1)
        simulate(
            curriculum, np.full(100, skill + 0.5), 60, Commands(heading_command=heading), noise=0.5
        )
        assert curriculum.levels.mean() == pytest.approx(skill, abs=0.75)
        assert curriculum.levels.std() < 1.5

    def test_robots_converge_independently(self) -> None:
        curriculum = TerrainCurriculum(Patches(), 200, 5, 1)
        skill = np.repeat([1.5, 6.5], 100)
        simulate(curriculum, skill, 80, Commands(), noise=0.5)
        assert curriculum.levels[:100].mean() == pytest.approx(1, abs=0.75)
        assert curriculum.levels[100:].mean() == pytest.approx(6, abs=0.75)

    def test_perfect_robots_stay_in_top_rows(self) -> None:
        curriculum = TerrainCurriculum(Patches(), 100, 5, 1)
        simulate(curriculum, np.full(100, np.inf), 60, Commands(), noise=0.5)
        assert set(curriculum.levels) == {7, 8, 9}
        before = curriculum.levels.copy()
        simulate(curriculum, np.full(100, np.inf), 5, Commands(), noise=0.5)
        assert curriculum.levels.min() >= 7
        assert (curriculum.levels != before).any()

    def test_failing_robots_reach_first_row(self) -> None:
        curriculum = TerrainCurriculum(Patches(), 100, 5, 1)
        simulate(curriculum, np.full(100, -np.inf), 10, Commands(), noise=0.5)
        assert set(curriculum.levels) == {0}

    def test_same_seed_gives_same_levels(self) -> None:
        levels = []
        for _ in range(2):
            curriculum = TerrainCurriculum(Patches(), 50, 5, 3)
            simulate(curriculum, np.full(50, np.inf), 40, Commands(), noise=0.5)
            levels.append(curriculum.levels)
        np.testing.assert_array_equal(*levels)

    def test_columns_never_change(self) -> None:
        curriculum = TerrainCurriculum(Patches(), 10, 5, 1)
        assert curriculum.columns.tolist() == [0] * 5 + [1] * 5
        simulate(curriculum, np.full(10, 3.0), 10, Commands(), noise=0.5)
        assert curriculum.columns.tolist() == [0] * 5 + [1] * 5
        np.testing.assert_array_equal(curriculum.env_origins[:, 0], 8 * curriculum.levels + 4)


def test_robots_of_a_patch_have_different_spawns() -> None:
    terrain = Patches(rows=2)
    terrain.spawns = np.repeat(terrain.spawns, 3, axis=2)
    terrain.spawns[:, :, :, 0] += [0, 1, 2]
    curriculum = TerrainCurriculum(terrain, 8, 0, seed=0)
    assert curriculum.env_origins[:, 0].tolist() == [4, 5, 6, 4, 4, 5, 6, 4]
    assert curriculum.env_origins[:, 1].tolist() == [4] * 4 + [12] * 4


class TestOnEpisodeEnd:
    """Robots move up after 4 m, and stay with half of the commanded distance."""

    @pytest.mark.parametrize(
        ("commanded", "distance", "fallen", "level"),
        [
            (10.0, 4.5, False, 5),  # crossed
            (10.0, 3.9, False, 3),  # less than half of the command
            (7.0, 3.6, False, 4),  # more than half of it
            (1.0, 0.1, False, 3),
            (1.0, 0.6, False, 4),
            (1.0, 0.9, True, 3),  # far enough, but fallen
            (10.0, 4.5, True, 5),  # fell after it had crossed
        ],
    )
    def test_level_change(
        self,
        curriculum: TerrainCurriculum,
        commanded: float,
        distance: float,
        *,
        fallen: bool,
        level: int,
    ) -> None:
        walk(curriculum, commanded / 10, 10)
        end_all(curriculum, distance, fallen=fallen)
        assert curriculum.levels.tolist() == [level] * 4

    def test_standing_command_keeps_level(self, curriculum: TerrainCurriculum) -> None:
        walk(curriculum, 0.0, 20)
        end_all(curriculum, 0.02)
        assert curriculum.levels.tolist() == [4] * 4

    def test_fall_while_standing_moves_down(self, curriculum: TerrainCurriculum) -> None:
        walk(curriculum, 0.0, 20)
        end_all(curriculum, 0.02, fallen=True)
        assert curriculum.levels.tolist() == [3] * 4

    def test_only_elapsed_time_counts(self, curriculum: TerrainCurriculum) -> None:
        """A command of 1 m/s for 2 s counts as 2 m, not as the 20 m of a full episode."""
        walk(curriculum, 1.0, 2)
        end_all(curriculum, 1.8)
        assert curriculum.levels.tolist() == [4] * 4

    def test_changing_commands_are_integrated(self, curriculum: TerrainCurriculum) -> None:
        """Forward and back: the commanded displacement is 0."""
        walk(curriculum, 1.0, 10)
        walk(curriculum, -1.0, 10)
        end_all(curriculum, 0.2)
        assert curriculum.levels.tolist() == [4] * 4

    def test_commands_are_in_the_base_frame(self, curriculum: TerrainCurriculum) -> None:
        yaw = np.array([0, np.pi / 2, np.pi, -np.pi / 2], np.float32)
        curriculum.accumulate_command(
            np.tile(np.array([1, 0.5, 0.3], np.float32), (4, 1)), yaw, 2.0
        )
        expected = [[2, 1], [-1, 2], [-2, -1], [1, -2]]
        np.testing.assert_allclose(curriculum.commanded, expected, atol=1e-6)

    def test_reset_clears_displacement(self, curriculum: TerrainCurriculum) -> None:
        walk(curriculum, 1.0, 10)
        curriculum.reset(np.array([1, 3]))
        assert curriculum.commanded[:, 0].tolist() == [10, 0, 10, 0]

    def test_only_ended_episodes_change_level(self, curriculum: TerrainCurriculum) -> None:
        curriculum.on_episode_end(
            np.array([2]), np.array([5.0]), np.array([False]), update_levels=True
        )
        assert curriculum.levels.tolist() == [4, 4, 5, 4]

    def test_fixed_levels_still_record_success(self, curriculum: TerrainCurriculum) -> None:
        curriculum.on_episode_end(
            np.array([2]), np.array([5.0]), np.array([False]), update_levels=False
        )
        assert curriculum.levels.tolist() == [4] * 4
        assert curriculum.success[4, 1] == 1

    def test_no_ended_episodes(self, curriculum: TerrainCurriculum) -> None:
        curriculum.on_episode_end(np.arange(0), np.zeros(0), np.zeros(0, bool), update_levels=True)
        assert curriculum.levels.tolist() == [4] * 4

    def test_one_row_has_no_levels(self) -> None:
        curriculum = TerrainCurriculum(Plane(), 3, 5, 1)
        end_all(curriculum, 100.0)
        assert curriculum.levels.tolist() == [0] * 3


class TestSuccess:
    def test_success_by_level_and_column(self, curriculum: TerrainCurriculum) -> None:
        curriculum.levels[:] = [0, 0, 4, 9]
        assert np.isnan(curriculum.success).all()
        fallen = np.array([True, False, False, False])
        curriculum.on_episode_end(
            np.arange(4), np.full(4, 5.0) * ~fallen, fallen, update_levels=False
        )
        # Of the two robots at level 0, the first fell; the second has the weight 0.05.
        assert curriculum.success[0, 0] == pytest.approx(0.05)
        assert curriculum.success[4, 1] == curriculum.success[9, 1] == 1
        assert np.isnan(curriculum.success).sum() == 20 - 3

    def test_success_is_a_running_mean(self, curriculum: TerrainCurriculum) -> None:
        rng = np.random.default_rng(0)
        for chance in (0.2, 0.8):
            rates = []
            for _ in range(400):
                fallen = np.array([rng.random() > chance])
                curriculum.on_episode_end(np.array([0]), np.zeros(1), fallen, update_levels=False)
                rates.append(curriculum.success[4, 0])
            assert np.mean(rates[100:]) == pytest.approx(chance, abs=0.05)

    def test_log_has_level_and_success_of_each_terrain(self, curriculum: TerrainCurriculum) -> None:
        curriculum.levels[:] = [2, 3, 9, 7]
        curriculum.success[2, 0], curriculum.success[3, 0] = 0.5, 0.25
        assert curriculum.log() == {
            "Curriculum/level": 5.25,
            "Curriculum/level_flat": 2.5,
            "Curriculum/success_flat": 0.375,
            "Curriculum/level_rough": 8.0,
        }

    def test_log_combines_columns_of_the_same_terrain(self) -> None:
        curriculum = TerrainCurriculum(Patches(names=("flat", "steps", "flat")), 3, 0, 1)
        curriculum.levels[:] = [1, 5, 3]
        assert curriculum.log() == {
            "Curriculum/level": 3,
            "Curriculum/level_flat": 2,
            "Curriculum/level_steps": 5,
        }

    def test_log_combines_patches_of_the_same_terrain(self) -> None:
        terrain = Patches(rows=2)
        terrain.terrain_names = np.array([["flat", "rough"], ["rough", "flat"]])
        curriculum = TerrainCurriculum(terrain, 4, 0, 1)
        curriculum.levels[:], curriculum.columns[:] = [0, 1, 1, 1], [0, 0, 1, 1]
        curriculum.success[:] = [[0.1, 0.2], [0.4, 0.7]]
        assert curriculum.log() == {
            "Curriculum/level": 0.75,
            "Curriculum/level_flat": pytest.approx(2 / 3),
            "Curriculum/success_flat": pytest.approx(0.4),
            "Curriculum/level_rough": 1,
            "Curriculum/success_rough": pytest.approx(0.3),
        }

    def test_log_leaves_out_terrain_without_robots(self) -> None:
        curriculum = TerrainCurriculum(Patches(), 1, 0, 1)
        assert curriculum.log() == {"Curriculum/level": 0, "Curriculum/level_flat": 0}


class TestCheckpoint:
    def test_resume_is_exact(self) -> None:
        whole, first = (TerrainCurriculum(Patches(), 20, 5, 1) for _ in range(2))
        skill = np.full(20, np.inf)
        for each in (whole, first):
            simulate(each, skill, 30, Commands(), noise=0.5)
        other = TerrainCurriculum(Patches(), 20, 5, 99)
        other._seed = 1
        other.load_state_dict(first.state_dict())
        for each in (whole, other):
            simulate(each, skill, 10, Commands(), noise=0.5)
        np.testing.assert_array_equal(other.levels, whole.levels)
        np.testing.assert_array_equal(other.columns, whole.columns)
        np.testing.assert_array_equal(other.commanded, whole.commanded)
        np.testing.assert_array_equal(other.success, whole.success)

    def test_state_dict_is_a_copy(self, curriculum: TerrainCurriculum) -> None:
        state = curriculum.state_dict()
        simulate(curriculum, np.full(4, np.inf), 5, Commands(), noise=0.5)
        assert state["levels"].tolist() == [4] * 4
        assert np.isnan(np.asarray(state["success"])).all()

    @pytest.mark.parametrize("n", [2, 6, 30])
    def test_other_num_envs_keeps_levels_by_column(self, n: int) -> None:
        before = TerrainCurriculum(Patches(), 10, 5, 1)
        before.levels[:5], before.levels[5:] = 2, 8
        before.success[3, 1] = 0.5
        curriculum = TerrainCurriculum(Patches(), n, 5, 1)
        curriculum.load_state_dict(before.state_dict())
        assert len(curriculum.levels) == n
        assert set(curriculum.levels[curriculum.columns == 0]) == {2}
        assert set(curriculum.levels[curriculum.columns == 1]) == {8}
        assert curriculum.success[3, 1] == 0.5

    def test_other_num_envs_keeps_mean_level(self) -> None:
        before = TerrainCurriculum(Patches(), 100, 5, 1)
        before.levels[:] = np.random.default_rng(0).integers(0, 10, 100)
        curriculum = TerrainCurriculum(Patches(), 200, 5, 1)
        curriculum.load_state_dict(before.state_dict())
        assert curriculum.levels.mean() == pytest.approx(before.levels.mean(), abs=0.01)

    @pytest.mark.parametrize("other", [Patches(rows=9), Patches(names=("flat",))])
    def test_load_rejects_another_map(self, other: Patches) -> None:
        state = TerrainCurriculum(Patches(), 4, 5, 1).state_dict()
        curriculum = TerrainCurriculum(other, 4, 5, 1)
        with pytest.raises(ConfigError, match="checkpoint's map has 10 x 2 patches; this one has"):
            curriculum.load_state_dict(state)


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
        np.testing.assert_allclose(env.curriculum.commanded[:, 0], 0.1, atol=0.005)

    def test_idle_robots_move_down(self) -> None:
        env = self.make()
        self.walk(env, 9)
        assert env.curriculum.levels.tolist() == [4] * 6
        log = self.walk(env, 1)
        assert env.curriculum.levels.tolist() == [3] * 6
        assert log["Curriculum/level"] == log["Curriculum/level_rough"] == 3
        assert log["Curriculum/success_flat"] == 0
        assert (env.curriculum.commanded == 0).all()
        assert np.abs(env.state.base_pos[:, 0] - 28).max() <= 0.55

    def test_first_reset_keeps_levels(self) -> None:
        env = self.make()
        assert np.isnan(env.curriculum.success).all()
        assert env.curriculum.levels.tolist() == [4] * 6

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
        env.sim.qpos[2, 0] += 5
        self.walk(env, 10)
        assert env.curriculum.levels.tolist() == [3, 3, 5, 3, 3, 3]

    def test_leaving_the_map_moves_up(self) -> None:
        """The side of a narrow patch is closer than half of its length."""
        env = self.make()
        env.terrain.lower = (-np.inf, 2.0)
        env.sim.qpos[1, 1] -= 2.9
        *_, extras = env.step(torch.zeros(6, 12))
        assert extras["log"]["Episode/falls"] == 1
        assert env.curriculum.levels.tolist() == [4, 5, 4, 4, 4, 4]
        assert env.curriculum.success[4, 0] == 1

    def test_falls_move_down(self) -> None:
        env = self.make()
        self.walk(env, 2)
        env.sim.qpos[1, 3:7] = (0, 1, 0, 0)
        self.walk(env, 1)
        assert env.curriculum.levels.tolist() == [4, 3, 4, 4, 4, 4]

    def test_levels_are_fixed_without_curriculum(self) -> None:
        env = self.make(curriculum=False)
        log = self.walk(env, 10)
        assert env.curriculum.levels.tolist() == [4] * 6
        assert log["Curriculum/success_flat"] == 0

    def test_max_init_level_is_respected(self) -> None:
        assert set(TerrainCurriculum(Patches(), 500, 2, 1).levels) == {0, 1, 2}
        assert set(TerrainCurriculum(Patches(rows=3), 500, 5, 1).levels) == {0, 1, 2}


def test_levels_follow_the_share_of_goals(curriculum: TerrainCurriculum) -> None:
    """As the thresholds of Extreme Parkour: 0.8 up, 0.4 down. Without goals, distance counts."""
    curriculum.on_episode_end(
        np.arange(4),
        np.full(4, 0.0),
        np.array([False, True, False, False]),
        update_levels=True,
        progress=np.array([0.8, 0.6, 0.2, np.nan]),
    )
    assert curriculum.levels.tolist() == [5, 4, 3, 4]
    assert curriculum.success[4].tolist() == pytest.approx([0.95, 0.05])

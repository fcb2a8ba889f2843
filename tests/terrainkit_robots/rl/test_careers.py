"""The careers: simulated robots end on the ground that suits them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit_robots.description import bundled
from terrainkit_robots.rl.careers import Careers
from terrainkit_robots.rl.commands import draw_commands, turning_to
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.ground import Plane
from terrainkit_robots.rl.robot import read_robot
from terrainkit_robots.rl.task import Commands, DomainRand, Env, InitState, Task, Terrain

torch.set_num_threads(1)

_STEP = 1.0
"""Time step of the simulated walks [s]."""


class Patches(Plane):
    """A plane that counts as a map of patches, 8 m long."""

    level = False

    def __init__(self, rows: int = 10, names: tuple[str, ...] = ("flat", "rough")) -> None:
        self.env_origins = np.zeros((rows, len(names), 3), np.float32)
        self.env_origins[..., 0] = 8 * np.arange(rows)[:, None] + 4
        self.env_origins[..., 1] = 8 * np.arange(len(names)) + 4
        self.terrain_names = np.tile(np.array(names), (rows, 1))


def live(
    careers: Careers, skill: NDArray[np.float64], episodes: int, commands: Commands, *, noise: float
) -> None:
    """Let robots live episodes of 20 s: each follows its commands up to the level of its skill.

    On harder ground a robot falls in place. It follows at nine tenths of the speed asked for.
    """
    n, rng = len(skill), np.random.default_rng(7)
    everyone = np.arange(n)
    for _ in range(episodes):
        careers.begin(everyone)
        fails = careers.levels > skill + rng.normal(0, noise, n)
        pos, yaw = np.zeros((n, 2)), rng.uniform(-np.pi, np.pi, n).astype(np.float32)
        for step in range(20):
            if step % 10 == 0:
                wanted, heading = draw_commands(rng, n, commands, commands.lin_vel_x)
            if commands.heading_command:
                wanted[:, 2] = turning_to(heading, yaw, commands)
            careers.ask(wanted, yaw, _STEP)
            c, s = np.cos(yaw), np.sin(yaw)
            pos[:, 0] += 0.9 * _STEP * (c * wanted[:, 0] - s * wanted[:, 1])
            pos[:, 1] += 0.9 * _STEP * (s * wanted[:, 0] + c * wanted[:, 1])
            yaw += np.float32(_STEP) * wanted[:, 2]
        distance = np.where(fails, 0.1, np.linalg.norm(pos, axis=1))
        careers.end(everyone, distance, fails, move=True)


def walk(careers: Careers, forward: float, seconds: float) -> None:
    """Ask every robot to go east."""
    n = len(careers.levels)
    wanted = np.tile(np.array([forward, 0, 0], np.float32), (n, 1))
    for _ in range(round(seconds / _STEP)):
        careers.ask(wanted, np.zeros(n, np.float32), _STEP)


def end_all(careers: Careers, distance: float, *, fallen: bool = False) -> None:
    n = len(careers.levels)
    careers.end(np.arange(n), np.full(n, distance), np.full(n, fallen), move=True)


@pytest.fixture
def careers() -> Careers:
    """Four robots at level 4 of 10, on a patch 8 m long."""
    made = Careers(Patches(), 4, 5, 1)
    made.levels[:] = 4
    return made


class TestConvergence:
    @pytest.mark.parametrize("heading", [False, True])
    @pytest.mark.parametrize("skill", [2, 5, 7])
    def test_to_the_level_of_skill(self, skill: int, *, heading: bool) -> None:
        careers = Careers(Patches(), 100, 5, 1)
        live(careers, np.full(100, skill + 0.5), 60, Commands(heading_command=heading), noise=0.5)
        assert careers.levels.mean() == pytest.approx(skill, abs=0.75)
        assert careers.levels.std() < 1.5

    def test_of_each_for_itself(self) -> None:
        careers = Careers(Patches(), 200, 5, 1)
        skill = np.repeat([1.5, 6.5], 100)
        live(careers, skill, 80, Commands(), noise=0.5)
        assert careers.levels[:100].mean() == pytest.approx(1, abs=0.75)
        assert careers.levels[100:].mean() == pytest.approx(6, abs=0.75)

    def test_of_the_perfect_to_the_top_three_rows(self) -> None:
        careers = Careers(Patches(), 100, 5, 1)
        live(careers, np.full(100, np.inf), 60, Commands(), noise=0.5)
        assert set(careers.levels) == {7, 8, 9}
        before = careers.levels.copy()
        live(careers, np.full(100, np.inf), 5, Commands(), noise=0.5)
        assert careers.levels.min() >= 7
        assert (careers.levels != before).any()

    def test_of_the_hopeless_to_the_first_row(self) -> None:
        careers = Careers(Patches(), 100, 5, 1)
        live(careers, np.full(100, -np.inf), 10, Commands(), noise=0.5)
        assert set(careers.levels) == {0}

    def test_of_the_same_seed_is_the_same(self) -> None:
        levels = []
        for _ in range(2):
            careers = Careers(Patches(), 50, 5, 3)
            live(careers, np.full(50, np.inf), 40, Commands(), noise=0.5)
            levels.append(careers.levels)
        np.testing.assert_array_equal(*levels)

    def test_columns_are_kept(self) -> None:
        careers = Careers(Patches(), 10, 5, 1)
        assert careers.columns.tolist() == [0] * 5 + [1] * 5
        live(careers, np.full(10, 3.0), 10, Commands(), noise=0.5)
        assert careers.columns.tolist() == [0] * 5 + [1] * 5
        np.testing.assert_array_equal(careers.origins[:, 0], 8 * careers.levels + 4)


class TestOneEpisode:
    """Half of 8 m is crossed; half of what was asked is enough to stay."""

    @pytest.mark.parametrize(
        ("asked", "distance", "fallen", "level"),
        [
            (10.0, 4.5, False, 5),  # crossed
            (10.0, 3.9, False, 3),  # less than half of what was asked
            (7.0, 3.6, False, 4),  # more than half of it
            (1.0, 0.1, False, 3),
            (1.0, 0.6, False, 4),
            (1.0, 0.9, True, 3),  # as asked, but it fell
            (10.0, 4.5, True, 5),  # fell after it had crossed
        ],
    )
    def test_moves(
        self, careers: Careers, asked: float, distance: float, *, fallen: bool, level: int
    ) -> None:
        walk(careers, asked / 10, 10)
        end_all(careers, distance, fallen=fallen)
        assert careers.levels.tolist() == [level] * 4

    def test_told_to_stand_is_not_moved(self, careers: Careers) -> None:
        walk(careers, 0.0, 20)
        end_all(careers, 0.02)
        assert careers.levels.tolist() == [4] * 4

    def test_told_to_stand_and_fallen_moves_down(self, careers: Careers) -> None:
        walk(careers, 0.0, 20)
        end_all(careers, 0.02, fallen=True)
        assert careers.levels.tolist() == [3] * 4

    def test_only_the_time_lived_counts(self, careers: Careers) -> None:
        """Asked for 1 m/s during 2 s, not during an episode of 20 s."""
        walk(careers, 1.0, 2)
        end_all(careers, 1.8)
        assert careers.levels.tolist() == [4] * 4

    def test_commands_that_change_count_as_they_were(self, careers: Careers) -> None:
        """There and back again: the robot is where it was asked to be."""
        walk(careers, 1.0, 10)
        walk(careers, -1.0, 10)
        end_all(careers, 0.2)
        assert careers.levels.tolist() == [4] * 4

    def test_commands_are_in_the_frame_of_the_robot(self, careers: Careers) -> None:
        yaw = np.array([0, np.pi / 2, np.pi, -np.pi / 2], np.float32)
        careers.ask(np.tile(np.array([1, 0.5, 0.3], np.float32), (4, 1)), yaw, 2.0)
        expected = [[2, 1], [-1, 2], [-2, -1], [1, -2]]
        np.testing.assert_allclose(careers.asked, expected, atol=1e-6)

    def test_new_episode_is_asked_nothing_yet(self, careers: Careers) -> None:
        walk(careers, 1.0, 10)
        careers.begin(np.array([1, 3]))
        assert careers.asked[:, 0].tolist() == [10, 0, 10, 0]

    def test_only_those_that_ended_move(self, careers: Careers) -> None:
        careers.end(np.array([2]), np.array([5.0]), np.array([False]), move=True)
        assert careers.levels.tolist() == [4, 4, 5, 4]

    def test_without_curriculum_nobody_moves_but_all_are_counted(self, careers: Careers) -> None:
        careers.end(np.array([2]), np.array([5.0]), np.array([False]), move=False)
        assert careers.levels.tolist() == [4] * 4
        assert careers.success[4, 1] == 1

    def test_nobody_ended(self, careers: Careers) -> None:
        careers.end(np.arange(0), np.zeros(0), np.zeros(0, bool), move=True)
        assert careers.levels.tolist() == [4] * 4

    def test_one_row_has_no_levels(self) -> None:
        careers = Careers(Plane(), 3, 5, 1)
        end_all(careers, 100.0)
        assert careers.levels.tolist() == [0] * 3


class TestSuccess:
    def test_rates_by_level_and_column(self, careers: Careers) -> None:
        careers.levels[:] = [0, 0, 4, 9]
        assert np.isnan(careers.success).all()
        fallen = np.array([True, False, False, False])
        careers.end(np.arange(4), np.full(4, 5.0) * ~fallen, fallen, move=False)
        # Of the two at level 0 the first fell, and the second weighs a twentieth.
        assert careers.success[0, 0] == pytest.approx(0.05)
        assert careers.success[4, 1] == careers.success[9, 1] == 1
        assert np.isnan(careers.success).sum() == 20 - 3

    def test_rate_is_that_of_late(self, careers: Careers) -> None:
        rng = np.random.default_rng(0)
        for chance in (0.2, 0.8):
            rates = []
            for _ in range(400):
                fallen = np.array([rng.random() > chance])
                careers.end(np.array([0]), np.zeros(1), fallen, move=False)
                rates.append(careers.success[4, 0])
            assert np.mean(rates[100:]) == pytest.approx(chance, abs=0.05)

    def test_by_terrain(self, careers: Careers) -> None:
        careers.levels[:] = [2, 3, 9, 7]
        careers.success[2, 0], careers.success[3, 0] = 0.5, 0.25
        assert careers.by_terrain() == {
            "flat": (2.5, 0.375),
            "rough": (8.0, pytest.approx(np.nan, nan_ok=True)),
        }

    def test_columns_of_the_same_terrain_are_one(self) -> None:
        careers = Careers(Patches(names=("flat", "steps", "flat")), 3, 0, 1)
        careers.levels[:] = [1, 5, 3]
        assert careers.by_terrain()["flat"][0] == 2
        assert list(careers.by_terrain()) == ["flat", "steps"]

    def test_patches_of_the_same_terrain_are_one_wherever_they_are(self) -> None:
        ground = Patches(rows=2)
        ground.terrain_names = np.array([["flat", "rough"], ["rough", "flat"]])
        careers = Careers(ground, 4, 0, 1)
        careers.levels[:], careers.columns[:] = [0, 1, 1, 1], [0, 0, 1, 1]
        careers.success[:] = [[0.1, 0.2], [0.4, 0.7]]
        assert careers.by_terrain() == {
            "flat": (pytest.approx(2 / 3), pytest.approx(0.4)),
            "rough": (1, pytest.approx(0.3)),
        }

    def test_terrain_without_robots(self) -> None:
        careers = Careers(Patches(), 1, 0, 1)
        level, rate = careers.by_terrain()["rough"]
        assert np.isnan(level)
        assert np.isnan(rate)


class TestCheckpoint:
    def test_goes_on_as_if_unbroken(self) -> None:
        whole, first = (Careers(Patches(), 20, 5, 1) for _ in range(2))
        skill = np.full(20, np.inf)
        for each in (whole, first):
            live(each, skill, 30, Commands(), noise=0.5)
        other = Careers(Patches(), 20, 5, 99)
        other._seed = 1
        other.load_state_dict(first.state_dict())
        for each in (whole, other):
            live(each, skill, 10, Commands(), noise=0.5)
        np.testing.assert_array_equal(other.levels, whole.levels)
        np.testing.assert_array_equal(other.columns, whole.columns)
        np.testing.assert_array_equal(other.asked, whole.asked)
        np.testing.assert_array_equal(other.success, whole.success)

    def test_is_a_copy(self, careers: Careers) -> None:
        state = careers.state_dict()
        live(careers, np.full(4, np.inf), 5, Commands(), noise=0.5)
        assert state["levels"].tolist() == [4] * 4
        assert np.isnan(np.asarray(state["success"])).all()

    @pytest.mark.parametrize("n", [2, 6, 30])
    def test_another_number_of_robots_keeps_levels_by_column(self, n: int) -> None:
        before = Careers(Patches(), 10, 5, 1)
        before.levels[:5], before.levels[5:] = 2, 8
        before.success[3, 1] = 0.5
        careers = Careers(Patches(), n, 5, 1)
        careers.load_state_dict(before.state_dict())
        assert len(careers.levels) == n
        assert set(careers.levels[careers.columns == 0]) == {2}
        assert set(careers.levels[careers.columns == 1]) == {8}
        assert careers.success[3, 1] == 0.5

    def test_mean_level_is_about_kept(self) -> None:
        before = Careers(Patches(), 100, 5, 1)
        before.levels[:] = np.random.default_rng(0).integers(0, 10, 100)
        careers = Careers(Patches(), 200, 5, 1)
        careers.load_state_dict(before.state_dict())
        assert careers.levels.mean() == pytest.approx(before.levels.mean(), abs=0.01)

    @pytest.mark.parametrize("other", [Patches(rows=9), Patches(names=("flat",))])
    def test_another_map(self, other: Patches) -> None:
        state = Careers(Patches(), 4, 5, 1).state_dict()
        careers = Careers(other, 4, 5, 1)
        with pytest.raises(ConfigError, match="checkpoint's map has 10 x 2 patches; this one has"):
            careers.load_state_dict(state)


class TestEnvironment:
    """The careers of a real environment, whose robots do nothing but stand."""

    def make(self, **terrain: Any) -> LeggedEnv:
        task = Task(
            env=Env(num_envs=6, num_threads=1, episode_length_s=0.2),
            terrain=Terrain(measure_heights=False, **terrain),
            commands=Commands(lin_vel_x=(1, 1), lin_vel_y=(0, 0), ang_vel_yaw=(0, 0), standing=0),
            init_state=InitState(lin_vel=0, ang_vel=0, yaw=0),
            domain_rand=DomainRand(push_interval_s=0),
        )
        env = LeggedEnv(task, read_robot(Path(str(bundled.find("quadruped"))).parent), Patches())
        env.careers.levels[:] = 4
        env.begin_all()
        return env

    def walk(self, env: LeggedEnv, steps: int) -> dict[str, float]:
        extras: dict[str, Any] = {}
        for _ in range(steps):
            *_, extras = env.step(torch.zeros(6, 12))
        log: dict[str, float] = extras.get("log", {})
        return log

    def test_start_is_at_the_origin_of_the_level(self) -> None:
        env = self.make()
        off = env.state.base_pos[:, :2] - env.careers.origins[:, :2]
        assert np.abs(off).max() <= 0.5
        assert (env.careers.origins[:, 0] == 36).all()

    def test_asked_is_what_commands_ask(self) -> None:
        env = self.make()
        self.walk(env, 5)
        np.testing.assert_allclose(env.careers.asked[:, 0], 0.1, atol=0.005)

    def test_idle_robots_move_down_when_their_time_is_over(self) -> None:
        env = self.make()
        self.walk(env, 9)
        assert env.careers.levels.tolist() == [4] * 6
        log = self.walk(env, 1)
        assert env.careers.levels.tolist() == [3] * 6
        assert log["Curriculum/level"] == log["Curriculum/level_rough"] == 3
        assert log["Curriculum/success_flat"] == 0
        assert (env.careers.asked == 0).all()
        assert np.abs(env.state.base_pos[:, 0] - 28).max() <= 0.55

    def test_first_reset_moves_nobody(self) -> None:
        env = self.make()
        assert np.isnan(env.careers.success).all()
        assert env.careers.levels.tolist() == [4] * 6

    def test_episodes_cut_by_random_lengths_move_nobody(self) -> None:
        """As rsl-rl's runner does it with `init_at_random_ep_len`."""
        env = self.make()
        env.episode_length_buf = torch.tensor([0, 1, 2, 3, 5, 9])
        self.walk(env, 10)
        assert env.careers.levels.tolist() == [3, 4, 4, 4, 4, 4]
        # From then on their episodes are whole.
        self.walk(env, 10)
        assert env.careers.levels.tolist() == [2, 3, 3, 3, 3, 3]

    def test_crossing_moves_up(self) -> None:
        env = self.make()
        env.physics.qpos[2, 0] += 5
        self.walk(env, 10)
        assert env.careers.levels.tolist() == [3, 3, 5, 3, 3, 3]

    def test_leaving_the_map_is_crossing(self) -> None:
        """A patch may be narrower than it is long: its side is nearer than half its length."""
        env = self.make()
        env.ground.lower = (-np.inf, 2.0)
        env.physics.qpos[1, 1] -= 2.9
        *_, extras = env.step(torch.zeros(6, 12))
        assert extras["log"]["Episode/falls"] == 1
        assert env.careers.levels.tolist() == [4, 5, 4, 4, 4, 4]
        assert env.careers.success[4, 0] == 1

    def test_falls_move_down(self) -> None:
        env = self.make()
        self.walk(env, 2)
        env.physics.qpos[1, 3:7] = (0, 1, 0, 0)
        self.walk(env, 1)
        assert env.careers.levels.tolist() == [4, 3, 4, 4, 4, 4]

    def test_without_curriculum(self) -> None:
        env = self.make(curriculum=False)
        log = self.walk(env, 10)
        assert env.careers.levels.tolist() == [4] * 6
        assert log["Curriculum/success_flat"] == 0

    def test_hardest_first_row(self) -> None:
        assert set(Careers(Patches(), 500, 2, 1).levels) == {0, 1, 2}
        assert set(Careers(Patches(rows=3), 500, 5, 1).levels) == {0, 1, 2}

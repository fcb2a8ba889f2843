import json
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from terrainkit import MapConfig, TerrainChoice, generate
from terrainkit.errors import ConfigError, ExportError
from terrainkit_robots.rl import evaluation
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.evaluation import (
    SETTLING,
    Asked,
    command_grid,
    evaluate,
    evaluation_task,
    forward_command,
    prepared,
    roll_out,
    summed_up,
    write_evaluation,
)
from terrainkit_robots.rl.ground import Plane
from terrainkit_robots.rl.task import (
    Algorithm,
    Commands,
    Control,
    DomainRand,
    Runner,
    Sim,
    Task,
    Terrain,
)


@pytest.fixture
def run_of(quadruped, lively):
    """Return a run without a checkpoint: what an evaluation needs to know of one."""

    def make(ground="plane", **sections):
        return SimpleNamespace(
            task=lively(**sections), robot=quadruped, terrain=str(ground), checkpoint=None
        )

    return make


@pytest.fixture
def map_file(mixed_map, tmp_path):
    return mixed_map.save(tmp_path / "map.npz")


def still(env):
    return lambda _: torch.zeros(env.num_envs, env.num_actions)


def limp(env):
    """Return a policy that lets the legs of the first robot collapse, and no others."""
    actions = torch.zeros(env.num_envs, env.num_actions)
    actions[0] = 100.0
    return lambda _: actions


class Sliding(LeggedEnv):
    """Robots whose bases move as they are told, whatever they do."""

    moves = np.zeros((1, 3), np.float32)
    """Speed forward and to the left [m/s], turning speed [rad/s], of each robot, shape (n, 3)."""

    falls = np.zeros(1)
    """When each robot falls [s]; 0: never. Shape (n,)."""

    def step(self, actions):
        observed, rewards, _, _ = super().step(actions)
        dt, n = self.cfg.dt, self.num_envs
        self.now = getattr(self, "now", 0) + 1
        state = self.state
        state.base_lin_vel[:, :2], state.base_ang_vel[:, 2] = self.moves[:, :2], self.moves[:, 2]
        way = self.moves[:, 0] * np.float32(self.now * dt)
        state.base_pos[:, :2] = self.start + np.column_stack([way, np.zeros(n)])
        dones = torch.from_numpy(np.isclose(self.falls, self.now * dt))
        return observed, rewards, dones, {"time_outs": torch.zeros(n, dtype=torch.bool)}


@pytest.fixture
def sliding(quadruped, calm):
    def make(moves, falls=None, ground=None, **sections):
        moves = np.array(moves, np.float32)
        # What the physics does is of no account, so it is done in one step.
        coarse = calm(len(moves), sim=Sim(dt=0.02), control=Control(decimation=1), **sections)
        task = evaluation_task(coarse, len(moves))
        env = Sliding(task, quadruped, ground or Plane())
        env.moves = moves
        env.falls = np.zeros(len(moves)) if falls is None else np.array(falls)
        return env

    return make


def test_nothing_of_a_robot_is_random_in_an_evaluation():
    task = evaluation_task(Task(), 7, seconds=30, seed=5)
    assert task.env.num_envs == 7
    assert task.env.episode_length_s > 30
    assert task.noise.noise_level == 0
    assert not task.terrain.curriculum
    assert task.init_state.reset_range == (1, 1)
    assert task.runner.seed == 5
    rand = task.domain_rand
    assert rand.friction is rand.added_mass is rand.gains is rand.motor_strength is None
    assert rand.com_shift == rand.joint_offset == rand.push_interval_s == 0


def test_a_task_of_ones_own_stays_one():
    @dataclass(frozen=True, kw_only=True)
    class Jumping(Commands):
        height: float = 0.3

    task = Task(
        commands=Jumping(height=0.4, lin_vel_x=(0, 2)), algorithm=Algorithm(num_mini_batches=64)
    )
    made = evaluation_task(task, 1)
    assert made.commands == task.commands
    assert made.control == task.control


def test_robots_are_as_their_model(run_of):
    env, _ = prepared(run_of(domain_rand=DomainRand(joint_offset=0.1)), Asked(num_envs=3))
    assert not env.differences.added_mass.any()
    assert not env.differences.com_shift.any()
    assert not env.joint_offset.any()
    assert (env.differences.strength == 1).all()
    np.testing.assert_allclose(
        env.state.dof_pos, np.tile(env.robot.default_pose, (3, 1)), atol=1e-6
    )
    torch.testing.assert_close(
        env.get_observations()["policy"], env.get_observations()["privileged"][:, :45]
    )


def test_the_grid_is_all_over_the_ranges():
    settings = Commands(lin_vel_x=(-1, 1), lin_vel_y=(-0.5, 0.5), ang_vel_yaw=(-1, 1))
    grid = command_grid(settings)
    assert grid.shape == (75, 3)
    assert sorted({float(v) for v in grid[:, 0]}) == [-1, -0.5, 0, 0.5, 1]
    assert sorted({float(v) for v in grid[:, 1]}) == [-0.5, 0, 0.5]
    assert sorted({float(v) for v in grid[:, 2]}) == [-1, -0.5, 0, 0.5, 1]


def test_the_grid_keeps_to_what_the_task_may_ask_for():
    settings = Commands(lin_vel_x=(0.4, 1), lin_vel_y=(0, 0), ang_vel_yaw=(-0.3, 0.3), min_norm=0.2)
    grid = command_grid(settings)
    assert {round(float(v), 3) for v in grid[:, 0]} == {0.4, 0.5, 1}
    assert {float(v) for v in grid[:, 1]} == {0}
    assert {round(float(v), 3) for v in grid[:, 2]} == {-0.3, 0, 0.3}
    assert len(np.unique(grid, axis=0)) == len(grid) == 9


def test_forward_is_three_quarters_of_the_largest_speed():
    np.testing.assert_allclose(forward_command(Commands(lin_vel_x=(-1, 2))), [1.5, 0, 0])


def test_errors_are_those_of_the_time_after_settling(sliding):
    env = sliding([[0.6, 0.3, 0.5], [1, 0, 0]])
    commands = np.array([[1, 0, 0.3], [1, 0, 0]], np.float32)
    outcome = roll_out(env, still(env), 4.0, commands)
    first = outcome.score(np.array([True, False]), patches=False)
    assert first.lin_vel_error == pytest.approx(0.5)
    assert first.lin_vel_error_1s == pytest.approx(0.5)
    assert first.ang_vel_error == pytest.approx(0.2)
    assert first.success is None
    both = outcome.score(np.ones(2, bool), patches=False)
    assert both.lin_vel_error == pytest.approx(0.25)
    steps = round((4.0 - SETTLING) / env.cfg.dt)
    assert outcome.counts.tolist() == [[steps] * 2, [steps - 49] * 2] * 2


def test_swaying_cancels_out_over_a_second(sliding):
    env = sliding([[1, 0, 0]])
    before = env.step

    def swaying(actions):
        env.moves = np.array([[1, 0.4 * (-1) ** env.steps[0], 0]], np.float32)
        return before(actions)

    env.step = swaying
    score = roll_out(env, still(env), 4.0, np.array([[1, 0, 0]], np.float32)).score(
        np.ones(1, bool), patches=False
    )
    assert score.lin_vel_error == pytest.approx(0.4)
    assert score.lin_vel_error_1s == pytest.approx(0, abs=1e-6)


def test_each_new_command_has_its_time_to_settle(sliding):
    env = sliding([[1, 0, 0]])
    commands = np.array([[[1, 0, 0]], [[0, 0, 0]]], np.float32)
    outcome = roll_out(env, still(env), 6.0, commands)
    assert outcome.counts[0].item() == 2 * round((3 - SETTLING) / env.cfg.dt)
    assert outcome.sums[0].item() / outcome.counts[0].item() == pytest.approx(0.5)


def test_a_fall_counts_once_and_ends_the_measuring(sliding):
    env = sliding([[0, 0, 0], [0, 0, 0], [0, 0, 0]], falls=[0, 3.0, 1.0])
    before = env.step

    def again(actions):
        if env.now == 160:
            env.falls = np.array([0, 3.2, 3.2])  # and once more, after a new start
        return before(actions)

    env.now, env.step = 0, again
    outcome = roll_out(env, still(env), 4.0, np.tile(np.float32([1, 0, 0]), (3, 1)))
    assert outcome.fell.tolist() == [False, True, True]
    assert outcome.counts[0].tolist() == [100, 49, 0]
    lost = outcome.score(np.array([False, False, True]), patches=False)
    assert (lost.falls, lost.robots, lost.lin_vel_error) == (1, 1, None)


def test_falls_of_the_physics_are_seen(run_of):
    run = run_of()
    env, commands = prepared(run, Asked(num_envs=2, command=(0, 0, 0), seconds=1))
    outcome = roll_out(env, limp(env), 1.0, commands)
    assert outcome.fell.tolist() == [True, False]


def test_who_crosses_half_a_patch_succeeds_and_is_judged_no_longer(sliding, map_ground):
    # Patches are 6 m long: half is crossed after 3 s at 1 m/s, before the falls after that.
    moves = [[1, 0, 0], [1, 0, 0], [0.3, 0, 0], [0.7, 0, 0], [1, 0, 0]]
    env = sliding(moves, falls=[0, 3.5, 0, 0, 2.0], ground=map_ground)
    outcome = roll_out(env, still(env), 4.0, np.tile(np.float32([1, 0, 0]), (5, 1)))
    assert outcome.fell.tolist() == [False, False, False, False, True]
    # The third came not half as far as it was asked to, the fourth did.
    assert outcome.success.tolist() == [True, True, False, True, False]
    assert outcome.counts[0, 1] == outcome.counts[0, 0] < 100
    score = outcome.score(np.ones(5, bool), patches=True)
    assert (score.success, score.falls) == (0.6, 1)


def test_it_ends_when_every_trial_has(sliding, map_ground):
    done = []
    env = sliding([[0, 0, 0]], falls=[0.1], ground=map_ground)
    roll_out(env, still(env), 4.0, np.zeros((1, 3), np.float32), done.append)
    assert len(done) == 5
    env = sliding([[0, 0, 0]], falls=[0.1], ground=map_ground)
    roll_out(env, still(env), 0.4, np.zeros((1, 3), np.float32), done.append, to_the_end=True)
    assert len(done) == 25
    assert done[-1] == 1


def test_on_a_plane_each_command_has_a_robot(run_of):
    env, commands = prepared(run_of(), Asked())
    assert env.num_envs == len(commands) == len(np.unique(commands, axis=0)) == 75


def test_on_a_map_each_patch_has_equally_many_robots(run_of, map_file):
    env, commands = prepared(run_of(map_file), Asked(num_envs=12))
    patches = list(zip(env.careers.levels.tolist(), env.careers.columns.tolist(), strict=True))
    assert sorted(patches) == sorted([(row, col) for row in range(3) for col in range(2)] * 2)
    near = env.ground.env_origins[env.careers.levels, env.careers.columns]
    assert np.abs(env.state.base_pos - near)[:, :2].max() <= env.cfg.init_state.position + 1e-5
    assert (commands == forward_command(env.cfg.commands)).all()
    env, _ = prepared(run_of(map_file), Asked(), each=3)
    assert env.num_envs == 18
    env, _ = prepared(run_of(map_file), Asked(num_envs=4))
    patches = list(zip(env.careers.levels.tolist(), env.careers.columns.tolist(), strict=True))
    assert len(set(patches)) == 4


def test_the_policy_sees_as_much_as_in_training(run_of, map_file):
    few = 45
    cases = [
        (run_of("plane"), map_file, few),
        (run_of(map_file), "plane", few + 187),
        (run_of(map_file, terrain=Terrain(collision="plane")), map_file, few),
        (run_of("plane", terrain=Terrain(measure_heights=True)), None, few + 187),
    ]
    for run, terrain, width in cases:
        asked = Asked(num_envs=1, terrain=None if terrain is None else str(terrain))
        env, _ = prepared(run, asked)
        assert env.get_observations()["policy"].shape == (1, width)
        assert env.ground.level == (terrain in ("plane", None))


@pytest.mark.parametrize("terrain", ["plane", "map"])
def test_the_same_seed_gives_the_same_result(run_of, map_file, terrain, monkeypatch):
    monkeypatch.setattr(evaluation, "SETTLING", 0.1)
    monkeypatch.setattr(evaluation, "WINDOW", 0.1)
    run = run_of(map_file if terrain == "map" else "plane")

    def result(seed):
        asked = Asked(num_envs=3, seconds=0.4, seed=seed, random_commands=True)
        env, commands = prepared(run, asked)
        torch.manual_seed(7)
        mix = 0.5 * torch.randn(env.get_observations()["policy"].shape[1], env.num_actions)
        outcome = roll_out(env, lambda seen: torch.tanh(seen["policy"] @ mix), 0.4, commands)
        assert outcome.counts.all()
        return summed_up(run, asked, env, outcome).as_json()

    assert result(3) == result(3)
    assert result(3) != result(4)


def test_results_are_told_apart_by_command(run_of):
    run = run_of(commands=Commands(lin_vel_x=(-1, 1), lin_vel_y=(-0.5, 0.5), ang_vel_yaw=(-1, 1)))
    asked = Asked(seconds=0.1)
    env, commands = prepared(run, asked)
    outcome = roll_out(env, still(env), 0.1, commands)
    told = json.loads(summed_up(run, asked, env, outcome, commands).as_json())
    assert told["all"]["robots"] == 75
    assert told["all"]["success"] is None
    assert told["all"]["lin_vel_error"] is None  # nobody had settled yet
    assert len(told["by_command"]) == 75
    assert told["by_command"][0]["command"] == [-1.0, -0.5, -1.0]
    assert "by_terrain" not in told


def test_results_are_told_apart_by_terrain_and_level(run_of, map_file):
    run = run_of(map_file)
    asked = Asked(seconds=0.1, num_envs=12)
    env, commands = prepared(run, asked)
    told = json.loads(
        summed_up(run, asked, env, roll_out(env, still(env), 0.1, commands)).as_json()
    )
    assert [part["terrain"] for part in told["by_terrain"]] == ["stairs", "rough_slope"]
    assert [part["level"] for part in told["by_level"]] == [0, 1, 2]
    assert [part["robots"] for part in told["by_terrain_and_level"]] == [2] * 6
    assert told["by_terrain_and_level"][1]["level"] == 1
    assert "by_command" not in told


def test_on_a_randomized_map_each_robot_counts_for_the_terrain_below_it(run_of, tmp_path):
    choices = tuple(TerrainChoice(terrain=name) for name in ("flat", "pyramid_slope"))
    made = MapConfig(
        mode="randomized", rows=3, cols=3, patch_size=(4, 4), border=0.5, terrains=choices
    )
    path = generate(made).save(tmp_path / "map.npz")
    run, asked = run_of(path), Asked(seconds=0.04)
    env, commands = prepared(run, replace(asked, num_envs=9))
    found = summed_up(run, asked, env, roll_out(env, still(env), 0.04, commands))
    names = env.ground.terrain_names
    assert len({tuple(row) for row in names}) > 1
    for part in found.by_terrain:
        assert part.score.robots == (names == part.terrain).sum()
    assert sum(part.score.robots for part in found.by_terrain) == 9
    for part in found.by_terrain_and_level:
        assert part.score.robots == (names[part.level] == part.terrain).sum()
    keys = [(part.terrain, part.level) for part in found.by_terrain_and_level]
    order = [part.terrain for part in found.by_terrain]
    assert keys == sorted(keys, key=lambda key: (order.index(key[0]), key[1]))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"seconds": 0.0}, "seconds is 0"),
        ({"seconds": float("nan")}, "seconds is nan"),
        ({"seconds": 1e9}, "at most 3600"),
        ({"num_envs": 0}, "num_envs is 0"),
        ({"seed": -1}, "seed is -1"),
        ({"command": (1.0, float("inf"), 0.0)}, "wanted three numbers"),
        ({"command": (1.0, 0.0, 0.0), "random_commands": True}, "wanted one"),
    ],
)
def test_what_cannot_be_is_refused(options, words):
    with pytest.raises(ConfigError, match=words):
        Asked(**options)


def test_a_device_that_is_not_there_is_an_error(run_of):
    with pytest.raises(ConfigError, match="torch has no device 'abacus' here"):
        prepared(run_of(), Asked(device="abacus"))


def test_a_run_without_a_checkpoint_is_an_error(run_of, tmp_path):
    run = run_of(runner=Runner(seed=2))
    run.folder = tmp_path
    with pytest.raises(ConfigError, match="no checkpoint"):
        evaluate(run, Asked(num_envs=1, seconds=0.1))


def test_it_is_written_whole_and_replaces_nothing_unasked(run_of, tmp_path):
    run = run_of()
    asked = Asked(seconds=0.04, num_envs=1)
    env, commands = prepared(run, asked)
    found = summed_up(run, asked, env, roll_out(env, still(env), 0.04, commands))
    path = tmp_path / "result.json"
    write_evaluation(found, path)
    assert path.read_text() == found.as_json()
    with pytest.raises(ExportError, match="exists"):
        write_evaluation(replace(found, seed=9), path)
    assert path.read_text() == found.as_json()

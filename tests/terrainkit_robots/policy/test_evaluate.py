import json
from dataclasses import dataclass, field, replace
from itertools import product
from typing import ClassVar

import numpy as np
import pytest
import torch

from terrainkit import generate
from terrainkit.errors import ConfigError
from terrainkit_robots.policy.evaluate import (
    EvaluationConfig,
    command_grid,
    eval_task,
    evaluate,
    make_eval_env,
    summarize,
)
from terrainkit_robots.policy.metrics import ErrorMean
from terrainkit_robots.policy.policy_rollout import EvaluationRollout
from terrainkit_robots.rl.commands import CommandTerm
from terrainkit_robots.rl.config import Commands, DomainRand, Env, Rewards, Task, Terrain
from terrainkit_robots.rl.env import LeggedEnv, make_env
from terrainkit_robots.rl.env_state import env_state, load_env_state
from terrainkit_robots.rl.run import PolicySpec, open_run
from terrainkit_robots.rl.terrain import Plane
from tests.tables import read_table


def run_still(run, config, seconds=0.1, **options):
    """Evaluate a policy without motion."""
    env, commands = make_eval_env(run, config, **options)
    rollout = EvaluationRollout(env)
    rollout.run(lambda _: torch.zeros(env.num_envs, env.num_actions), seconds, commands)
    return rollout, commands


def test_eval_task_keeps_custom_configs():
    @dataclass(frozen=True, kw_only=True)
    class Jumping(Commands):
        height: float = 0.3

    task = Task(commands=Jumping(height=0.4, lin_vel_x=(0, 2)))
    assert eval_task(task, 1).commands == task.commands


def test_evaluation_env_is_not_randomized(make_run):
    own = {"added_mass_range": (1, 2), "com_pos_z_range": (0.1, 0.2)}
    run = make_run(domain_rand=DomainRand(joint_offset=0.1, **own))
    env, _ = make_eval_env(run, EvaluationConfig(num_envs=3, seconds=30, seed=5))
    assert env.cfg.env.episode_length_s > 30
    assert env.cfg.runner.seed == 5
    assert not env.params.added_mass.any()
    assert not env.params.com_shift.any()
    assert (env.params.strength == 1).all()
    assert not env.joint_offset.any()
    default_pose = np.tile(env.robot.default_pose, (3, 1))
    np.testing.assert_allclose(env.state.dof_pos, default_pose, atol=1e-6)
    obs = env.get_observations()
    torch.testing.assert_close(obs["policy"], obs["privileged"][:, :47])


def test_command_grid_covers_the_ranges():
    commands = Commands(lin_vel_x=(-1, 1), lin_vel_y=(-0.5, 0.5), ang_vel_yaw=(-1, 1))
    fifths, thirds = (-1, -0.5, 0, 0.5, 1), (-0.5, 0, 0.5)
    expected = sorted(product(fifths, thirds, fifths))
    assert sorted(map(tuple, command_grid(commands).tolist())) == expected


def test_command_grid_respects_one_sided_ranges_and_min_norm():
    ranges = {"lin_vel_x": (0.4, 1), "lin_vel_y": (0, 0), "ang_vel_yaw": (-0.3, 0.3)}
    grid = command_grid(Commands(**ranges, min_norm=0.2))
    expected = [*product((0.4, 0.5, 1), (0,), (-0.3, 0, 0.3))]
    np.testing.assert_allclose(sorted(map(tuple, grid.tolist())), expected, atol=1e-6)


@pytest.mark.parametrize(
    ("num_envs", "max_patch_envs", "per_patch"), [(12, 512, 2), (None, 3, 3), (4, 512, 1)]
)
def test_map_patches_get_equal_numbers_of_robots(
    make_run, map_file, num_envs, max_patch_envs, per_patch
):
    config = EvaluationConfig(num_envs=num_envs)
    env, commands = make_eval_env(make_run(map_file), config, max_patch_envs=max_patch_envs)
    patches = zip(env.curriculum.levels.tolist(), env.curriculum.columns.tolist(), strict=True)
    counts = np.unique(list(patches), axis=0, return_counts=True)[1]
    assert (counts == per_patch).all()
    assert len(counts) == min(6, env.num_envs)
    directions = np.float32([[0.75, 0, 0], [-0.75, 0, 0], [0, 0.375, 0], [0, -0.375, 0]])
    assert commands.tolist() == directions[np.arange(env.num_envs) // 6 % 4].tolist()
    origins = env.terrain.env_origins[env.curriculum.levels, env.curriculum.columns]
    distance = np.abs(env.state.base_pos - origins)[:, :2].max()
    assert distance <= env.cfg.init_state.position + 1e-5


def test_policy_keeps_its_observations_on_another_terrain(make_run, map_file):
    cases = [
        (make_run("plane"), str(map_file), 47),
        (make_run(map_file), "plane", 47 + 187),
        (make_run(map_file, terrain=Terrain(collision="plane")), str(map_file), 47),
        (make_run("plane", terrain=Terrain(measure_heights=True)), None, 47 + 187),
    ]
    for run, terrain, width in cases:
        env, _ = make_eval_env(run, EvaluationConfig(num_envs=1, terrain=terrain))
        assert env.get_observations()["policy"].shape == (1, width)
        assert env.terrain.is_plane == (terrain in ("plane", None))


@pytest.mark.parametrize(("options", "message"), read_table(__file__, "evaluation_config_rejects"))
def test_evaluation_config_rejects_invalid_values(options, message):
    with pytest.raises(ConfigError, match=message):
        EvaluationConfig(**options)


def test_evaluation_env_rejects_a_changed_map(make_run, small_map, map_file):
    run = make_run(map_file)
    generate(replace(small_map.config, seed=9)).save(map_file, overwrite=True)
    with pytest.raises(ConfigError, match=r"map\.npz changed after .* expected --terrain"):
        make_eval_env(run, EvaluationConfig(num_envs=1))
    for terrain in (map_file, run.folder / "map.toml"):
        make_eval_env(run, EvaluationConfig(num_envs=1, terrain=str(terrain)))


def test_evaluation_env_ignores_the_map_of_a_flat_run(make_run, map_file):
    run = make_run(map_file, terrain=Terrain(collision="plane"))
    (run.folder / "map.toml").unlink()
    map_file.write_text("gone")
    env, _ = make_eval_env(run, EvaluationConfig(num_envs=1))
    assert env.terrain.is_plane


@pytest.mark.parametrize("on_map", [False, True])
def test_evaluation_is_reproducible(make_run, map_file, on_map):
    run = make_run(map_file if on_map else "plane")

    def result(seed):
        config = EvaluationConfig(num_envs=3, seed=seed, random_commands=True)
        rollout, _ = run_still(run, config, seconds=2.1)
        assert rollout.errors["lin_vel_error"].count.all()
        return summarize(run, config, rollout).to_json()

    first = result(3)
    assert result(3) == first
    assert result(4) != first


def test_summary_groups_by_command(make_run):
    ranges = {"lin_vel_x": (-1, 1), "lin_vel_y": (-0.5, 0.5), "ang_vel_yaw": (-1, 1)}
    run, config = make_run(commands=Commands(**ranges)), EvaluationConfig()
    document = json.loads(summarize(run, config, *run_still(run, config)).to_json())
    assert document["all"]["robots"] == 75
    assert document["all"]["success"] is None
    assert document["all"]["lin_vel_error"] is None  # nothing is measured before settling
    assert len(document["by_command"]) == 75
    assert document["by_command"][0]["command"] == [-1.0, -0.5, -1.0]
    assert document["all"]["followed"] is None
    assert document["feet"] == ["FL_foot", "FR_foot", "RL_foot", "RR_foot"]
    assert "by_terrain" not in document


@dataclass(frozen=True, kw_only=True)
class LeanRewards(Rewards):
    lean: float = -2.0


class LeanEnv(LeggedEnv):
    """Robots are commanded to lean to one of two angles, and not to walk."""

    def command_terms(self):
        # New commands in each step, unless they are held.
        return {
            "lean": CommandTerm(lambda rng, n: rng.choice([0.25, 0.5], (n, 1)), self.num_envs, 0, 1)
        }

    def reward_terms(self):
        return super().reward_terms() | {"lean": self.evaluation_terms()["lean_angle"]}

    def evaluation_terms(self):
        return {"lean_angle": lambda env: env.active_commands["lean"].values[:, 0]}


@dataclass(frozen=True, kw_only=True)
class LeanTask(Task):
    env_class: ClassVar = LeanEnv
    rewards: LeanRewards = field(default_factory=LeanRewards)


@pytest.fixture
def leaning(quadruped):
    def stand(obs):
        return torch.zeros(len(obs), 12)

    return PolicySpec(task=LeanTask(), robot=quadruped, policy=stand)


def test_task_of_the_user_is_evaluated_on_its_commands(leaning):
    document = json.loads(evaluate(leaning, EvaluationConfig(seconds=2.1)).to_json())
    assert document["commands"] == {"lean": 1}
    rows = sorted(document["by_command"], key=lambda row: row["command"])
    assert [row["command"] for row in rows] == [[0.25], [0.5]]
    assert sum(row["robots"] for row in rows) == 16
    for row in rows:
        angle, rate = row["terms"]["lean_angle"], row["terms"]["rew_lean"]
        assert [angle] == row["command"]
        assert rate == pytest.approx(-2 * angle)
    every = document["all"]
    assert (every["falls"], every["lin_vel_error"], every["followed"]) == (0, None, None)
    assert not {"rew_tracking_lin_vel", "rew_feet_gait", "rew_termination"} & {*every["terms"]}
    sampled = evaluate(leaning, EvaluationConfig(seconds=2.1, random_commands=True))
    assert 0.3 < sampled.about["all"].terms["lean_angle"] < 0.45
    assert "by_command" not in sampled.tables
    with pytest.raises(ConfigError, match="command: got a velocity; expected none"):
        evaluate(leaning, EvaluationConfig(command=(1, 0, 0)))


def test_task_without_velocity_commands_has_no_terms_of_them(leaning):
    task = replace(leaning.task, env=Env(num_envs=4, num_threads=1, episode_length_s=0.1))
    env = make_env(task, leaning.robot, Plane())
    for terms in (*env.obs_terms.values(), env.active_rewards):
        assert not {"commands", "gait_phase", "tracking_ang_vel", "progress"} & {*terms}
    assert "torques" in env.active_rewards
    env.set_commands(np.ones((4, 3), np.float32))
    angles = []
    for _ in range(5):
        angles.append(env.active_commands["lean"].values.mean())
        log = env.step(torch.zeros(4, env.num_actions))[3].get("log")
    assert not env.state.commands.any()
    assert log["Episode/lean_angle"] == pytest.approx(np.mean(angles))
    assert log["Episode/rew_lean"] == pytest.approx(-2 * np.mean(angles))
    load_env_state(env, env_state(env))


def test_error_mean_weights_robots_equally():
    mean = ErrorMean(3)
    mean.add(np.array([1.0, 5.0, 9.0]), np.array([True, True, False]))
    mean.add(np.array([4.0, 7.0, 9.0]), np.array([True, False, False]))
    assert mean.over(np.array([True, False, True])) == 2.5  # (1 + 4) / 2
    assert mean.over(np.array([True, True, True])) == 3.75  # (2.5 + 5) / 2
    assert mean.over(np.array([False, False, True])) is None


def test_summary_has_the_velocity_errors_of_each_command(make_run, make_sliding):
    env = make_sliding([[0.7, -0.4, 0.25], [0.0, 0.5, -1.0]])
    rollout, commands = EvaluationRollout(env), np.array([[1, 0, 0], [0, 0, -0.5]], np.float32)
    rollout.run(lambda _: torch.zeros(2, env.num_actions), 3.5, commands)
    result = summarize(make_run(), EvaluationConfig(), rollout, commands)
    for suffix in ("", "_1s"):
        linear, yaw = (f"{name}_vel_error{suffix}" for name in ("lin", "ang"))
        found = [[getattr(g, linear), getattr(g, yaw)] for g in result["by_command"]]
        assert found == [pytest.approx([0.5, 0.25]), pytest.approx([0.5, 0.5])]
        assert getattr(result.about["all"], yaw) == pytest.approx(0.375)


def test_summary_groups_by_terrain_and_level(make_run, map_file):
    run, config = make_run(map_file), EvaluationConfig(num_envs=12)
    rollout, _ = run_still(run, config)
    document = json.loads(summarize(run, config, rollout).to_json())
    assert [group["terrain"] for group in document["by_terrain"]] == ["stairs", "rough_slope"]
    assert [group["level"] for group in document["by_level"]] == [0, 1, 2]
    each = document["by_terrain_and_level"]
    groups = [(group["terrain"], group["level"], group["robots"]) for group in each]
    assert groups == [(name, k, 2) for name in ("stairs", "rough_slope") for k in range(3)]
    directions = [(group["direction"], group["robots"]) for group in document["by_direction"]]
    assert directions == [("forward", 6), ("backward", 6)]
    assert "by_command" not in document


def test_bundled_quadruped_follows_commands():
    result = evaluate(open_run("quadruped"), EvaluationConfig(seconds=8.0, num_envs=8))
    assert result.about["all"].robots == len(result["by_command"]) == 8
    assert result.about["all"].falls == 0
    assert result.about["all"].lin_vel_error < 0.25
    assert result.about["all"].ang_vel_error < 0.25
    assert result.about["all"].followed == 1
    assert 1 < result.about["all"].step_frequency < 6
    assert all(0 < height < 0.15 for height in result.about["all"].swing_height)
    contacts = result.about["contacts"]
    assert {len(contacts[foot]) for foot in result.about["feet"]} == {100}


def test_evaluate_uses_single_torch_thread():
    before, during = torch.get_num_threads(), []
    torch.set_num_threads(2)
    try:
        config = EvaluationConfig(seconds=0.04, num_envs=1)
        evaluate(open_run("quadruped"), config, lambda _: during.append(torch.get_num_threads()))
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(before)
    assert during == [1, 1]

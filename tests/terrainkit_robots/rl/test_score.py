import json
from dataclasses import replace

import numpy as np
import pytest
import torch

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ExportError
from terrainkit_robots.policy import trials
from terrainkit_robots.policy.evaluate import Asked, prepared
from terrainkit_robots.policy.score import score_of, summed_up, write_evaluation
from terrainkit_robots.policy.trials import Outcome, roll_out
from terrainkit_robots.rl.config import Commands


def still(env):
    return lambda _: torch.zeros(env.num_envs, env.num_actions)


def test_each_robot_counts_alike_however_long_it_was_measured():
    outcome = Outcome(
        fell=np.array([True, False, True]),
        success=np.array([False, True, False]),
        sums=np.array([[1.0, 60.0, 0.0], [0.5, 30.0, 0.0], [2.0, 10.0, 0.0], [0.0, 0.0, 0.0]]),
        counts=np.array([[10, 100, 0], [5, 100, 0], [10, 100, 0], [0, 0, 0]]),
    )
    score = score_of(outcome, np.ones(3, bool), patches=True)
    assert (score.robots, score.falls) == (3, 2)
    assert score.success == pytest.approx(1 / 3)
    assert score.lin_vel_error == pytest.approx((0.1 + 0.6) / 2)
    assert score.lin_vel_error_1s == pytest.approx((0.1 + 0.3) / 2)
    assert score.ang_vel_error == pytest.approx((0.2 + 0.1) / 2)
    assert score.ang_vel_error_1s is None
    assert score_of(outcome, np.array([False, False, True]), patches=False).success is None


@pytest.mark.parametrize("terrain", ["plane", "map"])
def test_the_same_seed_gives_the_same_result(run_of, map_file, terrain, monkeypatch):
    monkeypatch.setattr(trials, "SETTLING", 0.1)
    monkeypatch.setattr(trials, "WINDOW", 0.1)
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
    choices = tuple(SubTerrain(terrain=name) for name in ("flat", "pyramid_slope"))
    made = MapConfig(
        mode="randomized", rows=3, cols=3, patch_size=(4, 4), border=0.5, terrains=choices
    )
    path = generate(made).save(tmp_path / "map.npz")
    run, asked = run_of(path), Asked(seconds=0.04)
    env, commands = prepared(run, replace(asked, num_envs=9))
    found = summed_up(run, asked, env, roll_out(env, still(env), 0.04, commands))
    names = env.terrain.terrain_names
    assert len({tuple(row) for row in names}) > 1
    for part in found.by_terrain:
        assert part.score.robots == (names == part.terrain).sum()
    assert sum(part.score.robots for part in found.by_terrain) == 9
    for part in found.by_terrain_and_level:
        assert part.score.robots == (names[part.level] == part.terrain).sum()
    keys = [(part.terrain, part.level) for part in found.by_terrain_and_level]
    order = [part.terrain for part in found.by_terrain]
    assert keys == sorted(keys, key=lambda key: (order.index(key[0]), key[1]))


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

from dataclasses import dataclass, replace

import numpy as np
import pytest
import torch

from terrainkit import generate
from terrainkit.errors import ConfigError
from terrainkit_robots.policy.evaluate import (
    Asked,
    command_grid,
    evaluate,
    evaluation_task,
    forward_command,
    prepared,
)
from terrainkit_robots.rl.config import Algorithm, Commands, DomainRand, Runner, Task, Terrain
from terrainkit_robots.rl.run import open_run


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
    assert not env.params.added_mass.any()
    assert not env.params.com_shift.any()
    assert not env.joint_offset.any()
    assert (env.params.strength == 1).all()
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


def test_on_a_plane_each_command_has_a_robot(run_of):
    env, commands = prepared(run_of(), Asked())
    assert env.num_envs == len(commands) == len(np.unique(commands, axis=0)) == 75


def test_on_a_map_each_patch_has_equally_many_robots(run_of, map_file):
    env, commands = prepared(run_of(map_file), Asked(num_envs=12))
    patches = list(
        zip(env.curriculum.levels.tolist(), env.curriculum.columns.tolist(), strict=True)
    )
    assert sorted(patches) == sorted([(row, col) for row in range(3) for col in range(2)] * 2)
    near = env.terrain.env_origins[env.curriculum.levels, env.curriculum.columns]
    assert np.abs(env.state.base_pos - near)[:, :2].max() <= env.cfg.init_state.position + 1e-5
    assert (commands == forward_command(env.cfg.commands)).all()
    env, _ = prepared(run_of(map_file), Asked(), each=3)
    assert env.num_envs == 18
    env, _ = prepared(run_of(map_file), Asked(num_envs=4))
    patches = list(
        zip(env.curriculum.levels.tolist(), env.curriculum.columns.tolist(), strict=True)
    )
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
        assert env.terrain.is_flat == (terrain in ("plane", None))


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
    with pytest.raises(ConfigError, match="device 'abacus'; here there is: cpu"):
        prepared(run_of(), Asked(device="abacus"))


def test_another_ground_under_the_same_name_is_told(run_of, mixed_map, map_file):
    run, other = run_of(map_file), replace(mixed_map.config, seed=mixed_map.config.seed + 1)
    generate(other).save(map_file, overwrite=True)
    said = r"map\.npz is not what .* was trained on any more; --terrain says what to take"
    with pytest.raises(ConfigError, match=said):
        prepared(run, Asked(num_envs=1))
    for terrain in (map_file, run.folder / "map.toml"):
        prepared(run, Asked(num_envs=1, terrain=str(terrain)))


def test_a_map_that_is_left_flat_may_be_another_or_gone(run_of, map_file):
    run = run_of(map_file, terrain=Terrain(collision="plane"))
    (run.folder / "map.toml").unlink()
    map_file.write_text("gone")
    env, _ = prepared(run, Asked(num_envs=1))
    assert env.terrain.is_flat


def test_a_run_without_a_checkpoint_is_an_error(run_of):
    run = run_of(runner=Runner(seed=2))
    with pytest.raises(ConfigError, match="no checkpoint"):
        evaluate(run, Asked(num_envs=1, seconds=0.1))


# The policy that is shipped walks.


def test_the_quadruped_that_is_shipped_follows_commands_and_does_not_fall():
    found = evaluate(open_run("quadruped"), Asked(seconds=8.0, num_envs=8))
    assert found.whole.robots == len(found.by_command) == 8
    assert found.whole.falls == 0
    assert found.whole.lin_vel_error < 0.25
    assert found.whole.ang_vel_error < 0.25


def test_torch_works_on_one_thread_and_on_as_many_as_before_afterwards():
    before, during = torch.get_num_threads(), []
    torch.set_num_threads(2)
    try:
        evaluate(
            open_run("quadruped"),
            Asked(seconds=0.04, num_envs=1),
            lambda _: during.append(torch.get_num_threads()),
        )
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(before)
    assert during == [1, 1]

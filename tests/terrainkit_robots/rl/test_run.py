import re
import shutil
import tomllib
import warnings
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from terrainkit import generate
from terrainkit.errors import ConfigError, ExportError
from terrainkit_robots.rl import tasks
from terrainkit_robots.rl.config import Commands, Observations, Rewards, Task
from terrainkit_robots.rl.run import (
    MAP_FILE,
    RUN_FILE,
    TASK_FILE,
    checkpoints,
    create_run,
    default_folder,
    is_same_terrain,
    open_run,
    parts_to_load,
    prepare_run_folder,
)
from terrainkit_robots.rl.terrain import load_terrain
from terrainkit_robots.spec.robot_arrays import Robot
from tests.tables import read_table


@pytest.fixture
def mine(tmp_path):
    """Return a copy of the folder of a robot."""
    return shutil.copytree(tasks.get_task("quadruped").folder, tmp_path / "mine")


@pytest.fixture
def task():
    return Task(rewards=Rewards(tracking_lin_vel=3.25))


@pytest.fixture
def run(tmp_path, task):
    return create_run(tmp_path / "run", task, "quadruped", "plane").folder


def test_open_run_returns_what_was_created(run, task, quadruped):
    opened = open_run(run)
    assert (opened.task, opened.terrain, opened.checkpoint) == (task, "plane", None)
    assert (opened.robot.spec, opened.robot.mjcf) == (quadruped.spec, quadruped.mjcf)
    about = tomllib.loads((run / RUN_FILE).read_text())
    assert (about["robot"], about["terrain"], about["seed"]) == ("quadruped", "plane", 1)
    assert set(about["versions"]) == {"terrainkit", "mujoco", "rsl-rl-lib", "torch"}


def test_open_run_uses_the_trained_spec(tmp_path, task, mine, quadruped):
    folder = create_run(tmp_path / "run", task, mine, "plane").folder
    spec = mine / "robot.toml"
    spec.write_text(re.sub("spawn_height = [0-9.]+", "spawn_height = 7.5", spec.read_text()))
    assert Robot.load(mine).spec.spawn_height == 7.5
    opened = open_run(folder)
    assert (opened.info.robot, opened.robot.spec) == (str(mine), quadruped.spec)


def test_open_run_rejects_a_missing_robot(tmp_path, task, mine):
    folder = create_run(tmp_path / "run", task, mine, "plane").folder
    (mine / "quadruped.xml").unlink()
    with pytest.raises(ConfigError, match=r"is missing: there is no file .*quadruped\.xml"):
        open_run(folder)


@pytest.mark.parametrize(("name", "warns"), [("quadruped.xml", True), ("robot.toml", False)])
def test_open_run_warns_about_a_changed_model(tmp_path, task, mine, name, warns):
    folder = create_run(tmp_path / "run", task, mine, "plane").folder
    (mine / name).write_text((mine / name).read_text() + "\n")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        open_run(folder)
    told = [str(warning.message) for warning in caught]
    assert told == ([f"{mine}: quadruped.xml changed after {folder} was trained"] if warns else [])


def test_missing_map_is_generated_again(tmp_path, task, mixed_map):
    path = mixed_map.save(tmp_path / "map.npz")
    folder = create_run(tmp_path / "run", task, "quadruped", path).folder
    assert open_run(folder).terrain == str(path)
    path.unlink()
    opened = open_run(folder)
    assert opened.terrain == str(folder / MAP_FILE)
    again = load_terrain(opened.terrain)
    np.testing.assert_array_equal(again.env_origins, mixed_map.env_origins)


def test_modified_map_is_another_terrain(tmp_path, task, mixed_map):
    path = mixed_map.save(tmp_path / "map.npz")
    run = create_run(tmp_path / "run", task, "quadruped", path)
    assert is_same_terrain(run, path)
    assert is_same_terrain(run, mixed_map.save(tmp_path / "copy.npz"))
    assert not is_same_terrain(run, "plane")
    assert not is_same_terrain(create_run(tmp_path / "plane", task, "quadruped", "plane"), path)
    other = replace(mixed_map.config, seed=mixed_map.config.seed + 1)
    generate(other).save(path, overwrite=True)
    assert not is_same_terrain(run, path)
    assert parts_to_load(run, "quadruped", path, task)["curriculum"] is False


@pytest.mark.filterwarnings("ignore:.*loaded as a custom map")
def test_run_on_a_map_of_a_class_that_is_not_registered(tmp_path, task, mixed_map):
    with np.load(mixed_map.save(tmp_path / "map.npz")) as file:
        arrays = dict(file)
    name = mixed_map.config.terrains[0].terrain
    own = str(arrays["config"]).replace(f'terrain = "{name}"', 'terrain = "own"', 1)
    np.savez(tmp_path / "own.npz", **arrays | {"config": np.array(own)})
    run = create_run(tmp_path / "run", task, "quadruped", tmp_path / "own.npz")
    assert is_same_terrain(run, tmp_path / "own.npz")
    assert not is_same_terrain(run, tmp_path / "map.npz")
    assert (run.folder / MAP_FILE).read_text() == own  # to generate it where the class is


def test_new_noise_is_the_task_s(tmp_path, task):
    run = create_run(tmp_path / "run", task, "quadruped", "plane")
    other = replace(task, policy=replace(task.policy, init_noise_std=0.125))
    longer = replace(task, env=replace(task.env, episode_length_s=9.0))
    loaded = [
        parts_to_load(run, "quadruped", "plane", each)["noise_std"] for each in (other, longer)
    ]
    assert loaded == [False, True]


def test_checkpoints_are_ordered_by_iteration(run):
    for name in ("model_9.pt", "model_10.pt", "model_100.pt", "model_x.pt", "my_model_7.pt"):
        (run / name).touch()
    assert list(checkpoints(run)) == [9, 10, 100]
    assert open_run(run).checkpoint == run / "model_100.pt"
    assert open_run(run, 9).checkpoint == run / "model_9.pt"
    assert open_run(run / "model_10.pt").checkpoint == run / "model_10.pt"
    with pytest.raises(ConfigError, match="got checkpoint 11; expected one of: 9, 10, 100"):
        open_run(run, 11)


def test_create_run_never_overwrites(run, task):
    before = sorted((path.name, path.read_bytes()) for path in run.iterdir())
    told = "exists; choose another folder, or continue with --resume"
    with pytest.raises(ExportError, match=told):
        create_run(run, task, "quadruped", "plane")
    with pytest.raises(ExportError, match=r"cannot write .*run: File exists"):
        create_run(run / RUN_FILE / "run", task, "quadruped", "plane")
    assert sorted((path.name, path.read_bytes()) for path in run.iterdir()) == before


def test_run_folder_replaces_the_task(run, task):
    (run / "model_1.pt").touch()
    other = replace(task, runner=replace(task.runner, max_iterations=77))
    assert prepare_run_folder(None, "quadruped", "plane", other, open_run(run)) == run
    assert open_run(run).task == other


@pytest.mark.usefixtures("own_tasks")
def test_open_run_finds_bundled_policy_by_name(task, mine):
    shipped = tasks.register_task("rover_of_this_test", mine).trained_run
    with pytest.raises(ConfigError, match="no policy is shipped with rover_of_this_test"):
        open_run("rover_of_this_test")
    create_run(shipped, task, "rover_of_this_test", "plane")
    opened = open_run("rover_of_this_test")
    assert opened.folder == shipped == mine / "trained" / "rover_of_this_test"
    assert opened.info.robot == "rover_of_this_test"


@pytest.mark.usefixtures("own_tasks")
def test_missing_keys_of_a_run_have_the_defaults_of_the_schema(tmp_path):
    """A new option is off in an old run, whatever the registered task says today."""

    @dataclass(frozen=True, kw_only=True)
    class Jumping(Commands):
        height: float
        effort: float = 1.0

    today = Task(
        observations=Observations(foot_contact=True),
        rewards=Rewards(torques=-7.0),
        commands=Jumping(height=0.3, effort=2.0),
    )
    tasks.register_task("rover_of_this_test", tasks.get_task("quadruped").folder, today)
    folder = create_run(tmp_path / "run", today, "rover_of_this_test", "plane").folder
    assert open_run(folder).task == today
    lines = (folder / TASK_FILE).read_text().splitlines(keepends=True)
    keys = ("foot_contact", "torques", "effort")
    (folder / TASK_FILE).write_text("".join(line for line in lines if not line.startswith(keys)))
    task = open_run(folder).task
    assert (task.observations, task.rewards) == (Observations(), Rewards())
    assert task.commands == Jumping(height=0.3)


def test_local_run_precedes_bundled_policy(tmp_path, task, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("quadruped").mkdir()
    assert open_run("quadruped").folder == tasks.get_task("quadruped").trained_run
    create_run(Path("quadruped"), task, "biped", "plane")
    assert open_run("quadruped").info.robot == "biped"


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("nothing", r"run: got nothing; expected a folder .* biped, quadruped"),
        (".", r"has no run\.toml; terrainkit train writes"),
        ("a\0b", r"cannot read|run: got"),
    ],
)
def test_open_run_rejects_other_folders(tmp_path, monkeypatch, name, told):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError, match=told):
        open_run(name)


@pytest.mark.parametrize(("file", "old", "new", "told"), read_table(__file__, "malformed_files"))
def test_open_run_rejects_malformed_files(run, file, old, new, told):
    path = run / file
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(ConfigError, match=told):
        open_run(run)


def test_default_folders_are_unique_and_inside_logs(tmp_path, monkeypatch, task):
    monkeypatch.chdir(tmp_path)
    made = [create_run(default_folder("quadruped"), task, "quadruped", "plane") for _ in "abc"]
    assert len({each.folder for each in made}) == 3
    assert {each.folder.parent for each in made} == {Path("logs/quadruped")}
    for name in ("../../etc", "a/b", "..", "/", "my robot", "a\nb"):
        folder = default_folder(name)
        assert folder.parent.parent == Path("logs")
        assert folder.parent.name not in ("", ".", "..")

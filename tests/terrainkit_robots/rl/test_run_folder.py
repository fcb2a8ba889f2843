import re
import shutil
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from terrainkit import TerrainMap
from terrainkit.errors import ConfigError, ExportError, MapFileError
from terrainkit_robots.rl import tasks
from terrainkit_robots.rl.config import Rewards, Task
from terrainkit_robots.rl.run import (
    MAP_FILE,
    RUN_FILE,
    TASK_FILE,
    changed_robot_files,
    checkpoint_name,
    checkpoints,
    create_run,
    default_folder,
    is_same_terrain,
    open_run,
    rewrite_task,
)
from terrainkit_robots.rl.scene import Robot
from terrainkit_robots.rl.terrain import load_terrain


@pytest.fixture
def task() -> Task:
    return Task(rewards=Rewards(tracking_lin_vel=3.25))


@pytest.fixture
def run(tmp_path, task) -> Path:
    return create_run(tmp_path / "run", task, "quadruped", "plane").folder


def test_a_run_is_opened_as_it_was_created(run, task, quadruped):
    opened = open_run(run)
    assert opened.task == task
    assert opened.robot.spec == quadruped.spec
    assert opened.robot_name == "quadruped"
    assert opened.robot.mjcf == quadruped.mjcf
    assert opened.terrain == "plane"
    assert opened.checkpoint is None


def test_a_run_says_what_it_was_made_with(run):
    about = tomllib.loads((run / RUN_FILE).read_text())
    assert (about["robot"], about["terrain"], about["seed"]) == ("quadruped", "plane", 1)
    assert set(about["versions"]) == {"terrainkit", "mujoco", "rsl-rl-lib", "torch"}


def test_the_spec_is_the_one_that_was_trained(tmp_path, task, quadruped):
    mine = tmp_path / "mine"
    shutil.copytree(tasks.get_task("quadruped").folder, mine)
    folder = create_run(tmp_path / "run", task, mine, "plane").folder
    spec = mine / "robot.toml"
    spec.write_text(re.sub("spawn_height = [0-9.]+", "spawn_height = 7.5", spec.read_text()))
    assert Robot.load(mine).spec.spawn_height == 7.5
    opened = open_run(folder)
    assert opened.robot_name == str(mine)
    assert opened.robot.spec == quadruped.spec


def test_a_robot_that_is_gone_is_told(tmp_path, task):
    mine = tmp_path / "mine"
    shutil.copytree(tasks.get_task("quadruped").folder, mine)
    folder = create_run(tmp_path / "run", task, mine, "plane").folder
    (mine / "quadruped.xml").unlink()
    with pytest.raises(ConfigError, match=r"is gone: there is no file .*quadruped\.xml"):
        open_run(folder)


def test_what_changed_of_a_robot_is_told(tmp_path, task):
    mine = tmp_path / "mine"
    shutil.copytree(tasks.get_task("quadruped").folder, mine)
    run = open_run(create_run(tmp_path / "run", task, mine, "plane").folder)
    assert changed_robot_files(run) == ()
    for name in ("quadruped.xml", "robot.toml"):
        before = (mine / name).read_bytes()
        (mine / name).write_bytes(before + b"\n")
        assert changed_robot_files(run) == (name,)
        (mine / name).write_bytes(before)
    about = (run.folder / RUN_FILE).read_text().partition("[robot_sha256]")[0]
    (run.folder / RUN_FILE).write_text(about)
    (mine / "robot.toml").write_bytes(before + b"\n")
    assert changed_robot_files(run) == ()  # an earlier version did not note it


def test_a_map_that_is_gone_is_made_again(tmp_path, task, mixed_map):
    path = mixed_map.save(tmp_path / "map.npz")
    folder = create_run(tmp_path / "run", task, "quadruped", path).folder
    assert open_run(folder).terrain == str(path)
    path.unlink()
    opened = open_run(folder)
    assert opened.terrain == str(folder / MAP_FILE)
    again = load_terrain(opened.terrain)
    np.testing.assert_array_equal(again.env_origins, mixed_map.env_origins)


def test_a_mujoco_model_that_has_changed_is_another_ground(tmp_path, task):
    path = tmp_path / "ground.xml"
    path.write_text("<mujoco><worldbody><geom type='plane' size='9 9 1'/></worldbody></mujoco>")
    run = create_run(tmp_path / "run", task, "quadruped", path)
    assert is_same_terrain(run, path)
    assert not is_same_terrain(run, "plane")
    path.write_text(path.read_text().replace("9 9 1", "8 8 1"))
    assert not is_same_terrain(run, path)


def test_a_map_of_another_version_is_told_before_anything_is_written(tmp_path, task, mixed_map):
    path = mixed_map.save(tmp_path / "map.npz")
    arrays = dict(np.load(path))
    arrays["format_version"] = np.int64(99)
    np.savez(path, **arrays)
    with pytest.raises(MapFileError, match="99"):
        create_run(tmp_path / "run", task, "quadruped", path)
    assert not (tmp_path / "run").exists()
    with pytest.raises(MapFileError):
        TerrainMap.load(path)


def test_checkpoints_are_in_the_order_of_their_iterations(run):
    for name in ("model_9.pt", "model_10.pt", "model_100.pt", "model_x.pt", "my_model_7.pt"):
        (run / name).touch()
    assert list(checkpoints(run)) == [9, 10, 100]
    assert open_run(run).checkpoint == run / "model_100.pt"
    assert open_run(run, 9).checkpoint == run / checkpoint_name(9)
    assert open_run(run / "model_10.pt").checkpoint == run / "model_10.pt"
    with pytest.raises(ConfigError, match="has no checkpoint 11; there are: 9, 10, 100"):
        open_run(run, 11)


def test_a_run_that_is_there_is_never_overwritten(run, task):
    before = sorted((path.name, path.read_bytes()) for path in run.iterdir())
    with pytest.raises(ExportError, match="exists; another folder would do, or --resume"):
        create_run(run, task, "quadruped", "plane")
    assert sorted((path.name, path.read_bytes()) for path in run.iterdir()) == before


def test_a_folder_that_cannot_be_written_leaves_nothing(tmp_path, task):
    (tmp_path / "file").touch()
    with pytest.raises(ExportError, match=r"cannot write .*run: File exists"):
        create_run(tmp_path / "file" / "run", task, "quadruped", "plane")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_runs_of_the_same_second_have_names_of_their_own(tmp_path, monkeypatch, task):
    monkeypatch.chdir(tmp_path)
    folders = set()
    for _ in range(3):
        folders.add(create_run(default_folder("quadruped"), task, "quadruped", "plane").folder)
    assert len(folders) == 3
    assert {folder.parent for folder in folders} == {Path("logs/quadruped")}


@pytest.mark.parametrize("name", ["../../etc", "a/b", "..", "/", "my robot", "a\nb"])
def test_a_robot_of_any_name_has_its_folder_in_logs(name):
    folder = default_folder(name)
    assert folder.parent.parent == Path("logs")
    assert folder.parent.name not in ("", ".", "..")


def test_a_task_is_rewritten_whole(run, task):
    other = replace(task, runner=replace(task.runner, max_iterations=77))
    rewrite_task(open_run(run), other)
    assert open_run(run).task == other


def test_a_shipped_policy_is_found_by_the_name_of_its_robot(tmp_path, task, monkeypatch):
    monkeypatch.setattr(tasks, "_registered", dict(tasks._registered))
    mine = tmp_path / "mine"
    shutil.copytree(tasks.get_task("quadruped").folder, mine)
    shipped = tasks.register_task("rover_of_this_test", mine).shipped
    with pytest.raises(ConfigError, match="no policy is shipped with rover_of_this_test"):
        open_run("rover_of_this_test")
    create_run(shipped, task, "rover_of_this_test", "plane")
    opened = open_run("rover_of_this_test")
    assert opened.folder == shipped == mine / "trained" / "rover_of_this_test"
    assert opened.robot_name == "rover_of_this_test"


def test_a_run_goes_before_a_robot_of_its_name_and_any_other_folder_does_not(
    tmp_path, task, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    Path("quadruped").mkdir()
    assert open_run("quadruped").folder == tasks.get_task("quadruped").shipped
    create_run(Path("quadruped"), task, "biped", "plane")
    assert open_run("quadruped").robot_name == "biped"


def test_what_is_no_run_is_told(tmp_path):
    with pytest.raises(ConfigError, match=r"no run nothing: neither a folder .* biped, quadruped"):
        open_run("nothing")
    with pytest.raises(ConfigError, match=r"has no run\.toml; wanted a folder that terrainkit tr"):
        open_run(tmp_path)
    with pytest.raises(ConfigError, match=r"cannot read|no run"):
        open_run("a\0b")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("format_version = 1", "format_version = 2", "format_version is 2; wanted 1"),
        ('robot = "quadruped"', "robot = 3", "robot is 3; wanted a text"),
        ('robot = "quadruped"', 'robot = "gone"', "folder 'gone'"),
        ('terrain = "plane"', "", "terrain is 'missing'; wanted a text"),
        ("seed", "seed =", "not a TOML file"),
    ],
)
def test_a_run_file_that_is_wrong_is_told(run, old, new, said):
    path = run / RUN_FILE
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(ConfigError, match=said):
        open_run(run)


def test_a_task_file_that_is_wrong_names_the_key(run):
    path = run / TASK_FILE
    path.write_text(path.read_text().replace("tracking_lin_vel", "tracking_lin_vle"))
    with pytest.raises(ConfigError, match="tracking_lin_vle"):
        open_run(run)

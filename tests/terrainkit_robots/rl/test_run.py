import pickle
import re
import resource
import shutil
import tomllib
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from terrainkit import TerrainMap, generate
from terrainkit.errors import ConfigError, ExportError, MapFileError
from terrainkit_robots.rl import tasks
from terrainkit_robots.rl.config import Rewards, Task
from terrainkit_robots.rl.run import (
    MAP_FILE,
    RUN_FILE,
    TASK_FILE,
    Checkpoint,
    can_continue,
    changed_robot_files,
    checkpoints,
    create_run,
    default_folder,
    is_same_terrain,
    open_run,
    policy_state,
    read_checkpoint,
    run_folder,
    save_checkpoint,
)
from terrainkit_robots.rl.terrain import load_terrain
from terrainkit_robots.spec.robot import Robot


@pytest.fixture
def task() -> Task:
    return Task(rewards=Rewards(tracking_lin_vel=3.25))


@pytest.fixture
def run(tmp_path, task) -> Path:
    return create_run(tmp_path / "run", task, "quadruped", "plane").folder


def test_open_run_returns_what_was_created(run, task, quadruped):
    opened = open_run(run)
    assert opened.task == task
    assert opened.robot.spec == quadruped.spec
    assert opened.info.robot == "quadruped"
    assert opened.robot.mjcf == quadruped.mjcf
    assert opened.terrain == "plane"
    assert opened.checkpoint is None


def test_run_file_records_versions(run):
    about = tomllib.loads((run / RUN_FILE).read_text())
    assert (about["robot"], about["terrain"], about["seed"]) == ("quadruped", "plane", 1)
    assert set(about["versions"]) == {"terrainkit", "mujoco", "rsl-rl-lib", "torch"}


def test_open_run_uses_the_trained_spec(tmp_path, task, quadruped):
    mine = tmp_path / "mine"
    shutil.copytree(tasks.get_task("quadruped").folder, mine)
    folder = create_run(tmp_path / "run", task, mine, "plane").folder
    spec = mine / "robot.toml"
    spec.write_text(re.sub("spawn_height = [0-9.]+", "spawn_height = 7.5", spec.read_text()))
    assert Robot.load(mine).spec.spawn_height == 7.5
    opened = open_run(folder)
    assert opened.info.robot == str(mine)
    assert opened.robot.spec == quadruped.spec


def test_open_run_rejects_a_missing_robot(tmp_path, task):
    mine = tmp_path / "mine"
    shutil.copytree(tasks.get_task("quadruped").folder, mine)
    folder = create_run(tmp_path / "run", task, mine, "plane").folder
    (mine / "quadruped.xml").unlink()
    with pytest.raises(ConfigError, match=r"is missing: there is no file .*quadruped\.xml"):
        open_run(folder)


def test_changed_robot_files_names_the_files(tmp_path, task):
    mine = tmp_path / "mine"
    shutil.copytree(tasks.get_task("quadruped").folder, mine)
    run = open_run(create_run(tmp_path / "run", task, mine, "plane").folder)
    assert changed_robot_files(run) == ()
    for name in ("quadruped.xml", "robot.toml"):
        before = (mine / name).read_bytes()
        (mine / name).write_bytes(before + b"\n")
        assert changed_robot_files(run) == (name,)
        (mine / name).write_bytes(before)
    (mine / "robot.toml").write_bytes(before + b"\n")
    assert changed_robot_files(replace(run, info=replace(run.info, robot_sha256=None))) == ()


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
    with pytest.raises(ConfigError, match=r"map\.npz changed since .*run was trained; with a copy"):
        can_continue(run, "quadruped", path, task)


def test_create_run_rejects_map_of_other_version(tmp_path, task, mixed_map):
    path = mixed_map.save(tmp_path / "map.npz")
    arrays = dict(np.load(path))
    arrays["format_version"] = np.int64(99)
    np.savez(path, **arrays)
    with pytest.raises(MapFileError, match="99"):
        create_run(tmp_path / "run", task, "quadruped", path)
    assert not (tmp_path / "run").exists()
    with pytest.raises(MapFileError):
        TerrainMap.load(path)


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
    with pytest.raises(
        ExportError, match="exists; choose another folder, or continue with --resume"
    ):
        create_run(run, task, "quadruped", "plane")
    assert sorted((path.name, path.read_bytes()) for path in run.iterdir()) == before


def test_create_run_failure_leaves_nothing(tmp_path, task):
    (tmp_path / "file").touch()
    with pytest.raises(ExportError, match=r"cannot write .*run: File exists"):
        create_run(tmp_path / "file" / "run", task, "quadruped", "plane")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_default_folders_are_unique(tmp_path, monkeypatch, task):
    monkeypatch.chdir(tmp_path)
    folders = set()
    for _ in range(3):
        folders.add(create_run(default_folder("quadruped"), task, "quadruped", "plane").folder)
    assert len(folders) == 3
    assert {folder.parent for folder in folders} == {Path("logs/quadruped")}


@pytest.mark.parametrize("name", ["../../etc", "a/b", "..", "/", "my robot", "a\nb"])
def test_default_folder_is_inside_logs(name):
    folder = default_folder(name)
    assert folder.parent.parent == Path("logs")
    assert folder.parent.name not in ("", ".", "..")


def test_run_folder_replaces_the_task(run, task):
    (run / "model_1.pt").touch()
    other = replace(task, runner=replace(task.runner, max_iterations=77))
    assert run_folder(None, "quadruped", "plane", other, open_run(run)) == run
    assert open_run(run).task == other


def test_open_run_finds_bundled_policy_by_name(tmp_path, task, monkeypatch):
    monkeypatch.setattr(tasks, "_registered", dict(tasks._registered))
    mine = tmp_path / "mine"
    shutil.copytree(tasks.get_task("quadruped").folder, mine)
    shipped = tasks.register_task("rover_of_this_test", mine).trained_run
    with pytest.raises(ConfigError, match="no policy is shipped with rover_of_this_test"):
        open_run("rover_of_this_test")
    create_run(shipped, task, "rover_of_this_test", "plane")
    opened = open_run("rover_of_this_test")
    assert opened.folder == shipped == mine / "trained" / "rover_of_this_test"
    assert opened.info.robot == "rover_of_this_test"


def test_local_run_precedes_bundled_policy(tmp_path, task, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("quadruped").mkdir()
    assert open_run("quadruped").folder == tasks.get_task("quadruped").trained_run
    create_run(Path("quadruped"), task, "biped", "plane")
    assert open_run("quadruped").info.robot == "biped"


def test_open_run_rejects_other_folders(tmp_path):
    with pytest.raises(
        ConfigError, match=r"run: got nothing; expected a folder .* biped, quadruped"
    ):
        open_run("nothing")
    with pytest.raises(ConfigError, match=r"has no run\.toml; terrainkit train writes"):
        open_run(tmp_path)
    with pytest.raises(ConfigError, match=r"cannot read|run: got"):
        open_run("a\0b")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("format_version = 1", "format_version = 2", "format_version: got 2; expected one of: 1"),
        ('robot = "quadruped"', "robot = 3", "robot: got 3; expected a string"),
        ('robot = "quadruped"', 'robot = "gone"', "folder 'gone'"),
        ('terrain = "plane"', "", "terrain: missing; expected a string"),
        ("seed", "seed =", "not a TOML file"),
    ],
)
def test_open_run_rejects_malformed_run_file(run, old, new, said):
    path = run / RUN_FILE
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(ConfigError, match=said):
        open_run(run)


def test_open_run_names_the_wrong_key(run):
    path = run / TASK_FILE
    path.write_text(path.read_text().replace("tracking_lin_vel", "tracking_lin_vle"))
    with pytest.raises(ConfigError, match="tracking_lin_vle"):
        open_run(run)


@pytest.fixture
def state() -> dict[str, Any]:
    return {
        "iteration": 7,
        "robot": "rover",
        "joints": ["front", "rear"],
        "observed": {"policy": 3},
        "actor_state_dict": {"weight": torch.arange(6.0).reshape(2, 3)},
        "critic_state_dict": {"weight": torch.ones(1)},
        "processes": [
            {"rng": {"state": 2**127 + 1}, "levels": torch.arange(4), "pair": (1.5, 2.5)}
        ],
    }


def test_checkpoint_round_trip(tmp_path, state):
    save_checkpoint(tmp_path / "model.pt", state)
    read = read_checkpoint(tmp_path / "model.pt")
    assert read["iteration"] == 7
    assert read["joints"] == ["front", "rear"]
    torch.testing.assert_close(read["actor_state_dict"], state["actor_state_dict"], rtol=0, atol=0)
    (mine,) = read["processes"]
    assert mine["rng"]["state"] == 2**127 + 1
    assert mine["levels"].tolist() == [0, 1, 2, 3]
    assert mine["pair"] == (1.5, 2.5)


def test_policy_state_is_a_checkpoint(tmp_path, state):
    save_checkpoint(tmp_path / "whole.pt", state)
    save_checkpoint(tmp_path / "model.pt", policy_state(read_checkpoint(tmp_path / "whole.pt")))
    assert read_checkpoint(tmp_path / "model.pt").keys() == Checkpoint.__annotations__.keys()


def test_full_disk_keeps_the_previous_checkpoint(tmp_path, state):
    path = tmp_path / "model.pt"
    save_checkpoint(path, state)
    before, limits = path.read_bytes(), resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, limits[1]))
    try:
        with pytest.raises(ExportError, match=r"cannot write .*model\.pt: File too large"):
            save_checkpoint(path, state | {"more": torch.ones(1000)})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert path.read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["model.pt"]


def test_read_checkpoint_rejects_truncated_files(tmp_path, state):
    save_checkpoint(tmp_path / "whole.pt", state)
    data = (tmp_path / "whole.pt").read_bytes()
    path = tmp_path / "model.pt"
    for length in (0, 1, 100, len(data) // 2, len(data) - 1):
        path.write_bytes(data[:length])
        with pytest.raises(ConfigError, match="is not a checkpoint of terrainkit, or is damaged"):
            read_checkpoint(path)


def test_damaged_checkpoint_raises_one_line(tmp_path, state):
    save_checkpoint(tmp_path / "whole.pt", state)
    data = bytearray((tmp_path / "whole.pt").read_bytes())
    path, draw = tmp_path / "model.pt", np.random.default_rng(0)
    for _ in range(100):
        damaged = bytearray(data)
        for at in draw.integers(0, len(data), 5):
            damaged[at] ^= int(draw.integers(1, 256))
        path.write_bytes(damaged)
        try:
            read_checkpoint(path)
        except ConfigError as error:
            assert "\n" not in str(error)  # noqa: PT017 (damage may go unnoticed in a weight)


class _Harm:
    def __reduce__(self) -> Any:
        return print, ("harm",)


def test_read_checkpoint_executes_nothing(tmp_path, state, capsys):
    path = tmp_path / "model.pt"
    torch.save(state | {"format": "terrainkit checkpoint", "version": 1, "harm": _Harm()}, path)
    with pytest.raises(ConfigError, match="is not a checkpoint of terrainkit"):
        read_checkpoint(path)
    path.write_bytes(pickle.dumps(_Harm()))
    with pytest.raises(ConfigError, match="is not a checkpoint of terrainkit"):
        read_checkpoint(path)
    assert capsys.readouterr().out == ""


def test_read_checkpoint_rejects_compressed_files(tmp_path, state):
    save_checkpoint(tmp_path / "whole.pt", state)
    path = tmp_path / "model.pt"
    with (
        zipfile.ZipFile(tmp_path / "whole.pt") as whole,
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed,
    ):
        for name in whole.namelist():
            packed.writestr(name, whole.read(name))
    with pytest.raises(ConfigError, match="got a compressed file"):
        read_checkpoint(path)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"format": "other"}, "is not a checkpoint of terrainkit"),
        ({"version": 2}, r"Invalid enum value 2 - at `\$\.version`"),
        ({"iteration": "seven"}, r"Expected `int`, got `str` - at `\$\.iteration`"),
        ({"actor_state_dict": None}, r"Expected `object`, got `null` - at `\$\.actor_state_dict`"),
        ({"joints": [1]}, r"Expected `str`, got `int` - at `\$\.joints\[0\]`"),
    ],
)
def test_read_checkpoint_rejects_foreign_files(tmp_path, state, change, said):
    whole = {"format": "terrainkit checkpoint", "version": 1}
    torch.save(state | whole | change, tmp_path / "model.pt")
    with pytest.raises(ConfigError, match=said):
        read_checkpoint(tmp_path / "model.pt")


def test_read_checkpoint_rejects_nonfiles(tmp_path):
    with pytest.raises(ConfigError, match=r"cannot read .*gone\.pt: No such file"):
        read_checkpoint(tmp_path / "gone.pt")
    with pytest.raises(ConfigError, match=r"cannot read .*: is a folder, not a file"):
        read_checkpoint(tmp_path)
    with pytest.raises(ConfigError, match="cannot read /dev/zero: is a device, not a file"):
        read_checkpoint(Path("/dev/zero"))

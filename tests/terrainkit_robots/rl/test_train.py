import os
import resource
import shutil
import warnings
from dataclasses import replace
from pathlib import Path

import cv2
import pytest
import torch
from filelock import FileLock, Timeout

import terrainkit
from terrainkit.errors import ConfigError, ExportError, MemoryLimitError, TerrainkitWarning
from terrainkit_robots.checkpoint import read_checkpoint, save_checkpoint
from terrainkit_robots.rl import tasks
from terrainkit_robots.rl.config import Algorithm, Commands, Env, Runner, Terrain
from terrainkit_robots.rl.run import checkpoints, open_run
from terrainkit_robots.rl.train import train


@pytest.fixture(scope="module")
def trained_once(task, tmp_path_factory):
    """Return a run of four iterations with a checkpoint of each; tests use copies of it."""
    each = replace(task, runner=replace(task.runner, save_interval=1))
    folder = tmp_path_factory.mktemp("trained") / "run"
    train("quadruped", "plane", each, folder=folder)
    return folder


@pytest.fixture
def run_after(trained_once, tmp_path):
    """Return a function that copies the run with the checkpoints of some iterations."""

    def copy(*iterations, name="run"):
        folder = tmp_path / name
        shutil.copytree(trained_once, folder)
        for iteration, path in checkpoints(folder).items():
            if iteration not in iterations:
                path.unlink()
        return folder

    return copy


def with_iterations(task, iterations):
    return replace(task, runner=replace(task.runner, max_iterations=iterations))


def weights(path):
    return list(read_checkpoint(path)["actor_state_dict"].values())


def same_weights(a, b):
    return all(torch.equal(x, y) for x, y in zip(weights(a), weights(b), strict=True))


@pytest.fixture
def fill_disk():
    """Return a function that limits the size of files [bytes]."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def after(iteration, act):
    """Return a callback that acts once, after an iteration."""
    return lambda runner: act() if runner.current_learning_iteration == iteration else None


def test_train_writes_a_run_in_the_default_folder(task, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("OMP_WAIT_POLICY", raising=False)
    task = with_iterations(task, 1)
    trained = train("quadruped", "plane", task)
    run = open_run(trained.folder)
    assert (run.task, run.checkpoint) == (task, trained.folder / "model_1.pt")
    assert (trained.folder.parent, trained.current_learning_iteration) == (
        Path("logs/quadruped"),
        1,
    )
    assert os.environ["OMP_WAIT_POLICY"] == "PASSIVE"


def test_stopped_run_resumes_exactly(task, tmp_path, run_after):
    run_after(4, name="whole")
    calls = iter([False, False, True])
    stopped = train(
        "quadruped", "plane", task, folder=tmp_path / "run", should_stop=lambda: next(calls)
    )
    assert stopped.current_learning_iteration == 2
    assert list(checkpoints(tmp_path / "run")) == [2]
    train("quadruped", "plane", task, resume=open_run(tmp_path / "run"))
    assert list(checkpoints(tmp_path / "run")) == [2, 4]
    assert same_weights(tmp_path / "whole" / "model_4.pt", tmp_path / "run" / "model_4.pt")


def test_tensorboard_has_each_iteration_once_after_a_crash(task, tmp_path):
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    task = replace(task, runner=replace(task.runner, save_interval=2))
    train("quadruped", "plane", task, folder=tmp_path / "run")
    (tmp_path / "run" / "model_4.pt").unlink()  # as after a crash
    train("quadruped", "plane", task, resume=open_run(tmp_path / "run"))
    curves = EventAccumulator(str(tmp_path / "run")).Reload()
    tags = curves.Tags()["scalars"]
    assert {"Episode/rew_tracking_lin_vel", "Train/mean_reward", "Loss/value"} <= set(tags)
    assert [event.step for event in curves.Scalars("Loss/value")] == [1, 2, 3, 4]


def test_one_process_trains_in_a_folder(task, tmp_path, run_after):
    run = run_after(0, 1)
    before = {path: path.read_bytes() for path in run.iterdir()}
    longer = with_iterations(task, 5)
    with FileLock(run / ".lock"), pytest.raises(ConfigError, match="another process trains in th"):
        train("quadruped", "plane", longer, resume=open_run(run))
    assert {path: path.read_bytes() for path in run.iterdir() if path.name != ".lock"} == {
        path: data for path, data in before.items() if path.name != ".lock"
    }
    held = []

    def is_locked(runner):
        with pytest.raises(Timeout):
            FileLock(runner.folder / ".lock").acquire(timeout=0)
        held.append(runner.folder)

    train("quadruped", "plane", longer, resume=open_run(run), start_callback=is_locked)
    train("quadruped", "plane", longer, folder=tmp_path / "new", start_callback=is_locked)
    assert held == [run, tmp_path / "new"]
    FileLock(run / ".lock").acquire(timeout=0)  # a run that has ended holds none


def test_resume_from_earlier_checkpoint_overwrites_nothing(task, tmp_path, run_after):
    run, branch = run_after(2, 4), tmp_path / "branch"
    before = (run / "model_4.pt").read_bytes()
    done = train("quadruped", "plane", task, resume=open_run(run, 2), folder=branch)
    assert done.folder == branch
    assert (run / "model_4.pt").read_bytes() == before
    assert same_weights(run / "model_4.pt", branch / "model_4.pt")


def test_resume_of_a_modified_robot_warns_and_continues(task, tmp_path):
    mine, run = tmp_path / "mine", tmp_path / "run"
    shutil.copytree(tasks.get_task("quadruped").folder, mine)
    train(mine, "plane", with_iterations(task, 1), folder=run)
    model = mine / "quadruped.xml"
    model.write_text(model.read_text() + "\n")
    with pytest.warns(TerrainkitWarning, match=r"mine: quadruped\.xml changed after .*run was tr"):
        opened = open_run(run)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TerrainkitWarning)
        train(mine, "plane", with_iterations(task, 2), resume=opened)
    assert list(checkpoints(run)) == [1, 2]


def test_resume_with_other_task_starts_new_run(task, run_after, tmp_path, mixed_map):
    run = run_after(4)
    other = with_iterations(replace(task, rewards=replace(task.rewards, base_height=-1.0)), 1)
    seen, folder = [], tmp_path / "other"
    options = {"resume": open_run(run)}
    options["progress_callback"] = lambda runner: seen.append(runner.current_learning_iteration)
    assert train("quadruped", "plane", other, folder=folder, **options).folder == folder
    assert seen == [1]
    blind = with_iterations(replace(task, terrain=Terrain(measure_heights=False)), 1)
    path = mixed_map.save(tmp_path / "map.npz")
    done = train("quadruped", path, blind, folder=tmp_path / "map", **options)
    assert open_run(done.folder).terrain == str(path)


def test_new_run_keeps_optimizer_unless_rates_differ(task, tmp_path, run_after):
    """With a new optimizer and the initial rate, one update could undo the training."""
    run_after(4)
    run = open_run(tmp_path / "run")
    before = read_checkpoint(run.checkpoint)
    before["optimizer_state_dict"]["param_groups"][0]["lr"] = 3e-5
    save_checkpoint(run.checkpoint, before)
    steps = int(before["optimizer_state_dict"]["state"][0]["step"])
    for name, algorithm, rate, done in (
        ("as_before", replace(task.algorithm, entropy_coef=0.0), 3e-5, steps),
        ("rate", replace(task.algorithm, learning_rate=2e-4), 2e-4, 0),
        ("schedule", replace(task.algorithm, schedule="fixed"), 1e-3, 0),
    ):
        other = with_iterations(replace(task, algorithm=algorithm), 1)
        train("quadruped", "plane", other, resume=run, folder=tmp_path / name)
        after = read_checkpoint(open_run(tmp_path / name).checkpoint)["optimizer_state_dict"]
        # 2 epochs of 2 batches, each of which may change the rate by a factor of 1.5
        assert after["param_groups"][0]["lr"] == pytest.approx(rate, rel=1.5**4 - 1)
        assert int(after["state"][0]["step"]) == done + 4


def test_new_run_keeps_levels_on_same_map(task, tmp_path, mixed_map):
    path, copied, other = (tmp_path / f"{name}.npz" for name in ("map", "copied", "other"))
    mixed_map.save(path)
    mixed_map.save(copied)
    terrainkit.generate(replace(mixed_map.config, seed=mixed_map.config.seed + 1)).save(other)
    task = with_iterations(replace(task, terrain=Terrain(curriculum=None, max_init_level=0)), 1)
    train("quadruped", path, task, folder=tmp_path / "run")
    run = open_run(tmp_path / "run")
    before = read_checkpoint(run.checkpoint)
    curriculum = before["processes"][0]["env"]["curriculum"]
    top = len(curriculum["success"]) - 1
    curriculum["levels"][:] = top
    save_checkpoint(run.checkpoint, before)
    rewarded = replace(task, rewards=replace(task.rewards, base_height=-1.0))
    uniform = replace(rewarded, terrain=Terrain(curriculum="uniform", max_init_level=0))
    for ground, changed, levels in (
        (path, rewarded, {top}),
        (copied, rewarded, {top}),
        (other, rewarded, {0}),
        (path, uniform, {0}),
    ):
        folder = tmp_path / f"from_{ground.stem}_{changed.terrain.curriculum}"
        train("quadruped", ground, changed, resume=run, folder=folder)
        assert cv2.imread(str(folder / "curriculum.png")) is not None
        after = read_checkpoint(open_run(folder).checkpoint)["processes"][0]["env"]["curriculum"]
        assert set(after["levels"].tolist()) == levels


def test_resume_rejects_a_completed_run_and_another_robot(task, tmp_path, run_after):
    run = open_run(run_after(4))
    told = r"runner\.max_iterations: got 4; expected more than the 4"
    with pytest.raises(ConfigError, match=told):
        train("quadruped", "plane", task, resume=run)
    with pytest.raises(ConfigError, match=r"another robot, quadruped: got the joints .*_"):
        train("biped", "plane", task, resume=run, folder=tmp_path / "b")
    assert not (tmp_path / "b").exists()


def test_full_disk_keeps_the_last_checkpoint(task, tmp_path, capfd, fill_disk):
    task, run = replace(task, runner=replace(task.runner, save_interval=2)), tmp_path / "run"
    fill = after(3, lambda: fill_disk(20_000))
    told = r"cannot write .*model_4\.pt: File too large; .* is .*model_2\.pt"
    with pytest.raises(ExportError, match=told):
        train("quadruped", "plane", task, folder=run, progress_callback=fill)
    assert open_run(run).checkpoint == run / "model_2.pt"
    assert read_checkpoint(run / "model_2.pt")["iteration"] == 2
    assert [path.name for path in run.glob(".*")] == [".lock"]
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("fails", "told"),
    [("disk", "File too large; there is no check"), ("folder", "No such file or directory")],
)
def test_failure_to_log_is_one_error(task, tmp_path, capfd, fill_disk, fails, told):
    run = tmp_path / "run"
    # A thread writes logs into the folder, so that it cannot be deleted at any moment.
    harm = after(1, lambda: fill_disk(200) if fails == "disk" else run.rename(tmp_path / "gone"))
    with pytest.raises(ExportError, match=f"cannot write .*: {told}"):
        train("quadruped", "plane", task, folder=run, progress_callback=harm)
    assert capfd.readouterr() == ("", "")


def test_divergence_names_the_last_checkpoint(task, tmp_path):
    algorithm = replace(task.algorithm, learning_rate=1e9, schedule="fixed")
    policy = replace(task.policy, critic_hidden_dims=(8, 8, 8, 8))
    diverging = replace(task, algorithm=algorithm, policy=policy)
    told = r"iteration 1: the networks have diverged.*; there is no checkpoint"
    with pytest.raises(ConfigError, match=told):
        train("quadruped", "plane", diverging, folder=tmp_path / "run")


ONE_SAMPLE = {"env": Env(num_envs=1), "runner": Runner(num_steps_per_env=1)}
ONE_SAMPLE["algorithm"] = Algorithm(num_mini_batches=1)


@pytest.mark.parametrize(
    ("sections", "options", "error", "told"),
    [
        ({"env": Env(num_envs=10**8)}, {}, MemoryLimitError, r"num_envs 100000000, .* MB each, n"),
        ({"commands": Commands(waypoints=True)}, {}, ConfigError, "a terrain without goals"),
        ({}, {"device": "gpu"}, ConfigError, "device: got 'gpu'; expected one of: cpu"),
        (ONE_SAMPLE, {}, ConfigError, r"num_steps_per_env: got 1 with one env.*; expected 2"),
    ],
    ids=["memory", "waypoints", "device", "one sample"],
)
def test_invalid_arguments_write_nothing(task, tmp_path, sections, options, error, told):
    changed = replace(task, **sections)
    with pytest.raises(error, match=told):
        train("quadruped", "plane", changed, folder=tmp_path / "run", **options)
    assert list(tmp_path.iterdir()) == []


def test_missing_wandb_is_reported(task, tmp_path, monkeypatch):
    monkeypatch.setattr("rsl_rl.utils.wandb_log_writer.wandb", None)
    task = replace(task, runner=replace(task.runner, logger="wandb"))
    with pytest.raises(ConfigError, match=r"wandb does not start: .*: wandb package is required"):
        train("quadruped", "plane", task, folder=tmp_path / "run")


def test_train_rejects_more_processes_than_environments(task, tmp_path, monkeypatch):
    monkeypatch.setenv("WORLD_SIZE", "9")
    told = r"env\.num_envs: got 4; expected one for each of 9 processes"
    with pytest.raises(ConfigError, match=told):
        train("quadruped", "plane", task, folder=tmp_path / "run")

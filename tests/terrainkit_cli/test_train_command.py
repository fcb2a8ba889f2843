import importlib.util
import os
import re
import resource
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from types import SimpleNamespace

import pytest

from tests.tables import read_table

pytest.importorskip("torch", reason="the extra `train` is not installed")


from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError
from terrainkit_cli import render, signals, train_command
from terrainkit_cli.main import main
from terrainkit_cli.training_extra import require_training
from terrainkit_cli.training_progress import TrainingProgress
from terrainkit_robots.rl.run import checkpoints, open_run

Train = Callable[..., int]

QUICK = (
    *("--env.num-threads", "1", "--env.episode-length-s", "0.3", "--runner.num-steps-per-env", "8"),
    *("--policy.actor-hidden-dims", "16", "--policy.critic-hidden-dims", "16"),
)


@pytest.fixture
def train(tmp_path, monkeypatch) -> Iterator[Train]:
    """Run `terrainkit train` on very few robots, in an empty folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("warnings.showwarning", render.show_warning)
    before = signal.getsignal(signal.SIGTERM)

    def run(*words: object, quick: tuple[str, ...] = QUICK) -> int:
        return main(["train", *map(str, words), *quick])

    yield run
    signal.signal(signal.SIGTERM, before)


def test_train_on_a_map(train, tmp_path, capsys):
    terrains = (SubTerrain(terrain="stairs"),)
    config = MapConfig(rows=2, cols=1, patch_size=(6.0, 6.0), border=1.0, terrains=terrains)
    generate(config).save(tmp_path / "map.npz")
    words = ("--num-envs", 4, "--max-iterations", 2, "--rewards.tracking-lin-vel", 1.25)
    assert train("quadruped", "--terrain", "map.npz", *words) == 0
    (folder,) = tmp_path.glob("logs/*/*")
    run = open_run(folder)
    assert (run.info.robot, run.terrain) == ("quadruped", str(tmp_path / "map.npz"))
    assert (run.task.rewards.tracking_lin_vel, run.task.env.num_envs) == (1.25, 4)
    assert run.checkpoint.name == "model_2.pt"
    captured = capsys.readouterr()
    assert captured.out.startswith("trained 2 iterations: logs/quadruped/")
    start, progress = captured.err.splitlines()[:2]
    told = r"terrainkit: training quadruped on map.npz: 4 robots, 1 thread, in logs/quadruped/.*"
    assert re.fullmatch(told, start)
    assert progress.startswith("iteration 2/2: env steps/s ")
    assert "level stairs" in captured.err


def test_train_resumes_a_run(train, tmp_path, capsys):
    words = ("--num-envs", 4, "--seed", 3, "--log-dir", "run")
    assert train("quadruped", "--max-iterations", 1, *words) == 0
    assert train("--resume", "run", "--max-iterations", 2, quick=()) == 0
    assert list(checkpoints(tmp_path / "run")) == [1, 2]
    task = open_run(tmp_path / "run").task
    assert (task.runner.seed, task.env.num_envs, task.env.episode_length_s) == (3, 4, 0.3)
    capsys.readouterr()
    assert train("--resume", "run", quick=()) == 2
    assert capsys.readouterr().err.endswith("than the 2 iterations that are completed\n")


def test_a_named_task_replaces_the_task_of_the_run(train, tmp_path):
    words = ("--num-envs", 4, "--max-iterations", 1)
    assert train("quadruped", *words, "--rewards.progress", 0.25, "--log-dir", "run") == 0
    for named, name, expected in ((("quadruped",), "a", 0.5), ((), "b", 0.25)):
        given = (*named, "--resume", "run", "--rewards.collision", -2, "--log-dir", name)
        assert train(*given, *words) == 0
        assert open_run(tmp_path / name).task.rewards.progress == expected


@pytest.fixture
def interrupt(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Return a function that makes training raise signals in an iteration."""

    def interrupt_in(iteration: int, *numbers: signal.Signals) -> None:
        def show(progress: TrainingProgress) -> None:
            for number in numbers if progress.iteration == iteration else ():
                signal.raise_signal(number)

        monkeypatch.setattr(train_command, "shown_progress", lambda: nullcontext(show))

    return interrupt_in


INT, TERM, HUP = signal.SIGINT, signal.SIGTERM, signal.SIGHUP


@pytest.mark.parametrize(
    ("numbers", "code", "repeat_time", "saved"),
    [
        ((INT,), 130, 1.0, [2]),
        ((TERM,), 143, 1.0, [2]),
        ((HUP,), 129, 1.0, [2]),
        ((INT, TERM), 130, 99.0, [2]),  # a repeated signal counts once
        ((INT, INT), 130, 0.0, []),  # a second one ends at once
    ],
)
def test_train_interrupt_saves_checkpoint(
    train, tmp_path, capsys, interrupt, monkeypatch, numbers, code, repeat_time, saved
):
    monkeypatch.setattr(signals, "REPEAT_TIME", repeat_time)
    interrupt(2, *numbers)
    before = signal.getsignal(INT)
    assert train("quadruped", "--num-envs", 4, "--max-iterations", 9, "--log-dir", "my run") == code
    assert signal.getsignal(INT) == before
    assert list(checkpoints(tmp_path / "my run")) == saved
    told = ["stopped after 2 of 9 iterations: 'my run'"]
    told += ["continue: terrainkit train --resume 'my run'"]
    assert capsys.readouterr().out.splitlines() == (told if saved else [])
    last = train("quadruped", "--num-envs", 4, "--max-iterations", 2)
    assert last == (0 if saved else code)  # a signal in the last iteration is too late to stop it


@pytest.mark.parametrize(("words", "message"), read_table(__file__, "train_rejects_invalid_input"))
def test_train_rejects_invalid_input(rejected, tmp_path, words, message):
    assert message in rejected(f"train {words}")
    assert list(tmp_path.iterdir()) == []


def test_train_works_without_video_packages(monkeypatch):
    monkeypatch.delenv("OMP_WAIT_POLICY", raising=False)
    found = importlib.util.find_spec
    monkeypatch.setattr(
        "importlib.util.find_spec", lambda name: None if name == "imageio_ffmpeg" else found(name)
    )
    require_training()
    assert os.environ["OMP_WAIT_POLICY"] == "PASSIVE"
    with pytest.raises(ConfigError, match="missing packages: imageio_ffmpeg"):
        require_training("imageio_ffmpeg")


def test_train_requires_the_package_of_the_logger(train, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("terrainkit_cli.train_command.find_spec", lambda _: None)
    folder = tmp_path / "run"
    assert train("quadruped", "--runner.logger", "wandb", "--log-dir", str(folder)) == 2
    assert "runner.logger: wandb is not installed: pip install wandb" in capsys.readouterr().err
    assert not folder.exists()


def test_only_the_first_process_prints_the_result(capsys):
    train_command._print_result(SimpleNamespace(folder=None), None, None)
    assert capsys.readouterr().out == ""


@pytest.mark.skipif(sys.platform != "linux", reason="the limits are of Linux")
@pytest.mark.parametrize(
    ("limit", "words", "message"),
    [
        (10**9, (), "needs an address space of 1.30 GB; the limit is 1.00 GB (ulimit -v)"),
        (2 * 10**9, ("--num-envs", "16384"), "error: "),
    ],
)
def test_train_in_a_small_address_space_is_one_line(tmp_path, limit, words, message):
    command = [sys.executable, "-m", "terrainkit_cli.main", "train", "quadruped", *words]
    done = subprocess.run(
        [*command, "--max-iterations", "1", "--log-dir", str(tmp_path / "run")],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)),
        capture_output=True,
        text=True,
        check=False,
    )
    errors = [line for line in done.stderr.splitlines() if "training quadruped" not in line]
    assert done.returncode == 2, done.stderr
    assert len(errors) == 1
    assert message in errors[0]

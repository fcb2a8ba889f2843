"""The command runs in this process: importing torch anew for each test takes seconds."""

import importlib.util
import io
import os
import resource
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("torch", reason="the extra `train` is not installed")

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError
from terrainkit_cli import render, signals, train_command
from terrainkit_cli.main import main
from terrainkit_cli.training_extra import require_training
from terrainkit_robots.rl.run import checkpoints, open_run
from terrainkit_robots.rl.runner import TrainingProgress

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


def run_of(folder: Path) -> Path:
    (found,) = folder.glob("logs/*/*")
    return found


def make_map(folder: Path) -> Path:
    terrains = (SubTerrain(terrain="stairs"),)
    config = MapConfig(rows=2, cols=1, patch_size=(6.0, 6.0), border=1.0, terrains=terrains)
    return generate(config).save(folder / "map.npz")


def test_train_on_a_map(train, tmp_path, capsys):
    make_map(tmp_path)
    words = ("--num-envs", 4, "--max-iterations", 2, "--rewards.tracking-lin-vel", 1.25)
    assert train("quadruped", "--terrain", "map.npz", *words) == 0
    run = open_run(run_of(tmp_path))
    assert run.info.robot == "quadruped"
    assert run.terrain == str(tmp_path / "map.npz")
    assert run.task.rewards.tracking_lin_vel == 1.25
    assert run.task.env.num_envs == 4
    assert run.checkpoint.name == "model_2.pt"
    captured = capsys.readouterr()
    assert captured.out.startswith("trained 2 iterations: logs/quadruped/")
    start, progress = captured.err.splitlines()[:2]
    assert start.startswith("terrainkit: training quadruped on map.npz: 4 robots, ")
    assert "thread" in start
    assert "in logs/quadruped/" in start
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


@pytest.fixture
def interrupt(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Return a function that makes training raise signals in an iteration."""

    def interrupt_in(iteration: int, *numbers: signal.Signals) -> None:
        def show(progress: TrainingProgress) -> None:
            for number in numbers if progress.iteration == iteration else ():
                signal.raise_signal(number)

        monkeypatch.setattr(render, "training", lambda: nullcontext(show))

    return interrupt_in


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)]
)
def test_train_interrupt_saves_checkpoint(train, tmp_path, capsys, interrupt, number, code):
    interrupt(2, number)
    before = signal.getsignal(signal.SIGINT)
    assert train("quadruped", "--num-envs", 4, "--max-iterations", 9, "--log-dir", "my run") == code
    assert signal.getsignal(signal.SIGINT) == before
    assert list(checkpoints(tmp_path / "my run")) == [2]
    assert capsys.readouterr().out == (
        "stopped after 2 of 9 iterations: 'my run'\ncontinue: terrainkit train --resume 'my run'\n"
    )


def test_train_ignores_signal_in_last_iteration(train, interrupt):
    interrupt(2, signal.SIGTERM)
    assert train("quadruped", "--num-envs", 4, "--max-iterations", 2) == 0


def test_train_counts_repeated_signal_once(train, tmp_path, interrupt):
    interrupt(2, signal.SIGINT, signal.SIGTERM)
    assert train("quadruped", "--num-envs", 4, "--max-iterations", 9, "--log-dir", "run") == 130
    assert list(checkpoints(tmp_path / "run")) == [2]


def test_train_second_signal_ends_at_once(train, tmp_path, interrupt, monkeypatch):
    monkeypatch.setattr(signals, "REPEAT_TIME", 0.0)
    interrupt(1, signal.SIGINT, signal.SIGINT)
    assert train("quadruped", "--num-envs", 4, "--max-iterations", 9, "--log-dir", "run") == 130
    assert checkpoints(tmp_path / "run") == {}


def test_train_full_disk_is_one_line(train, tmp_path, capsys):
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, limits[1]))
    try:
        code = train("quadruped", "--num-envs", 4, "--max-iterations", 2, "--log-dir", "run")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    lines = capsys.readouterr().err.splitlines()
    assert code == 2
    assert [line for line in lines[1:] if not line.startswith("iteration")] == [
        "terrainkit: error: cannot write run/model_2.pt: File too large; there is no checkpoint"
    ]
    assert checkpoints(tmp_path / "run") == {}


def with_other_version(folder: Path) -> None:
    path = make_map(folder)
    arrays = dict(np.load(path))
    np.savez(path, **(arrays | {"format_version": np.int64(2)}))


def without_origins(folder: Path) -> None:
    path = make_map(folder)
    arrays = dict(np.load(path))
    del arrays["env_origins"]
    np.savez(path, **arrays)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "ROBOT: missing; expected a folder written by terrainkit onboard, or one of: biped,"),
        (("rover",), "no task or robot folder 'rover'"),
        (("quadruped", "--terrain", "moon"), "terrain: got 'moon'; expected plane, a map (.npz)"),
        (("quadruped", "--terrain", "gone.npz"), "no file gone.npz"),
        (("quadruped", "--num-envs", "many"), "--env.num-envs: got 'many'; expected an integer"),
        (("quadruped", "--num-envs", "0"), "--env.num-envs: got 0; expected an integer >= 1"),
        (("quadruped", "--num-envs", "100000000"), "env.num_envs 100000000"),
        (("quadruped", "--device", "tpu"), "device: got 'tpu'; expected one of: cpu"),
        (("quadruped", "--resume", "nowhere"), "run: got nowhere"),
        (("quadruped", "--rewards.torque", "1"), "did you mean --rewards.torques?"),
        (
            ("quadruped", "--rewards.torques", "much"),
            "--rewards.torques: got 'much'; expected a num",
        ),
        (("quadruped", "--config", "gone.toml"), "cannot read gone.toml"),
    ],
)
def test_train_rejects_invalid_input(train, tmp_path, capsys, words, message):
    assert train(*words) == 2
    error = capsys.readouterr().err
    assert error.startswith("terrainkit: error: ")
    assert error.count("\n") == 1
    assert message in error
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("make", "message"), [(with_other_version, "version"), (without_origins, "env_origins")]
)
def test_train_rejects_invalid_map(train, tmp_path, capsys, make, message):
    make(tmp_path)
    assert train("quadruped", "--terrain", "map.npz") == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert message in error
    assert [path.name for path in tmp_path.iterdir()] == ["map.npz"]


def test_train_names_missing_extra(train, capsys, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    assert train("quadruped") == 2
    assert "pip install '.[train]'" in capsys.readouterr().err


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


def test_train_options_override_task_file(train, tmp_path):
    (tmp_path / "task.toml").write_text("[rewards]\ntorques = -0.5\nbase_height = -0.25\n")
    words = ("--config", "task.toml", "--rewards.torques", "-0.125", "--num-envs", 4)
    assert train("quadruped", *words, "--max-iterations", 1, "--log-dir", "run") == 0
    rewards = open_run(tmp_path / "run").task.rewards
    assert (rewards.torques, rewards.base_height) == (-0.125, -0.25)


PROGRESS = TrainingProgress(
    folder=Path("logs/rover"),
    iteration=20,
    max_iterations=400,
    steps_per_second=1234.4,
    learning_fraction=0.25,
    eta=3723.0,
    reward=-1.5,
    episode_length=4.25,
    falls=0.125,
    speed=0.5,
    noise_std=0.875,
    rewards={"tracking_lin_vel": 0.5, "torques": -0.0625},
    shares={"tracking_lin_vel": 0.25, "torques": -0.03125},
    levels={"stairs": 3.5},
    success={"stairs": 0.75},
)


def test_training_progress_lines_are_sparse(capsys):
    with render.training() as watch:
        for iteration in range(1, 24):
            watch(PROGRESS._replace(iteration=iteration, max_iterations=23))
    out, err = capsys.readouterr()
    assert out == ""
    assert [line.split(":")[0] for line in err.splitlines()] == [
        "iteration 10/23",
        "iteration 20/23",
        "iteration 23/23",
        "iteration 23/23",
    ]
    assert err.splitlines()[0].endswith(
        "env steps/s 1234, to go 1:02:03, reward -1.50, episode 4.2 s, falls 12%, "
        "speed 0.50 m/s, noise std 0.88, "
        "level stairs 3.5"
    )


def test_training_reward_lines_are_sparse(capsys):
    with render.training() as watch:
        for iteration in range(1, 101):
            watch(PROGRESS._replace(iteration=iteration))
    terms = [line for line in capsys.readouterr().err.splitlines() if "env steps/s" not in line]
    rewards = "success stairs 75%, tracking_lin_vel +0.500 /s (25%), torques -0.062 /s (-3%)"
    assert terms == [f"iteration 50/400: {rewards}", f"iteration 100/400: {rewards}"]


def test_training_progress_on_terminal_is_table(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with render.training() as watch:
        watch(PROGRESS)
    shown = terminal.getvalue()
    for text in ("iteration 20/400", "1:02:03", "tracking_lin_vel", "+0.500 /s", "75% succeed"):
        assert text in shown


def test_train_requires_the_package_of_the_logger(train, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("terrainkit_cli.train_command.find_spec", lambda _: None)
    folder = tmp_path / "run"
    assert train("quadruped", "--runner.logger", "wandb", "--log-dir", str(folder)) == 2
    assert "runner.logger: wandb is not installed: pip install wandb" in capsys.readouterr().err
    assert not folder.exists()


def test_only_the_first_process_prints_the_result(capsys):
    train_command._print_result(SimpleNamespace(folder=None), None)
    assert capsys.readouterr().out == ""
